"""Lids of somebody else for eyes that were recorded without, blinking with the gaze as often as theirs did."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing

from facesynth.inference.arrays import Floats
from facesynth.inference.gaze import gaze_shifts
from facesynth.inference.motion import Motion
from facesynth.inference.patches import PatchSettings, PatchTexture
from facesynth.methods.eyes.patch_size import SHUT, patch_size
from facesynth.motion.gaps import Gap, runs
from facesynth.motion.lids import Lids, eyes_of

AROUND_S = 0.2
"""The gaze before and after a blink is the median over so long …"""
CLEAR_S = 0.08
"""… from so far away on: near a blink trackers guess."""
LONGEST_S = 0.5
LARGE_RAD = np.radians(4.0)
"""A shift that is larger than this may come with a blink."""
LEAST_REST = 0.3
"""Lids that rest below this are shut for longer than a blink."""
FURTHEST_S = 1.0
"""A blink is moved by no more than this to come with a shift."""
OPEN, HALF, AWAKE = 0.6, 0.5, 0.9
"""Openings: under the first a blink is under way, under the second it is one, over the third lids rest."""


def with_lids(textures: list[Floats], lent: list[Motion], seed: int, most: float | None = None) -> list[Floats]:
    """Eyes [T, 3] with lids that are grown from those of `lent`, at the same rate.

    Of the blinks as many begin with a large shift of the gaze as `shared_blinks` finds beyond chance; the rest stay.
    most: of whoever blinks more often than so many times a minute, blinks are left out by chance; None: none is.
    """
    lids_of_lender, fps = Lids.of(lent), lent[0].fps
    own = [between_rests(lids_of_lender.opening(piece), fps) for piece in lent]
    size = patch_size([np.pad(lids, ((0, 0), (0, 2))) for lids in own], fps)
    patch = max(3, min(size.frames if size else round(fps), max(map(len, own)) // 2))
    texture = PatchTexture(
        np.concatenate(own), np.cumsum([0, *map(len, own)])[:-1], PatchSettings(patch, max(1, patch // 5), 0.2)
    )
    share, rng = shared_blinks(lent, lids_of_lender), np.random.default_rng([seed, 4])
    made = [texture.grow(len(one), rng).frames[:, 0] for one in textures]
    if most is not None:
        made = rarer(made, most, fps, rng)
    moved = [together(lids, one[:, 1:], share, fps, rng) for lids, one in zip(made, textures, strict=True)]
    return [np.column_stack([lids, one[:, 1:]]) for lids, one in zip(moved, textures, strict=True)]


# With p the share of blinks across which the gaze moves by more than LARGE_RAD, and q that of stretches of the same length in
# which the eyes are open all along, the share that comes with a shift beyond chance is (p - q) / (1 - q).
def shared_blinks(pieces: list[Motion], lids: Lids) -> float:
    """Share of recorded blinks that come with a large shift of the gaze beyond chance; 0 where that cannot be seen."""
    across: list[float] = []
    apart: list[float] = []
    for piece in pieces:
        opening, gaze = lids.opening(piece)[:, 0], eyes_of(piece)[:, 1:].astype(np.float64)
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


# How far lids are open between blinks goes with where somebody looks and how tired he is, and that is the lender's own. A grey
# closing c over more than the longest blink fills every dip up to where the lids rest; x / c is 1 there and 0 where they shut.
def between_rests(opening: Floats, fps: float) -> Floats:
    """[T, 1] lids whose dips start and end fully open, however far they rest."""
    rest = grey_closing(opening[:, 0], size=round(1.2 * LONGEST_S * fps) | 1, mode="nearest")
    return np.clip(opening / np.maximum(rest, LEAST_REST)[:, None], 0, 1)


def rarer(tracks: list[Floats], most: float, fps: float, rng: np.random.Generator) -> list[Floats]:
    """Lids [T] that blink no more than about so many times a minute: each blink stays with the same chance.

    Dips that leave the eye half open are no blinks, and none stays.
    """
    dips = [[(run, bool(lids[run.start : run.stop].min() < HALF)) for run in runs(lids < AWAKE)] for lids in tracks]
    blinks = sum(blink for found in dips for _, blink in found)
    kept = most * sum(map(len, tracks)) / fps / 60 / max(blinks, 1)
    out = [lids.copy() for lids in tracks]
    for lids, found in zip(out, dips, strict=True):
        for run, blink in found:
            if not blink or rng.random() >= kept:
                _open(lids, run)
    return out


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
    _open(lids, run)
    lids[start:stop] = np.minimum(lids[start:stop], dip)


def _open(lids: Floats, run: Gap) -> None:
    """Lids [T] without the dip in `run`; in place."""
    edges = (max(run.start - 1, 0), min(run.stop, len(lids) - 1))
    lids[run.start : run.stop] = np.interp(np.arange(run.start, run.stop), edges, np.maximum(lids[list(edges)], AWAKE))


def _step(gaze: Floats, first: int, last: int, around: int) -> float | None:
    """How far a gaze [T, 2] is from before `first` to after `last`, rad; None beyond the ends."""
    if first - around < 0 or last + around > len(gaze):
        return None
    before, after = gaze[first - around : first], gaze[last : last + around]
    return float(np.hypot(*_moved(before, after)))


def _moved(before: Floats, after: Floats) -> NDArray[np.float64]:
    return np.asarray(np.median(after, axis=0) - np.median(before, axis=0))
