"""Markers that were taken for each other: the line from one to its neighbour is turned round against the rest pose."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.journal import node_name
from facesynth.corpus.problem import Problem
from facesynth.motion.gaps import runs
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion
from facesynth.speech.speech import PhoneTrack

Floats = NDArray[np.float64]

NEIGHBOURS = 14
"""So many nearest neighbours of a marker may be mistaken for it."""
CLOSEST_MM = 3.0
"""Markers that lie nearer at rest, such as lips that touch, change sides by themselves."""
MIRROR_MM = 12.0
"""A marker's partner on the other side of the face lies this near to its mirror image."""
TURNED = -0.6
"""The line between two markers, along its rest over the rest's length: 1 as at rest, -1 turned round."""
SHORTEST_S = 0.03
WHOLE_SHARE = 0.8
"""A recording in which two markers are swapped for this share of the time has them swapped throughout."""


def candidates(layout: Layout) -> NDArray[np.int64]:
    """[P, 2] neighbours at rest, and left beside right, far enough apart not to change sides."""
    from scipy.spatial import KDTree

    if layout.kind != "markers" or layout.neutral is None or len(layout.names) < 2:
        return np.zeros((0, 2), np.int64)
    rest = np.asarray(layout.neutral).reshape(-1, 3)
    _, near = KDTree(rest).query(rest, k=min(NEIGHBOURS + 1, len(rest)))
    pairs = {(min(i, int(j)), max(i, int(j))) for i, row in enumerate(near) for j in row[1:]}
    off, mirrored = KDTree(rest).query((rest - rest.mean(axis=0)) * [-1, 1, 1] + rest.mean(axis=0))
    pairs |= {(i, int(j)) for i, j in enumerate(mirrored) if i < j and off[i] < MIRROR_MM}
    found = np.array(sorted(pairs), np.int64).reshape(-1, 2)
    return found[np.linalg.norm(rest[found[:, 0]] - rest[found[:, 1]], axis=1) > CLOSEST_MM]


def swap_problems(file: str, utterance_id: str, motion: Motion, phones: PhoneTrack | None) -> Iterator[Problem]:
    """Pairs of markers that are swapped, for a while or throughout."""
    pairs = candidates(motion.layout)
    if not len(pairs) or not len(motion):
        return
    turned = _turned(motion.points.astype(np.float64), np.asarray(motion.layout.neutral).reshape(-1, 3), pairs)
    names = motion.layout.names
    spans = [
        (run.start, run.stop, pair)
        for pair in np.flatnonzero(turned.any(axis=0)).tolist()
        for run in runs(turned[:, pair])
        if len(run) >= SHORTEST_S * motion.fps
    ]
    for start, stop, pair in _outermost(sorted(spans, key=lambda span: (span[0], span[0] - span[1]))):
        what = " and ".join(names[i] for i in pairs[pair])
        if stop - start >= WHOLE_SHARE * len(motion):
            yield Problem(file, f"{what} are swapped throughout", "give them each other's names, or add the recording again")
        else:
            where = _nodes(utterance_id, start / motion.fps, stop / motion.fps, phones)
            told = f"{what} are swapped from {start / motion.fps:.2f} to {stop / motion.fps:.2f} s{where}"
            yield Problem(file, told, "look at it; exchange their tracks there, or remove the nodes", grave=False)


def _turned(points: Floats, rest: Floats, pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """[T, P] where the line between a pair runs against its rest; both are then nearer to the other's place than to their own."""
    line = rest[pairs[:, 1]] - rest[pairs[:, 0]]
    now = points[:, pairs[:, 1]] - points[:, pairs[:, 0]]
    along = (now * line).sum(axis=2) / np.square(line).sum(axis=1)
    own = np.linalg.norm(points[:, pairs] - rest[pairs], axis=3).sum(axis=2)
    others = np.linalg.norm(points[:, pairs] - rest[pairs[:, ::-1]], axis=3).sum(axis=2)
    return (np.nan_to_num(along, nan=1.0) < TURNED) & (others < own)


def _outermost(spans: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Spans of different times: where one marker went astray, several of its pairs are turned at once."""
    kept: list[tuple[int, int, int]] = []
    for span in spans:
        if not kept or span[0] >= kept[-1][1]:
            kept.append(span)
    return kept


def _nodes(utterance_id: str, start_s: float, end_s: float, phones: PhoneTrack | None) -> str:
    if phones is None:
        return ""
    spans = enumerate(pairwise([0.0, *phones.ends_s.tolist()]))
    touched = [node_name(utterance_id, number) for number, (begin, end) in spans if begin < end_s and end > start_s]
    return f" (nodes {', '.join(touched[:4])}{' …' if len(touched) > 4 else ''})" if touched else ""
