"""Whether a motion's axes are those of its rest pose: to the performer's left, up, out of the face."""

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.checks.problem import Problem
from facesynth.inference.layout import Layout

Floats = NDArray[np.float64]

FEWEST_POINTS = 5
BETTER = 0.4
"""The right axes leave less than this share of the distance that those of the file leave."""
HIGH, LOW = ("forehead", "brows", "eyelids", "upper_face"), ("mouth", "lower_lip", "jaw")
AXES = "xyz"


def axis_problems(file: str, middle: Floats, layout: Layout) -> Iterator[Problem]:
    """middle: [K, D] the recording's middle pose. One problem at most."""
    if layout.neutral is None:
        upside_down = _upside_down(middle, layout)
    else:
        rest = np.asarray(layout.neutral, np.float64).reshape(-1, layout.dimension)
        turn = _turn(middle, rest)
        if turn is not None:
            yield Problem(file, _turn_text(turn), f"{_turn_remedy(turn)}, and add the recording again")
            return
        upside_down = _upside_down(rest, layout) and _upside_down(middle, layout)
    if upside_down:
        what = "the face is upside down: its forehead or brows lie below its mouth, so y does not run upwards"
        yield Problem(file, what, "turn the y axis round (in the layout's neutral as well), and add the recordings again")


def _turn(middle: Floats, rest: Floats) -> Floats | None:
    """[D, D] signed permutation that lays the middle on the rest far better than leaving it; None where there is none."""
    seen = np.isfinite(middle).all(axis=1) & np.isfinite(rest).all(axis=1)
    if seen.sum() < FEWEST_POINTS:
        return None
    a, b = middle[seen] - middle[seen].mean(axis=0), rest[seen] - rest[seen].mean(axis=0)
    a *= np.linalg.norm(b) / max(float(np.linalg.norm(a)), 1e-9)
    turns = _signed_permutations(rest.shape[1])
    left = [float(np.linalg.norm(a @ turn - b)) for turn in turns]
    best = int(np.argmin(left))
    return turns[best] if left[best] < BETTER * left[0] else None


def _signed_permutations(dimension: int) -> list[Floats]:
    """All of them, the identity first."""
    orders, signs = permutations(range(dimension)), list(product((1.0, -1.0), repeat=dimension))
    return [np.diag(sign)[:, order] for order in orders for sign in signs]


def _turn_text(turn: Floats) -> str:
    flipped = [AXES[axis] for axis in range(len(turn)) if turn[axis, axis] < 0]
    if np.count_nonzero(np.diag(turn)) < len(turn):
        return f"its axes are exchanged: what the rest pose calls {', '.join(AXES[: len(turn)])} is its {_sources(turn)}"
    mirrored = "; left and right are mirrored" if flipped == ["x"] else "; the face is upside down" if "y" in flipped else ""
    return f"against the rest pose its {' and '.join(flipped)} ax{'is is' if len(flipped) == 1 else 'es are'} flipped{mirrored}"


def _turn_remedy(turn: Floats) -> str:
    return f"convert it with the axes {_sources(turn).replace(' ', '')}"


def _sources(turn: Floats) -> str:
    """Such as `x, z, -y`: which axis each column takes, and its sign."""
    rows = np.abs(turn).argmax(axis=0)
    return ", ".join(("-" if turn[row, column] < 0 else "") + AXES[row] for column, row in enumerate(rows.tolist()))


def _upside_down(shape: Floats, layout: Layout) -> bool:
    high, low = (
        [k for group in groups for k in layout.groups.get(group, ()) if np.isfinite(shape[k]).all()] for groups in (HIGH, LOW)
    )
    return bool(high and low and shape[high, 1].mean() < shape[low, 1].mean())
