"""Key poses of a head, given by a person: at this time it looks there."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FacesynthError
from ..quaternions import from_angles, to_rotvec
from ..speech import PhoneTrack

COLUMNS = ("time_s", "pitch", "yaw", "roll")


@dataclass(frozen=True, eq=False)
class HeadKeys:
    """Key poses, the earliest first."""

    times_s: NDArray[np.float64]
    """[n] strictly increasing, from 0."""
    poses: NDArray[np.float64]
    """[n, 6] rotation vector (rad) and translation (mm)."""

    def __post_init__(self) -> None:
        times, poses = np.asarray(self.times_s, np.float64), np.asarray(self.poses, np.float64)
        if times.ndim != 1 or poses.shape != (len(times), 6) or not np.isfinite(poses).all():
            raise FacesynthError(
                f"key poses need finite poses [n, 6], one for each time; got {poses.shape} for {times.shape} times"
            )
        if not np.isfinite(times).all() or (len(times) and times[0] < 0) or not (np.diff(times) > 0).all():
            raise FacesynthError(f"key poses must come one after the other, from 0 s on; got times {times[:6].tolist()}")
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "poses", poses)

    @classmethod
    def none(cls) -> "HeadKeys":
        """Nobody gave any."""
        return cls(np.zeros(0), np.zeros((0, 6)))

    def targets(self, first: int, stop: int, fps: float, rest: NDArray[np.float64]) -> tuple[NDArray, NDArray[np.bool_]]:
        """[n, 6] the next key pose at each of the frames first..stop, rest after the last; [n] frames that have one."""
        frames = np.round(self.times_s * fps).astype(np.int64)
        at = np.arange(first, max(first, stop))
        following = np.concatenate([self.poses, rest[None]])
        return following[np.searchsorted(frames, at)], np.isin(at, frames)


def read_head_keys(path: Path, phones: PhoneTrack) -> HeadKeys:
    """A CSV with columns time_s and, in degrees, pitch (down), yaw (to the performer's left), roll (left side up).

    FacesynthError, with the line, for times that do not rise or lie beyond the end of what is spoken.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            got = [name.strip() for name in reader.fieldnames or []]
            if lacking := [name for name in COLUMNS if name not in got]:
                raise FacesynthError(f"{path} lacks {', '.join(lacking)}; key poses are a CSV with columns {','.join(COLUMNS)}")
            rows = [(reader.line_num, [_number_in(path, reader.line_num, row, name) for name in COLUMNS]) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path}: cannot read key poses ({error})") from None
    before = -1.0
    for line, (time_s, *_) in rows:
        if not before < time_s:
            raise FacesynthError(
                f"{path}, line {line}: {time_s:g} s is not later than the line before ({before:g} s); sort the lines"
            )
        if not 0 <= time_s <= phones.duration_s:
            raise FacesynthError(f"{path}, line {line}: {time_s:g} s is outside of the speech, 0 to {phones.duration_s:.3f} s")
        before = time_s
    table = np.array([values for _, values in rows]).reshape(-1, len(COLUMNS))
    turns = to_rotvec(from_angles(np.radians(table[:, 1:])))
    return HeadKeys(table[:, 0], np.concatenate([turns, np.zeros((len(table), 3))], axis=1))


def _number_in(path: Path, line: int, row: dict[str, str], name: str) -> float:
    return table_number(path, line, name, {key.strip(): cell for key, cell in row.items() if key}.get(name))


def table_number(path: Path, line: int, column: str, cell: str | None) -> float:
    """The finite number in a cell; FacesynthError, with the line, for anything else."""
    try:
        value = float(cell or "")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FacesynthError(f"{path}, line {line}: {column} must be a number; got {cell!r}")
    return value
