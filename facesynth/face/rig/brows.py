"""Brows and mouth corners that move as far, and where, as people's do.

The source's browInnerUp lifts the whole brow, by 5 mm at its inner end and 3 mm in its middle, and its browDown lowers the outer
half by more than the inner one: neither slants a brow, which is what tells sorrow and anger apart from weariness. Here the
frontalis lifts inner ends by 9 mm and the outer third not at all (action unit 1 of FACS), the corrugator draws them 5 mm together
and 8 mm down and leaves the outer ends (unit 4), and the outer part rises by itself (unit 2).

A point moves by what the brow under or over it does, less with its height over the brow's line: skin slides over the
forehead and is gone into folds at the root of the nose and at the lid. Places are millimetres on the built-in head, from between
the eyes; profiles are read off along |x|.
"""

import numpy as np
from numpy.typing import NDArray

from facesynth.motion.arkit_names import ARKIT_NAMES

BROW_START_MM, BROW_LENGTH_MM = 10.5, 41.0
"""Where a brow begins by the nose, and how far it reaches."""
FROWN = 1.25
"""Factor of mouthFrown: the corners of the mouth go down by 7 mm, 5.6 in the source."""

Field = NDArray[np.float64]


def move_like_people(shapes_mm: Field, rest_mm: Field, skin: NDArray[np.bool_]) -> Field:
    """Shapes [52, V, 3] with brows and frown of their own, for a face rest_mm [V, 3] whose skin is marked [V]."""
    moved = shapes_mm.copy()
    front = skin & (rest_mm[:, 2] > 95)
    moved[ARKIT_NAMES.index("browInnerUp")] = inner_up(rest_mm) * front[:, None]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        own = front * step(-7.0, 7.0, sign * rest_mm[:, 0])
        moved[ARKIT_NAMES.index(f"browDown{side}")] = brow_down(rest_mm) * own[:, None]
        moved[ARKIT_NAMES.index(f"browOuterUp{side}")] = outer_up(rest_mm) * own[:, None]
        moved[ARKIT_NAMES.index(f"mouthFrown{side}")] *= FROWN
    return moved


def inner_up(place: Field) -> Field:
    """[V, 3] both inner ends up, and a little together."""
    across, over = np.abs(place[:, 0]), over_brow_mm(place)
    near = _around(over, 33.0, 3.0, -15.0, -3.0)
    up = near * np.interp(across, [0, 6, 12, 18, 24, 30, 36, 42], [6.5, 8.0, 9.0, 7.6, 5.0, 2.3, 0.6, 0.0])
    together = near * np.interp(across, [0, 8, 14, 24, 34], [0.0, 0.8, 1.2, 0.6, 0.0])
    back = 0.003 * up * np.maximum(over, 0.0)  # the forehead leans back
    return np.stack([-np.sign(place[:, 0]) * together, up, -back], axis=1)


def brow_down(place: Field) -> Field:
    """[V, 3] brows together and down, most at the inner ends, whose skin bulges."""
    across, over = np.abs(place[:, 0]), over_brow_mm(place)
    near = _around(over, 30.0, 0.0, np.interp(across, [0, 8, 16, 26], [-23.0, -21.0, -15.0, -13.0]), 1.5)
    down = np.interp(across, [0, 6, 12, 18, 26, 34, 42, 50], [5.6, 7.0, 8.2, 7.8, 6.2, 3.8, 1.4, 0.2])
    together = np.interp(across, [0, 4, 10, 18, 28, 40, 52], [0.0, 2.2, 4.6, 4.2, 3.0, 1.6, 0.6])
    forward = np.interp(across, [0, 6, 12, 24, 36, 50], [0.8, 1.2, 1.4, 1.2, 0.8, 0.2])
    return near[:, None] * np.stack([-np.sign(place[:, 0]) * together, -down, forward], axis=1)


def outer_up(place: Field) -> Field:
    """[V, 3] the outer half of the brows up."""
    across = np.abs(place[:, 0])
    near = _around(over_brow_mm(place), 33.0, 3.0, -15.0, -3.0)
    up = near * np.interp(across, [12, 20, 28, 36, 44, 52, 60], [0.0, 1.0, 3.2, 5.8, 6.8, 5.6, 2.0])
    return np.stack([0 * up, up, -0.08 * up], axis=1)


def over_brow_mm(place: Field) -> Field:
    """[...] height of points [..., 3] over the line along the middle of the brow: an arch that falls to the temple."""
    along = np.clip((np.abs(place[..., 0]) - BROW_START_MM) / BROW_LENGTH_MM, 0.0, 1.0)
    height: Field = place[..., 1] - brow_line_mm(along)
    return height


def brow_line_mm(along: Field) -> Field:
    """Height of the brow's middle; `along` is 0 at its start by the nose and 1 at its end."""
    line: Field = 15.2 + 9.2 * along - 7.6 * along**3 + 1.3 * np.sin(np.pi * np.clip(along, 0.0, 1.0))
    return line


def step(low: float | Field, high: float | Field, x: Field) -> Field:
    """Smoothly from 0 at low to 1 at high; high may be the smaller."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    smooth: Field = t * t * (3 - 2 * t)
    return smooth


def _around(over: Field, top: float, above: float, bottom: float | Field, below: float) -> Field:
    """1 on the brow's line, 0 from `top` and `bottom` on; whole between `below` and `above`."""
    return np.where(over > 0, step(top, above, over), step(bottom, below, over))
