"""Recorded eyes as they are learned from: lids that shut, gaze apart from what the head did to it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.gaze import quick, quick_turns
from facesynth.inference.motion import Motion
from facesynth.motion.gaps import runs
from facesynth.motion.lids import Lids, eyes_of

AWAKE = 0.8
"""Lids that are open so far show the eye as it is; under them trackers guess."""
MOVING_RAD = 1e-3
"""Deviation of a head or a gaze that moves."""


def whole_pieces(motion: Motion, least_s: float) -> list[Motion]:
    """The pieces of a motion in which eyes, and the head where there is one, are known for so long without a gap.

    Gaze counts from its middle over the whole motion: cameras and trackers look from anywhere.
    """
    motion = _about_middle(motion)
    signals = [eyes_of(motion), *([] if motion.head is None else [motion.head])]
    present = np.asarray(np.isfinite(np.concatenate(signals, axis=1)).all(axis=1))
    return [_piece(motion, run.start, run.stop) for run in runs(present) if len(run) >= least_s * motion.fps]


# Over frames in which the eyes are open, with h the head's quick turns and g the quick changes of the gaze,
#
#   gain = - sum h g / sum h²,   within 0 and 1.
def compensation_in(pieces: Sequence[Motion]) -> float:
    """Share of the head's quick turns that recorded eyes undo; 0 where no head was recorded or none moves."""
    crossed = own = 0.0
    for piece in pieces:
        if piece.head is not None:
            eyes = eyes_of(piece)
            awake = eyes[:, 0] > AWAKE
            turns = quick_turns(piece.head, piece.fps)[awake]
            looks = quick(eyes[:, 1:].astype(np.float64), piece.fps)[awake]
            crossed += float((turns * looks).sum())
            own += float(np.square(turns).sum())
    count = sum(len(piece) for piece in pieces)
    return float(np.clip(-crossed / own, 0, 1)) if own > count * MOVING_RAD**2 else 0.0


def texture_of(piece: Motion, lids: Lids, compensation: float, smoothed_s: float) -> Floats:
    """[T, 3] a piece as it is grown from: opening from 0 in a blink to 1; gaze without smoothing.

    smoothed_s: over how long the gaze was averaged when it was recorded.
    """
    gaze = sharpened(held_gaze(piece, compensation), round(smoothed_s * piece.fps))
    return np.concatenate([lids.opening(piece), gaze], axis=1)


def held_gaze(piece: Motion, compensation: float) -> Floats:
    """[T, 2] the gaze of a recording, held against the quick turns of its head: what `Eyes.look` starts from."""
    gaze = eyes_of(piece)[:, 1:].astype(np.float64)
    return gaze if piece.head is None else gaze + compensation * quick_turns(piece.head, piece.fps)


# Kuwahara's filter in one dimension: of the `width` frames up to a frame and of those from it on, the mean of the half that
# varies less. A jump that an average of `width` frames made a ramp becomes a jump again; rests stay as they are.
def sharpened(gaze: Floats, width: int) -> Floats:
    """A gaze [T, 2] that was averaged over `width` frames, with shifts that are quick again; 1 or less: as it is."""
    if width <= 1:
        return gaze
    padded = np.pad(gaze, ((width - 1, width - 1), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=0)
    means, spread = windows.mean(axis=2), windows.var(axis=2).sum(axis=1)
    before, after = np.arange(len(gaze)), np.arange(len(gaze)) + width - 1
    return means[np.where(spread[before] <= spread[after], before, after)]


def at_rate(motion: Motion, fps: float) -> Motion:
    """Eyes, and the head, at another rate, straight from frame to frame: an even curve would make up movement in a blink."""
    if motion.fps == fps:
        return motion
    times_s = np.arange(max(1, round(motion.duration_s * fps))) / fps

    def curve(signal: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.stack([np.interp(times_s, motion.times_s, c) for c in signal.T], axis=1).astype(np.float32)

    frames = np.tile(motion.frames[:1], (len(times_s), 1))
    head = None if motion.head is None else curve(motion.head)
    return replace(motion, frames=frames, fps=fps, head=head, eyes=curve(eyes_of(motion)))


def _about_middle(motion: Motion) -> Motion:
    eyes = eyes_of(motion)
    known = np.isfinite(eyes[:, 1:]).all(axis=1)
    middle = np.median(eyes[known, 1:], axis=0) if known.any() else np.zeros(2)
    return replace(motion, eyes=eyes - np.concatenate([[0.0], middle]).astype(np.float32))


def _piece(motion: Motion, start: int, stop: int) -> Motion:
    head = None if motion.head is None else motion.head[start:stop]
    return Motion(motion.frames[start:stop], motion.fps, motion.layout, head, eyes_of(motion)[start:stop])
