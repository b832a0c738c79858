"""Lids of somebody else for eyes that were recorded without, blinking with the gaze as often as theirs did."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.gaze import gaze_shifts
from facesynth.inference.motion import Motion
from facesynth.inference.patches import PatchSettings, PatchTexture
from facesynth.methods.eyes.patch_size import SHUT, patch_size
from facesynth.motion.gaps import Gap, runs
from facesynth.motion.lids import eyes_of, opening_of, shut_level

AROUND_S = 0.2
"""The gaze before and after a blink is the median over so long …"""
CLEAR_S = 0.08
"""… from so far away on: near a blink trackers guess."""
LONGEST_S = 0.5
LARGE_RAD = np.radians(4.0)
"""A shift that is larger than this may come with a blink."""
FURTHEST_S = 1.0
"""A blink is moved by no more than this to come with a shift."""
OPEN = 0.6
"""Opening under which a blink is under way."""


def with_lids(textures: list[Floats], lent: list[Motion], seed: int) -> list[Floats]:
    """Eyes [T, 3] with lids that are grown from those of `lent`, at the same rate.

    Of the blinks as many begin with a large shift of the gaze as `shared_blinks` finds beyond chance; the rest stay.
    """
    shut, fps = shut_level(lent), lent[0].fps
    own = [opening_of(piece, shut) for piece in lent]
    size = patch_size([np.pad(lids, ((0, 0), (0, 2))) for lids in own], fps)
    patch = max(3, min(size.frames if size else round(fps), max(map(len, own)) // 2))
    texture = PatchTexture(
        np.concatenate(own), np.cumsum([0, *map(len, own)])[:-1], PatchSettings(patch, max(1, patch // 5), 0.2)
    )
    share, rng = shared_blinks(lent, shut), np.random.default_rng([seed, 4])
    made = [texture.grow(len(one), rng).frames[:, 0] for one in textures]
    moved = [together(lids, one[:, 1:], share, fps, rng) for lids, one in zip(made, textures, strict=True)]
    return [np.column_stack([lids, one[:, 1:]]) for lids, one in zip(moved, textures, strict=True)]


# With p the share of blinks across which the gaze moves by more than LARGE_RAD, and q that of stretches of the same length in
# which the eyes are open all along, the share that comes with a shift beyond chance is (p - q) / (1 - q).
def shared_blinks(pieces: list[Motion], shut: float) -> float:
    """Share of recorded blinks that come with a large shift of the gaze beyond chance; 0 where that cannot be seen."""
    across: list[float] = []
    apart: list[float] = []
    for piece in pieces:
        opening, gaze = opening_of(piece, shut)[:, 0], eyes_of(piece)[:, 1:].astype(np.float64)
        around, clear = max(1, round(AROUND_S * piece.fps)), round(CLEAR_S * piece.fps)
        blinks = [run for run in runs(opening < OPEN) if len(run) <= LONGEST_S * piece.fps]
        across += [step for run in blinks if (step := _step(gaze, run.start - clear, run.stop + clear, around)) is not None]
        length = max([len(run) for run in blinks], default=0) + 2 * clear
        awake = [run for run in runs(opening >= OPEN) if length and len(run) >= length + 2 * around]
        starts = [a for run in awake for a in range(run.start + around, run.stop - around - length, around)]
        apart += [step for a in starts if (step := _step(gaze, a, a + length, around)) is not None]
    if not across or not apart:
        return 0.0
    p, q = (float(np.mean(np.array(steps) > LARGE_RAD)) for steps in (across, apart))
    return float(np.clip((p - q) / max(1 - q, 1e-9), 0, 1))


def together(lids: Floats, gaze: Floats, share: float, fps: float, rng: np.random.Generator) -> Floats:
    """Lids [T] of which about this share of the blinks is moved to begin with the nearest large shift of the gaze [T, 2]."""
    shifts = np.array([one.start for one in gaze_shifts(gaze, fps) if np.hypot(*one.step) > LARGE_RAD], np.int64)
    out, blinks = lids.copy(), [run for run in runs(lids < OPEN) if lids[run.start : run.stop].min() < SHUT]
    for run in blinks:
        if rng.random() >= share or not len(shifts):
            continue
        start = int(shifts[np.abs(shifts - run.start).argmin()])
        if abs(start - run.start) <= FURTHEST_S * fps:
            _move(out, run, start)
    return out


def _move(lids: Floats, run: Gap, start: int) -> None:
    """Move the dip of lids [T] in `run` to `start`, unless it leaves the track or another blink is there; in place."""
    stop = start + len(run)
    others = lids.copy()
    others[run.start : run.stop] = 1.0
    if start < 0 or stop > len(lids) or others[start:stop].min() < OPEN:
        return
    dip = lids[run.start : run.stop].copy()
    edges = (max(run.start - 1, 0), min(run.stop, len(lids) - 1))
    lids[run.start : run.stop] = np.interp(np.arange(run.start, run.stop), edges, lids[list(edges)])
    lids[start:stop] = np.minimum(lids[start:stop], dip)


def _step(gaze: Floats, first: int, last: int, around: int) -> float | None:
    """How far a gaze [T, 2] is from before `first` to after `last`, rad; None beyond the ends."""
    if first - around < 0 or last + around > len(gaze):
        return None
    before, after = gaze[first - around : first], gaze[last : last + around]
    return float(np.hypot(*_moved(before, after)))


def _moved(before: Floats, after: Floats) -> NDArray[np.float64]:
    return np.asarray(np.median(after, axis=0) - np.median(before, axis=0))
