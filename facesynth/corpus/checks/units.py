"""Whether a motion is in its layout's unit: millimetres, pixels, or weights from 0 to 1."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.checks.problem import Problem
from facesynth.inference.arrays import Floats
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

UNITS_MM = {
    "metres": 1e3,
    "decimetres": 1e2,
    "inches": 25.4,
    "centimetres": 10.0,
    "tenths of a millimetre": 0.1,
    "micrometres": 1e-3,
}
FACE_MM = (60.0, 600.0)
"""Largest extent that the points of a face can have, from a mouth alone to head and shoulders."""
USUAL_MM = {"mouth": 52.0, "brows": 110.0, "eyelids": 95.0, "lips_outer": 52.0}
"""How wide parts of a face are, give or take a fifth."""
LIKE_REST = (0.75, 1.33)
"""A recording's middle pose may be so much smaller or larger than the rest pose."""
NEAR = 1.25
"""A unit that explains a size over the rest pose's to within this factor is meant."""
NEAR_PEOPLE = 1.5
"""The same where only people's usual sizes are known; inches and centimetres are 2.5 apart."""
SMALLEST_FACE_PX = 8.0
LARGEST_WEIGHT = 2.0
"""Weights beyond 1 are exaggerations; beyond this they are something else."""


def unit_problems(file: str, motion: Motion, middle: Floats) -> Iterator[Problem]:
    """middle: [K, D] the recording's middle pose. One problem at most."""
    if motion.layout.kind == "curves":
        yield from _weights(file, motion)
        return
    seen = np.asarray(np.isfinite(middle).all(axis=1))
    if seen.sum() < 3:
        return
    ratio, extent = _over_rest(middle, seen, motion.layout), _extent(middle[seen])
    if ratio is not None and not LIKE_REST[0] <= ratio <= LIKE_REST[1]:
        what = f"the face is {_times(ratio)} than the rest pose of corpus.yaml{_guess(1 / ratio, motion.layout)}"
        yield Problem(file, what, f"bring it to the unit of the rest pose ({motion.layout.unit}) and add it again")
    elif motion.layout.kind == "landmarks" and extent < SMALLEST_FACE_PX:
        what = f"the face is {extent:.3g} px large; are these shares of the picture (0 to 1)?"
        yield Problem(file, what, "multiply x by the picture's width and y by its height, and add it again")
    elif motion.layout.kind == "markers" and not FACE_MM[0] <= extent <= FACE_MM[1]:
        do = "scale the motion (and the layout's neutral) to millimetres and add it again"
        yield Problem(file, f"the face is {extent:.3g} mm large{_by_anatomy(middle, extent, motion.layout)}", do)


def _weights(file: str, motion: Motion) -> Iterator[Problem]:
    low, high = float(np.nanmin(motion.frames)), float(np.nanmax(motion.frames))
    if max(-low, high) <= LARGEST_WEIGHT:
        return
    meant = "; in per cent?" if low >= -1 and high <= 110 else "; from 0 to 255?" if low >= -1 and high <= 256 else ""
    worst = motion.layout.names[int(np.nanmax(np.abs(motion.frames), axis=0).argmax())]
    do = (
        "divide by 100, or by whatever 1 is, and add it again"
        if meant != "; from 0 to 255?"
        else "divide by 255 and add it again"
    )
    yield Problem(file, f"weights lie between {low:.3g} and {high:.3g} (most: {worst}), wanted 0 to 1{meant}", do)


def _over_rest(middle: Floats, seen: NDArray[np.bool_], layout: Layout) -> float | None:
    """Size of the middle pose over that of the rest pose (root mean square distance from the centre)."""
    if layout.neutral is None:
        return None
    rest = np.asarray(layout.neutral, np.float64).reshape(-1, layout.dimension)
    both = seen & np.isfinite(rest).all(axis=1)
    size = float(np.linalg.norm(rest[both] - rest[both].mean(axis=0))) if both.sum() >= 3 else 0.0
    return float(np.linalg.norm(middle[both] - middle[both].mean(axis=0))) / size if size > 0 else None


def _by_anatomy(middle: Floats, extent: float, layout: Layout) -> str:
    """The unit in which parts of the face are as wide as people's, or in which the whole has a possible size."""
    wide = [
        usual / width
        for group, usual in USUAL_MM.items()
        if group in layout.groups and (width := _width(middle[layout.group(group)])) > 0
    ]
    if wide and (guess := _nearest(float(np.median(wide)), NEAR_PEOPLE)):
        return f"; in {guess}?"
    fitting = [unit for unit, scale in UNITS_MM.items() if FACE_MM[0] <= extent * scale <= FACE_MM[1]]
    return f"; in {' or '.join(fitting)}?" if fitting else ""


def _guess(scale: float, layout: Layout) -> str:
    guess = _nearest(scale, NEAR) if layout.kind == "markers" else ""
    shares = layout.kind == "landmarks" and scale > 50
    return f"; in {guess}?" if guess else "; are these shares of the picture (0 to 1)?" if shares else ""


def _nearest(scale: float, within: float) -> str:
    """The unit whose millimetres are nearest to a scale, if one is near; empty otherwise."""
    unit = min(UNITS_MM, key=lambda name: abs(np.log(UNITS_MM[name] / scale)))
    return unit if abs(np.log(UNITS_MM[unit] / scale)) < np.log(within) else ""


def _times(ratio: float) -> str:
    return f"{ratio:.3g} times larger" if ratio > 1 else f"{1 / ratio:.3g} times smaller"


def _extent(points: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _width(points: Floats) -> float:
    """How far the points of a part reach from side to side; 0 where there are fewer than two."""
    seen = points[np.isfinite(points).all(axis=1)]
    return float(np.ptp(seen[:, 0])) if len(seen) > 1 else 0.0
