"""How far lips are open between shut and wide, evened out.

Openings of the talker of GRID s1 are skewed: small ones are many, and few are wide. Those of others, by video and by
articulography, are not. With x = (gap - shut) / (wide - shut) an opening becomes shut + (wide - shut) x^power, so that lips that
are shut stay shut, wide ones stay as wide, and for a power below 1 those in between are wider.
"""

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .closures import bring_together
from .layout import Layout
from .lips import gap, has_lips
from .long_arrays import Growing, row_blocks


@dataclass(frozen=True)
class Openings:
    """How openings are changed."""

    power: float
    """1 leaves them as they are."""
    shut: float
    """The gap of the inner lips at p, b and m, in the layout's unit …"""
    wide: float
    """… and one that is seldom exceeded."""

    def changed(self, gaps: Floats) -> Floats:
        """[T] openings [T]; lips that are nearer than at a closure are left."""
        size = self.wide - self.shut
        if size <= 0:
            return gaps
        return np.where(gaps > self.shut, self.shut + size * np.maximum((gaps - self.shut) / size, 0.0) ** self.power, gaps)

    def even_out(self, frames: Floats, layout: Layout) -> Floats:
        """Frames [T, C] with these openings: both lips move half of the way. Layouts without lip pairs stay as they are."""
        if not has_lips(layout):
            return frames
        parts = Growing(frames.dtype)
        for rows in row_blocks(frames):
            some = frames[rows].copy()
            gaps = gap(some, layout)
            correction = np.zeros((len(some), len(layout.lip_pairs), layout.dimension))
            correction[..., 1] = (gaps - self.changed(gaps))[:, None] / 2
            bring_together(layout.points(some), layout, correction)
            parts.add(some)
        return parts.whole()
