"""The cheapest path of motion nodes, exactly, without looking at most of the pairs.

The recursion (Deng 2008, Algorithm 1) is

    phi_1(j) = OC + EMP + B,    phi_t(j) = min_i [phi_t-1(i) + TC(i, j)] + OC + EMP + B

and Θ(N²T) as written. Three facts make it fast without an approximation:

* phi_t(j) is needed only for the nodes that the next step may build on. A bound that costs O(1) a
  node, `OC + EMP + min(phi_t-1(pre(j)), least phi_t-1 of pre(j)'s viseme + nearest(j), least phi_t-1
  + PNT)`, takes its place until a successor really asks for that node; `nearest(j)` is the cheapest
  step from that viseme to j, which does not depend on the input.
* PVC is a squared Euclidean distance, so a ball tree over the end vectors, with the smallest phi of
  each ball, finds the best predecessor of j without visiting the others.
* DSC is never negative: it is computed for the few pairs that PVC alone does not rule out.

Everything is float64. Bounds are compared with a rounding margin, ties go to the lowest node.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.methods.efase.costs import Query, Weights, end_vectors, path_cost, start_vectors
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes
from facesynth.methods.efase.trees import Forest, grow_forest
from facesynth.progress import track

MARGIN = 1 + 1e-9
"""Relative rounding margin of bounds."""


class Tables(NamedTuple):
    """What the search reads; rows are nodes in the forest's order, so that a ball is a range of rows."""

    node: Ints
    """[N] the node of each row."""
    before: Ints
    """[N] the row of pre(row), or -1."""
    tree_of: Ints
    ends: Floats
    """[N, 2D] end vectors."""
    joints: Floats
    """[N, 2D] start vectors."""
    frames: Floats
    """[F, D] all frames, by row."""
    starts: Ints
    """[N + 1] first frame of each row."""
    bends: Floats
    """[F, D] second difference of `w p`, at the row's frames; the last two of each row are zero."""
    ball_starts: Ints
    ball_stops: Ints
    left: Ints
    right: Ints
    centres: Floats
    radii: Floats
    roots: Ints
    tree_visemes: Ints
    """[C] viseme class of each tree."""
    visemes: Ints
    """[N] viseme class of each row."""
    nearest: Floats
    """[N] least TC of a step to the row from the viseme of its pre, other than from pre itself."""


@dataclass(frozen=True, eq=False)
class SearchIndex:
    """Everything that can be prepared before the input is known; its size grows with N."""

    tables: Tables
    tree_phones: Ints
    tree_emotions: Ints
    forest: Forest
    nodes: MotionNodes
    weights: Weights

    @property
    def bytes(self) -> int:
        """Memory of the tables, which are all that is kept beyond the nodes themselves."""
        return sum(table.nbytes for table in self.tables)


@dataclass(frozen=True, eq=False)
class Path:
    """The optimum."""

    nodes: Ints
    """[T] a node for each phone."""
    cost: float
    evaluated: float
    """Share of the (phone, node) pairs whose phi was computed."""


def build_index(nodes: MotionNodes, weights: Weights, forest: Forest | None = None, nearest: Floats | None = None) -> SearchIndex:
    """Grow the forest, unless a kept one is given, and put everything in its order. O(N) memory."""
    key = nodes.phones * (int(nodes.emotions.max()) + 1) + nodes.emotions
    _, first, tree_of = np.unique(key, return_index=True, return_inverse=True)
    ends = end_vectors(nodes, weights)
    forest = forest or grow_forest(ends, tree_of)
    tables = _tables(nodes, weights, forest, ends, nodes.visemes[first])
    if nearest is None:
        _find_nearest(tables, weights.beta)
    else:
        tables.nearest[:] = nearest
    return SearchIndex(tables, nodes.phones[first], nodes.emotions[first], forest, nodes, weights)


def search(index: SearchIndex, query: Query) -> Path:
    """The path of least COST; ties go to the lowest node. Memory grows with T · N."""
    tables, state = index.tables, _State.empty(len(query), index.tables)
    targets = _tree_targets(index, query)
    heard = np.zeros((len(query), len(tables.node))) if query.heard is None else query.heard[:, tables.node]
    fixed = np.full(len(query), -1, np.int64)
    row_of = np.argsort(tables.node)
    for t, node in query.fixed.items():
        fixed[t] = row_of[node]
    scale = index.weights.beta, index.weights.pnt, index.weights.alpha
    for t in track(range(len(query)), "searching"):
        _advance(t, tables, state, targets, heard, fixed, *scale)
    rows = _backtrack(state, len(query))
    path = tables.node[rows]
    return Path(path, path_cost(index.nodes, query, path, index.weights), float(state.known.mean()))


class _State(NamedTuple):
    phi: Floats
    """[T, N] where known, else a lower bound."""
    known: NDArray[np.uint8]
    back: NDArray[np.int32]
    """[T, N] best predecessor, -1 at the start."""
    bound: Floats
    """[T, B] lower bound of phi over a ball."""
    tree_order: Ints
    """[T, C] trees by rising bound."""
    least: Floats
    """[T] smallest phi."""
    least_at: Ints
    viseme_bound: Floats
    """[V] lower bound of phi over each viseme class at the last position."""

    @classmethod
    def empty(cls, count: int, tables: Tables) -> _State:
        n, balls, trees = len(tables.node), len(tables.radii), len(tables.roots) - 1
        shape = (count, n)
        known = np.zeros(shape, np.uint8)
        filled = (np.empty(shape), known, np.empty(shape, np.int32), np.empty((count, balls)), np.empty((count, trees), np.int64))
        return cls(*filled, np.empty(count), np.empty(count, np.int64), np.empty(int(tables.visemes.max()) + 1))


def _tables(nodes: MotionNodes, weights: Weights, forest: Forest, ends: Floats, tree_visemes: Ints) -> Tables:
    order = forest.order
    row_of = np.full(len(order) + 1, -1, np.int64)
    row_of[order] = np.arange(len(order))
    lengths = nodes.lengths[order]
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    picks = np.repeat(nodes.starts[order] - starts[:-1], lengths) + np.arange(starts[-1])
    frames = np.ascontiguousarray(nodes.frames[picks])
    return Tables(
        node=order,
        before=row_of[nodes.before[order]],
        tree_of=forest.tree_of[order],
        ends=np.ascontiguousarray(ends[order]),
        joints=np.ascontiguousarray(start_vectors(nodes, weights)[order]),
        frames=frames,
        starts=starts,
        bends=_bends(frames, starts),
        ball_starts=forest.starts,
        ball_stops=forest.stops,
        left=forest.left,
        right=forest.right,
        centres=forest.centres,
        radii=forest.radii,
        roots=forest.roots,
        tree_visemes=tree_visemes,
        visemes=nodes.visemes[order],
        nearest=np.zeros(len(order)),
    )


def _tree_targets(index: SearchIndex, query: Query) -> Floats:
    """[T, C] OC + EMP, which all rows of a tree share."""
    weights = index.weights
    wanted = query.phones[:, None]
    same_viseme = index.tables.tree_visemes == query.visemes[:, None]
    other = np.where(same_viseme, weights.gamma, 1.0) * weights.delta * weights.pnt
    cost = np.where((wanted >= 0) & (index.tree_phones != wanted), other, 0.0)
    if query.strict is not None:
        cost[query.strict[:, None] & ~same_viseme] = np.inf
    feeling = query.emotions[:, None]
    return cost + np.where((feeling >= 0) & (index.tree_emotions != feeling), weights.phi * weights.pnt, 0.0)


def _backtrack(state: _State, count: int) -> Ints:
    rows = np.empty(count, np.int64)
    rows[-1] = state.least_at[-1]
    for t in range(count - 1, 0, -1):
        rows[t - 1] = state.back[t, rows[t]]
    return rows


@njit(cache=True)
def _find_nearest(tables, beta):  # type: ignore[no-untyped-def]
    pile = np.empty(64, np.int64)
    for row in range(len(tables.node)):
        captured = tables.before[row]
        if captured < 0:
            continue
        best = np.inf
        for tree in range(len(tables.tree_visemes)):
            if tables.tree_visemes[tree] != tables.visemes[captured]:
                continue
            height, pile[0] = 1, tables.roots[tree]
            while height:
                height -= 1
                ball = pile[height]
                if _gap(tables, ball, row) >= best:
                    continue
                if tables.left[ball] >= 0:
                    pile[height], pile[height + 1] = tables.right[ball], tables.left[ball]
                    height += 2
                    continue
                for i in range(tables.ball_starts[ball], tables.ball_stops[ball]):
                    joint = _squared_distance(tables.ends, i, tables.joints, row)
                    if i != captured and joint < best:
                        best = min(best, joint + beta * _bending(tables, i, captured))
        tables.nearest[row] = best / MARGIN


@njit(cache=True)
def _bends(frames, starts):  # type: ignore[no-untyped-def]
    bends = np.zeros_like(frames)
    for row in range(len(starts) - 1):
        a, length = starts[row], starts[row + 1] - starts[row]
        for k in range(length - 2):
            for d in range(frames.shape[1]):
                w = k / (length - 1), (k + 1) / (length - 1), (k + 2) / (length - 1)
                bends[a + k, d] = w[0] * frames[a + k, d] - 2 * w[1] * frames[a + k + 1, d] + w[2] * frames[a + k + 2, d]
    return bends


@njit(cache=True)
def _advance(t, tables, state, targets, heard, fixed, beta, pnt, alpha):  # type: ignore[no-untyped-def]
    """Compute the phi of position t that may be its smallest; bound all the others."""
    _bound_rows(t, tables, state, targets, heard, fixed, pnt, alpha)
    _bound_balls(t, tables, state)
    state.least[t], state.least_at[t] = np.inf, -1
    for tree in np.argsort(state.bound[t][tables.roots[:-1]], kind="mergesort"):
        root = tables.roots[tree]
        if state.bound[t, root] > state.least[t] * MARGIN or state.bound[t, root] == np.inf:
            break
        for row in range(tables.ball_starts[root], tables.ball_stops[root]):
            if state.phi[t, row] > state.least[t] * MARGIN or state.phi[t, row] == np.inf:
                continue
            _evaluate(t, row, tables, state, targets, heard, beta, pnt)
            phi, best = state.phi[t, row], state.least[t]
            if phi < best or (phi == best and tables.node[row] < tables.node[state.least_at[t]]):
                state.least[t], state.least_at[t] = phi, row
    _bound_balls(t, tables, state)
    state.tree_order[t] = np.argsort(state.bound[t][tables.roots[:-1]], kind="mergesort")
    state.viseme_bound[:] = np.inf
    for row in range(len(tables.node)):
        viseme = tables.visemes[row]
        state.viseme_bound[viseme] = min(state.viseme_bound[viseme], state.phi[t, row])


@njit(cache=True)
def _bound_rows(t, tables, state, targets, heard, fixed, pnt, alpha):  # type: ignore[no-untyped-def]
    for row in range(len(tables.node)):
        bound = 0.0
        if fixed[t] >= 0 and row != fixed[t]:
            bound = np.inf
        elif t > 0 and tables.before[row] < 0:
            bound = state.least[t - 1] + alpha * pnt
        elif t > 0:
            captured = tables.before[row]
            alike = state.viseme_bound[tables.visemes[captured]] + tables.nearest[row]
            bound = min(state.phi[t - 1, captured], alike, state.least[t - 1] + pnt)
        state.phi[t, row] = bound + targets[t, tables.tree_of[row]] + heard[t, row]


@njit(cache=True)
def _bound_balls(t, tables, state):  # type: ignore[no-untyped-def]
    for ball in range(len(tables.radii) - 1, -1, -1):
        if tables.left[ball] >= 0:
            state.bound[t, ball] = min(state.bound[t, tables.left[ball]], state.bound[t, tables.right[ball]])
            continue
        least = np.inf
        for row in range(tables.ball_starts[ball], tables.ball_stops[ball]):
            least = min(least, state.phi[t, row])
        state.bound[t, ball] = least


@njit(cache=True)
def _evaluate(t, row, tables, state, targets, heard, beta, pnt):  # type: ignore[no-untyped-def]
    """phi of one row; whatever unknown phi of earlier positions it asks for is computed first."""
    stack = [row]
    while len(stack) > 0:
        at = t - len(stack) + 1
        asked = _predecessor(at, stack[-1], tables, state, targets, heard, beta, pnt)
        if asked < 0:
            stack.pop()
        else:
            stack.append(asked)


@njit(cache=True)
def _predecessor(t, row, tables, state, targets, heard, beta, pnt):  # type: ignore[no-untyped-def]  # noqa: PLR0912 - one search loop
    """Set phi and back of one row and return -1, or return a row of position t - 1 that must be known first."""
    target = targets[t, tables.tree_of[row]] + heard[t, row]
    captured = tables.before[row]
    if t == 0 or captured < 0:
        state.back[t, row] = state.least_at[t - 1] if t else -1
        state.known[t, row] = 1  # the bound of such a row is exact
        return -1
    best, best_row = np.inf, -1
    if state.known[t - 1, captured]:
        best, best_row = state.phi[t - 1, captured], captured
    pile = np.empty(64, np.int64)
    for tree in state.tree_order[t - 1]:
        root = tables.roots[tree]
        if state.bound[t - 1, root] > best * MARGIN or state.bound[t - 1, root] == np.inf:
            break
        switch = 0.0 if tables.tree_visemes[tree] == tables.visemes[captured] else pnt
        height, pile[0] = 1, root
        while height:
            height -= 1
            ball = pile[height]
            offer = state.bound[t - 1, ball] + switch
            if offer > best * MARGIN or offer + _gap(tables, ball, row) > best * MARGIN:
                continue
            if tables.left[ball] >= 0:
                pile[height], pile[height + 1] = tables.right[ball], tables.left[ball]
                height += 2
                continue
            for i in range(tables.ball_starts[ball], tables.ball_stops[ball]):
                phi = state.phi[t - 1, i]
                if i == captured or phi + switch > best * MARGIN or phi == np.inf:
                    continue
                joint = _squared_distance(tables.ends, i, tables.joints, row)
                if phi + switch + joint > best * MARGIN:
                    continue
                cost = phi + (beta * _bending(tables, i, captured) + joint + switch)
                if cost > best * MARGIN:
                    continue
                if not state.known[t - 1, i]:
                    return i
                if cost < best or (cost == best and tables.node[i] < tables.node[best_row]):
                    best, best_row = cost, i
    if not state.known[t - 1, captured] and state.phi[t - 1, captured] <= best * MARGIN and state.phi[t - 1, captured] < np.inf:
        return captured
    state.phi[t, row], state.back[t, row], state.known[t, row] = best + target, best_row, 1
    return -1


@njit(cache=True, fastmath={"reassoc", "contract"})
def _squared_distance(a, i, b, j):  # type: ignore[no-untyped-def]
    total = 0.0
    for v in range(a.shape[1]):
        difference = a[i, v] - b[j, v]
        total += difference * difference
    return total


@njit(cache=True)
def _gap(tables, ball, row):  # type: ignore[no-untyped-def]
    """Least PVC from any member of a ball to a row."""
    distance = np.sqrt(_squared_distance(tables.centres, ball, tables.joints, row))
    gap = max(0.0, distance - tables.radii[ball] * MARGIN)
    return gap * gap


@njit(cache=True, fastmath={"reassoc", "contract"})
def _bending(tables, i, p):  # type: ignore[no-untyped-def]
    """DSC(i, p): i is stretched to p's length, weighted by 1 - w, and its second difference added to p's."""
    a, length_i = tables.starts[i], tables.starts[i + 1] - tables.starts[i]
    b, length = tables.starts[p], tables.starts[p + 1] - tables.starts[p]
    width = tables.frames.shape[1]
    if length < 3:
        return 0.0
    fade = np.empty((length, width))
    for k in range(length):
        at = k * (length_i - 1) / (length - 1)
        low = min(int(at), max(length_i - 2, 0))
        share, high = at - low, min(low + 1, length_i - 1)
        w = 1 - k / (length - 1)
        for d in range(width):
            fade[k, d] = w * (tables.frames[a + low, d] * (1 - share) + tables.frames[a + high, d] * share)
    total = 0.0
    for k in range(length - 2):
        for d in range(width):
            bend = fade[k, d] - 2 * fade[k + 1, d] + fade[k + 2, d] + tables.bends[b + k, d]
            total += bend * bend
    return total
