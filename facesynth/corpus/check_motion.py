"""What can be wrong with a motion track by itself: missing, frozen, jumping, or in another unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.check_swaps import swap_problems
from facesynth.corpus.journal import node_name
from facesynth.corpus.limits import MOST_MISSING as HOPELESS
from facesynth.corpus.problem import Problem
from facesynth.motion.gaps import missing_in, runs
from facesynth.motion.motion import Motion
from facesynth.speech.speech import PhoneTrack

MOST_MISSING = 0.2
"""Share of missing samples above which a recording is hardly worth using."""
LONGEST_FREEZE_S = 1.0
"""A real face is never still for so long, not even in silence."""
FASTEST_MM_S = 650.0
"""Lips, jaw and lids stay under 500 mm/s in fast speech: a marker that is faster was swapped, or knocked."""
FACE_MM = (60.0, 600.0)
"""Largest extent that the points of a face can have, from a mouth alone to head and shoulders."""

UNITS_MM = {"metres": 1e3, "decimetres": 1e2, "centimetres": 10.0, "micrometres": 1e-3}


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
    if motion.layout.kind == "markers":
        yield from _unit(file, points)
        yield from swap_problems(file, utterance_id, motion, phones)
        yield from _jumps(file, utterance_id, motion, points, phones)


def _missing(file: str, missing: NDArray[np.bool_], names: NDArray[np.str_]) -> Iterator[Problem]:
    lost = missing.all(axis=0)
    if lost.any():
        yield Problem(file, f"never seen: {', '.join(names[lost])}", "restore the points, or mark the utterance unusable")
    if missing.mean() > MOST_MISSING:
        yield Problem(
            file,
            f"{missing.mean():.0%} of the samples are missing",
            "fill them where they were tracked, or mark it unusable",
            grave=bool(missing.mean() > HOPELESS),
        )


def _frozen(
    file: str, motion: Motion, points: NDArray[np.float64], missing: NDArray[np.bool_], names: NDArray[np.str_]
) -> Iterator[Problem]:
    """Points that keep one value throughout while others move (a weight that stays 0 is no fault), and whole faces that stop."""
    if len(points) < 2:
        return
    still = ~(np.abs(np.diff(points, axis=0)) > 0).any(axis=2) & ~missing[1:]
    constant = (still | missing[1:]).all(axis=0) & ~missing.all(axis=0)
    if motion.layout.dimension > 1 and constant.any() and not constant.all():
        yield Problem(file, f"frozen throughout: {', '.join(names[constant])}", "restore the points from the capture")
    longest = max((len(run) for run in runs(np.asarray(still.all(axis=1)))), default=0) / motion.fps
    if longest > LONGEST_FREEZE_S:
        yield Problem(file, f"the whole face is frozen for {longest:.2f} s", "export it again; was the capture interrupted?")


def _unit(file: str, points: NDArray[np.float64]) -> Iterator[Problem]:
    middle = np.nanmedian(np.where(np.isnan(points).all(axis=0), 0.0, points), axis=0)
    extent = float(np.linalg.norm(middle.max(axis=0) - middle.min(axis=0)))
    if len(middle) > 2 and not FACE_MM[0] <= extent <= FACE_MM[1]:
        fitting = [unit for unit, scale in UNITS_MM.items() if FACE_MM[0] <= extent * scale <= FACE_MM[1]]
        meant = f"; in {fitting[0]}?" if fitting else ""
        yield Problem(file, f"the face is {extent:.3g} mm large{meant}", "scale the motion to millimetres and add it again")


def _jumps(
    file: str, utterance_id: str, motion: Motion, points: NDArray[np.float64], phones: PhoneTrack | None
) -> Iterator[Problem]:
    """Points that move faster than a face can, with the nodes in which they do."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    fast = np.nan_to_num(steps) * motion.fps > FASTEST_MM_S
    for frame in (run.start for run in runs(fast.any(axis=1))):
        point = int(np.nanargmax(np.where(fast[frame], steps[frame], 0)))
        where = _node_at(utterance_id, (frame + 1) / motion.fps, phones)
        yield Problem(
            file,
            f"{motion.layout.names[point]} jumps {steps[frame, point]:.1f} mm at {(frame + 1) / motion.fps:.3f} s{where}",
            "look at it; remove the node, or mend the motion",
            grave=False,
        )


def _node_at(utterance_id: str, time_s: float, phones: PhoneTrack | None) -> str:
    if phones is None:
        return ""
    number = min(int(np.searchsorted(phones.ends_s, time_s, side="right")), len(phones) - 1)
    return f" (node {node_name(utterance_id, number)}, {phones.labels[number]})"
