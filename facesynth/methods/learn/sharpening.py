"""How much a mean over many motions must be sharpened: it moves too little."""

from collections.abc import Iterable, Sequence

import numpy as np

from facesynth.inference.arrays import Floats
from facesynth.inference.filters import sharpen, without_roughness
from facesynth.inference.motion import Motion

SHARES = np.linspace(0, 2, 9)
"""Where a share is looked for; more would be a caricature."""


def matching_share(pairs: Iterable[tuple[Motion, Motion]], points: Sequence[int] | None = None) -> float:
    """The share with which motion moves as much as recorded, by pairs (unsharpened, recorded) of one rate.

    Compared are mean speeds without roughness, of which a sensor's noise would be the larger part, over the frames
    that were recorded; of some points, all unless told. From 0, where nothing is missing, to the last of SHARES.
    """
    ratios = np.mean([_speed_ratios(made, truth, points) for made, truth in pairs], axis=0)
    return float(np.interp(1.0, ratios, SHARES))


def _speed_ratios(made: Motion, truth: Motion, points: Sequence[int] | None) -> Floats:
    """[S] mean speed of a motion sharpened by each of SHARES over that of the recording."""
    count, fps = min(len(made), len(truth)), truth.fps
    mine, theirs = (_some(motion, count, points) for motion in (made, truth))
    recorded = _speeds(without_roughness(theirs, fps), truth)
    present = np.isfinite(recorded)
    plain = without_roughness(mine, fps)
    none = without_roughness(plain, fps)
    raised = without_roughness(sharpen(mine, 1.0, fps), fps) - none  # what is raised goes with the share
    made_speeds = [_speeds(none + share * raised if share else plain, made)[present].mean() for share in SHARES]
    return np.array(made_speeds) / max(recorded[present].mean(), 1e-12)


def _some(motion: Motion, count: int, points: Sequence[int] | None) -> Floats:
    """[T, K dimension] the first frames of some points of a motion, or of all."""
    some = motion.layout.points(motion.frames[:count].astype(np.float64))[:, slice(None) if points is None else list(points)]
    return np.asarray(some.reshape(count, -1))


def _speeds(frames: Floats, motion: Motion) -> Floats:
    """[T - 1, K] how far each point goes from frame to frame."""
    by_point = frames.reshape(len(frames), -1, motion.layout.dimension)
    return np.asarray(np.linalg.norm(np.diff(by_point, axis=0), axis=2))
