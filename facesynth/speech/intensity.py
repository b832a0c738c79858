"""How strongly an emotion is felt over time, in files: a CSV of time_s,intensity."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack

COLUMNS = ["time_s", "intensity"]
STEP_S = 0.05
"""Length of the intervals that a curve is cut into, s."""


@dataclass(frozen=True, eq=False)
class IntensityCurve:
    """Intensities from 0 to 1 at moments, straight lines between them, held before the first and after the last."""

    times_s: NDArray[np.float64]
    """[N] strictly increasing."""
    intensities: NDArray[np.float64]
    """[N]"""

    def over(self, track: EmotionTrack) -> EmotionTrack:
        """A track whose intensities are multiplied by the curve, in intervals of 50 ms."""
        end_s = float(track.ends_s[-1])
        ends_s = np.union1d(np.append(np.arange(STEP_S, end_s - STEP_S / 2, STEP_S), end_s), track.ends_s)
        middles_s = (ends_s + np.concatenate([[0.0], ends_s[:-1]])) / 2
        owner = track.index_at(middles_s)
        share = np.interp(middles_s, self.times_s, self.intensities)
        return EmotionTrack(tuple(track.labels[k] for k in owner), ends_s, track.intensities[owner] * share)


def read_intensity(path: str | Path) -> IntensityCurve:
    """A curve from a CSV with the header time_s,intensity; FacesynthError names the line that cannot be used."""
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [(number, [cell.strip() for cell in row]) for number, row in enumerate(csv.reader(file), 1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as an intensity curve ({error})") from None
    if len(lines) < 2 or lines[0][1] != COLUMNS:
        raise FacesynthError(f"{path}: wanted the header {','.join(COLUMNS)} and a line for each moment; got {lines[:1]}")
    rows: list[tuple[float, float]] = []
    for number, row in lines[1:]:
        try:
            time_s, intensity = (float(cell) for cell in row)
        except ValueError:
            raise FacesynthError(f"{path}, line {number}: wanted two numbers; got {','.join(row)}") from None
        if not (0 <= intensity <= 1 and 0 <= time_s < float("inf")) or (rows and time_s <= rows[-1][0]):
            raise FacesynthError(
                f"{path}, line {number}: times rise from 0 or later and intensities lie from 0 to 1; got {','.join(row)}"
            )
        rows.append((time_s, intensity))
    return IntensityCurve(*np.array(rows).T)
