"""Markers that were taken for each other: the line from one to its neighbour is turned round against the rest pose."""

from collections.abc import Iterator
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.checks.problem import Problem
from facesynth.corpus.journal import node_name
from facesynth.inference.arrays import Floats
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.gaps import missing_in, runs

Pairs = NDArray[np.int64]

NEIGHBOURS = 14
"""So many nearest neighbours of a marker may be mistaken for it."""
CLOSEST_SHARE = 0.015
"""Markers that lie nearer at rest, as a share of the face (3 mm), such as lips that touch, change sides by themselves."""
MIRROR_SHARE = 0.06
"""A marker's partner on the other side of the face lies this near to its mirror image."""
ASTRAY_SHARE = 0.06
"""A marker that moved by so much more than its neighbours may be anywhere."""
TURNED = -0.6
"""The line between two markers, along its rest over the rest's length: 1 as at rest, -1 turned round."""
SHORTEST_S = 0.03
TOLD_APART_S = 0.3
"""Spells of one pair that are no farther apart are one: a mouth that opens wide hides a swap for a moment."""
SAMPLED = 20
"""So many frames are looked at for markers that left their neighbours."""
MOST_SUSPECTS = 40
MOST_PROBLEMS = 12


def rest_pose(motion: Motion) -> Floats:
    """[K, D] the layout's rest pose, or where it has none the middle of the recording."""
    layout = motion.layout
    if layout.neutral is not None:
        return np.asarray(layout.neutral, np.float64).reshape(-1, layout.dimension)
    points = motion.points.astype(np.float64)
    return np.asarray(np.nanmedian(np.where(np.isnan(points).all(axis=0), 0.0, points), axis=0), np.float64)


def candidates(layout: Layout, rest: Floats) -> Pairs:
    """[P, 2] neighbours at rest [K, D], and left beside right, far enough apart not to change sides."""
    from scipy.spatial import KDTree

    if layout.dimension < 2 or len(rest) < 2 or not np.isfinite(rest).all():
        return np.zeros((0, 2), np.int64)
    _, near = KDTree(rest).query(rest, k=min(NEIGHBOURS + 1, len(rest)))
    pairs = {(min(i, int(j)), max(i, int(j))) for i, row in enumerate(near) for j in row[1:]}
    mirror = np.ones(layout.dimension)
    mirror[0] = -1
    off, mirrored = KDTree(rest).query((rest - rest.mean(axis=0)) * mirror + rest.mean(axis=0))
    pairs |= {(i, int(j)) for i, j in enumerate(mirrored) if i < j and off[i] < MIRROR_SHARE * _extent(rest)}
    return _apart(np.array(sorted(pairs), np.int64).reshape(-1, 2), rest)


def swap_problems(file: str, utterance_id: str, motion: Motion, phones: PhoneTrack | None) -> Iterator[Problem]:
    """Pairs of markers that are swapped, for a while or throughout."""
    rest = rest_pose(motion)
    if not len(motion) or not len(candidates(motion.layout, rest)):
        return
    names, count = motion.layout.names, len(motion)
    for (first, second), start, stop in swaps(motion, rest):
        what = f"{names[first]} and {names[second]}"
        edge = TOLD_APART_S * motion.fps
        if start <= edge and count - stop <= edge and motion.layout.neutral is not None:
            yield Problem(file, f"{what} are swapped throughout", "give them each other's names, or add the recording again")
        else:
            touched = _nodes(utterance_id, start / motion.fps, stop / motion.fps, phones)
            where = f" (nodes {', '.join(touched[:4])}{' …' if len(touched) > 4 else ''})" if touched else ""
            what_happened = f"{what} are swapped from {start / motion.fps:.2f} to {stop / motion.fps:.2f} s{where}"
            yield Problem(file, what_happened, "look at it; exchange their tracks there, or remove the nodes", False, touched)


# Exchanging markers i and j of a frame x lowers the sum of squared distances from the rest r by
#   |x_i - r_i|² + |x_j - r_j|² - |x_i - r_j|² - |x_j - r_i|² = -2 (x_i - x_j) (r_i - r_j).
# Where i and j are swapped this is 2 |r_i - r_j|². A third marker k makes at most a quarter of that with one of them, so the
# pair of the largest gain is the one that was exchanged. It is put right, and the rest is looked at again.
def swaps(motion: Motion, rest: Floats) -> list[tuple[tuple[int, int], int, int]]:
    """Pairs of points, and the frames from which and up to which (exclusive) each is swapped, in order of time."""
    points = motion.points.astype(np.float64)
    seen = ~missing_in(points).all(axis=1)
    points[seen] -= np.nanmedian(points[seen] - rest, axis=1, keepdims=True)
    pairs = _suspects(points, rest, candidates(motion.layout, rest))
    found: list[tuple[tuple[int, int], int, int]] = []
    while len(pairs) and len(found) < MOST_PROBLEMS:
        turned, gain = _turned(points, rest, pairs)
        spells = [
            (float(gain[start:stop, pair].sum(where=turned[start:stop, pair])), pair, start, stop)
            for pair in np.flatnonzero(turned.any(axis=0)).tolist()
            for start, stop in _spells(turned[:, pair], motion.fps)
        ]
        if not spells:
            break
        _, pair, start, stop = max(spells)
        first, second = map(int, pairs[pair])
        points[start:stop, [first, second]] = points[start:stop, [second, first]]
        found.append(((first, second), start, stop))
    return sorted(found, key=lambda swap: (swap[1], swap[2], swap[0]))


def _suspects(points: Floats, rest: Floats, near: Pairs) -> Pairs:
    """[P, 2] pairs that may be swapped: those of points that are turned against a neighbour, or that left their neighbours."""
    from scipy.spatial import KDTree

    turned, _ = _turned(points, rest, near)
    suspects = set(near[turned.any(axis=0)].ravel().tolist())
    _, around = KDTree(rest).query(rest, k=min(NEIGHBOURS + 1, len(rest)))
    sampled = points[:: max(len(points) // SAMPLED, 1)] - rest
    moved = np.nan_to_num(sampled)
    left = np.linalg.norm(moved - np.median(moved[:, around[:, 1:]], axis=2), axis=2)
    left = np.where(np.isfinite(sampled).all(axis=2), left, 0.0).max(axis=0)
    suspects |= set(np.flatnonzero(left > ASTRAY_SHARE * _extent(rest)).tolist())
    chosen = sorted(sorted(suspects, key=lambda k: -left[k])[:MOST_SUSPECTS])
    return _apart(np.array(list(combinations(chosen, 2)), np.int64).reshape(-1, 2), rest)


def _turned(points: Floats, rest: Floats, pairs: Pairs) -> tuple[NDArray[np.bool_], Floats]:
    """[T, P] where a pair's line runs against its rest and both are nearer to the other's place; what exchanging would gain."""
    line = rest[pairs[:, 1]] - rest[pairs[:, 0]]
    along = ((points[:, pairs[:, 1]] - points[:, pairs[:, 0]]) * line).sum(axis=2)
    turned = np.nan_to_num(along, nan=1.0) < TURNED * np.square(line).sum(axis=1)
    some = np.flatnonzero(turned.any(axis=0))
    chosen = points[:, pairs[some]]
    own = np.linalg.norm(chosen - rest[pairs[some]], axis=3).sum(axis=2)
    others = np.linalg.norm(chosen - rest[pairs[some, ::-1]], axis=3).sum(axis=2)
    turned[:, some] &= others < own
    return turned, np.nan_to_num(-2 * along)


def _spells(turned: NDArray[np.bool_], fps: float) -> list[tuple[int, int]]:
    """First frame and the one after the last of each spell, short interruptions bridged."""
    merged: list[tuple[int, int]] = []
    for run in runs(turned):
        if merged and run.start - merged[-1][1] <= TOLD_APART_S * fps:
            merged[-1] = (merged[-1][0], run.stop)
        else:
            merged.append((run.start, run.stop))
    return [(start, stop) for start, stop in merged if turned[start:stop].sum() >= max(SHORTEST_S * fps, 2)]


def _apart(pairs: Pairs, rest: Floats) -> Pairs:
    return pairs[np.linalg.norm(rest[pairs[:, 0]] - rest[pairs[:, 1]], axis=1) > CLOSEST_SHARE * _extent(rest)]


def _extent(rest: Floats) -> float:
    return float(np.linalg.norm(np.ptp(rest, axis=0)))


def _nodes(utterance_id: str, start_s: float, end_s: float, phones: PhoneTrack | None) -> tuple[str, ...]:
    if phones is None:
        return ()
    spans = enumerate(pairwise([0.0, *phones.ends_s.tolist()]))
    return tuple(node_name(utterance_id, number) for number, (begin, end) in spans if begin < end_s and end > start_s)
