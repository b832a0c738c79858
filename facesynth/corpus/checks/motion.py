"""What can be wrong with a motion track by itself: missing, frozen, jumping, on other axes, or in another unit."""

from collections.abc import Iterator
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.checks.problem import Problem
from facesynth.corpus.checks.swaps import swap_problems
from facesynth.corpus.checks.units import unit_problems
from facesynth.corpus.journal import node_name
from facesynth.corpus.limits import LARGEST_MISSING_SHARE
from facesynth.inference.arrays import Floats
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.gaps import missing_in, runs

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


NOTED_MISSING_SHARE = 0.2
"""Share of missing samples above which a recording is hardly worth using."""
LONGEST_FREEZE_S = 1.0
"""A real face is never still for so long, not even in silence."""
LONGEST_LONE_FREEZE_S = 0.5
"""A point that keeps its value for longer while others move was held, not seen; gaps that importers fill are shorter."""
MOST_STILL = 0.6
"""Points, and moments, of which a larger share stands still are of a coarse file or of a pause."""
MOST_NAMES = 6
FASTEST_MM_S = 650.0
"""Lips, jaw and lids stay under 500 mm/s in fast speech: a marker that is faster was swapped, or knocked."""


def motion_problems(file: str, utterance_id: str, motion: Motion, phones: PhoneTrack | None) -> Iterator[Problem]:
    """Everything that is wrong with one motion track as it was recorded."""
    points = motion.points.astype(np.float64)
    missing = missing_in(points)
    names = np.array(motion.layout.names)
    if np.isinf(points).any():
        yield Problem(file, "it holds infinite values", "export it again")
        return
    if missing.all():
        yield Problem(file, "every sample is missing", "export it again, or mark the utterance unusable")
        return
    yield from _missing(file, missing, names)
    yield from _frozen(file, motion, points, missing, names)
    middle = np.nanmedian(np.where(np.isnan(points).all(axis=0), 0.0, points), axis=0)
    middle[np.isnan(points).all(axis=(0, 2))] = np.nan
    units = list(unit_problems(file, motion, middle))
    yield from units
    if motion.layout.dimension == 1:
        return
    axes = list(axis_problems(file, middle, motion.layout))
    yield from axes
    if not units and not axes:
        yield from swap_problems(file, utterance_id, motion, phones)
    if motion.layout.kind == "markers" and not units:
        yield from _jumps(file, utterance_id, motion, points, phones)


def _missing(file: str, missing: NDArray[np.bool_], names: NDArray[np.str_]) -> Iterator[Problem]:
    lost = missing.all(axis=0)
    if lost.any():
        yield Problem(file, f"never seen: {', '.join(names[lost])}", "restore the points, or mark the utterance unusable")
    if missing.mean() > NOTED_MISSING_SHARE:
        yield Problem(
            file,
            f"{missing.mean():.0%} of the samples are missing",
            "fill them where they were tracked, or mark it unusable",
            grave=bool(missing.mean() > LARGEST_MISSING_SHARE),
        )


def _frozen(
    file: str, motion: Motion, points: NDArray[np.float64], missing: NDArray[np.bool_], names: NDArray[np.str_]
) -> Iterator[Problem]:
    """Points that keep one value, throughout or for long, while others move (a weight may), and whole faces that stop."""
    if len(points) < 2:
        return
    gone = missing[1:] | missing[:-1]
    still = ~(np.abs(np.diff(points, axis=0)) > 0).any(axis=2) & ~gone
    constant = np.asarray((still | missing[1:]).all(axis=0) & ~missing.all(axis=0))
    if motion.layout.dimension > 1 and not constant.all():
        if constant.any():
            yield Problem(file, f"frozen throughout: {_some(names[constant])}", "restore the points from the capture")
        for (start, stop), members in frozen_spells(still, gone, constant, motion.fps).items():
            what = f"frozen from {start / motion.fps:.2f} to {stop / motion.fps:.2f} s while others move: {_some(names[members])}"
            yield Problem(file, what, "restore the points from the capture, or take them out there (NaN)")
    longest = max((len(run) for run in runs(np.asarray(still.all(axis=1)))), default=0) / motion.fps
    if longest > LONGEST_FREEZE_S:
        yield Problem(file, f"the whole face is frozen for {longest:.2f} s", "export it again; was the capture interrupted?")


def frozen_spells(
    still: NDArray[np.bool_], gone: NDArray[np.bool_], constant: NDArray[np.bool_], fps: float
) -> dict[tuple[int, int], list[int]]:
    """Points by the frames between which they stand still, though most others move, and though they move at other times.

    still, gone: [T - 1, K] steps in which a point keeps its value, or is missing; constant: [K] points that never move. Files of
    few digits hold points that hardly ever move: those are passed over.
    """
    lively = np.mean(still | gone, axis=1) < MOST_STILL
    found: dict[tuple[int, int], list[int]] = {}
    for point in np.flatnonzero(~constant & still.any(axis=0)).tolist():
        spells = [run for run in runs(still[:, point]) if len(run) > LONGEST_LONE_FREEZE_S * fps]
        inside = np.zeros(len(still), np.bool_)
        for run in spells:
            inside[run.start : run.stop] = True
        elsewhere = ~inside & ~gone[:, point]
        if elsewhere.any() and still[elsewhere, point].mean() < MOST_STILL:
            for run in spells:
                if lively[run.start : run.stop].mean() > MOST_STILL:
                    found.setdefault((run.start, run.stop), []).append(point)
    return found


def _some(names: NDArray[np.str_]) -> str:
    return ", ".join(names[:MOST_NAMES]) + (f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else "")


def _jumps(
    file: str, utterance_id: str, motion: Motion, points: NDArray[np.float64], phones: PhoneTrack | None
) -> Iterator[Problem]:
    """Points that move faster than a face can, with the nodes in which they do."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    fast = np.nan_to_num(steps) * motion.fps > FASTEST_MM_S
    for frame in (run.start for run in runs(fast.any(axis=1))):
        point = int(np.nanargmax(np.where(fast[frame], steps[frame], 0)))
        number = None if phones is None else _phone_at((frame + 1) / motion.fps, phones)
        node = "" if number is None else node_name(utterance_id, number)
        where = "" if phones is None or number is None else f" (node {node}, {phones.labels[number]})"
        yield Problem(
            file,
            f"{motion.layout.names[point]} jumps {steps[frame, point]:.1f} mm at {(frame + 1) / motion.fps:.3f} s{where}",
            "look at it; remove the node, or mend the motion",
            grave=False,
            nodes=(node,) if node else (),
        )


def _phone_at(time_s: float, phones: PhoneTrack) -> int:
    return min(int(np.searchsorted(phones.ends_s, time_s, side="right")), len(phones) - 1)
