"""Recorded lids: where they are shut, which is not where a tracker says 0, and where they are open, which is not 1."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.motion.gaps import runs

DIP, DIP_S = 0.3, 0.5
"""A blink takes the lids down by at least this share of the opening, and up again within this time, seconds."""
DEEPEST = 0.1
"""Share of the blinks that shut the eyes as far as they go."""
OPEN = 0.9
"""Quantile of a person's openings that counts as open: some rest with lids that cover a part of the eye."""


@dataclass(frozen=True)
class Lids:
    """What whoever recorded a person says of lids that are shut, and of open ones."""

    shut: float
    opened: float

    @classmethod
    def of(cls, pieces: Sequence[Motion]) -> Self:
        """Of all recordings of a person together."""
        openings = np.concatenate([np.zeros(0), *(eyes_of(piece)[:, 0] for piece in pieces)])
        known, shut = openings[np.isfinite(openings)], shut_level(pieces)
        opened = float(np.quantile(known, OPEN)) if len(known) else 1.0
        return cls(shut, opened if opened > shut + DIP else 1.0)

    def opening(self, piece: Motion) -> Floats:
        """[T, 1] opening of the lids: 0 where they are shut, 1 where they are open."""
        return np.clip((eyes_of(piece)[:, :1].astype(np.float64) - self.shut) / (self.opened - self.shut), 0, 1)


def shut_level(pieces: Sequence[Motion]) -> float:
    """Opening at which the lids are shut: what the deepest tenth of the blinks reaches; 0 where there are none.

    Whoever follows lids through video sees them shut at a height of their own, rarely in the very frame, and many blinks
    are not whole.
    """
    lowest = [low for piece in pieces for low in _dips(eyes_of(piece)[:, 0], piece.fps)]
    return float(np.clip(np.quantile(lowest, DEEPEST), 0, 1 - DIP)) if lowest else 0.0


def eyes_of(motion: Motion) -> NDArray[np.float32]:
    """[T, 3] eyes that a motion must have."""
    if motion.eyes is None:
        raise FacesynthError("a recording without eyes teaches none; take those out that have no gaze and no lids")
    return motion.eyes


def _dips(opening: NDArray[np.floating], fps: float) -> list[float]:
    """Lowest value of each short dip of the opening [T]."""
    usual = float(np.median(opening))
    return [
        float(opening[run.start : run.stop].min())
        for run in runs(opening < usual - DIP)
        if len(run) <= DIP_S * fps and run.start > 0 and run.stop < len(opening)
    ]
