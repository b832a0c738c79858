"""Why the search chose what it chose, phone by phone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from facesynth.inference.phones import PHONES
from facesynth.methods.efase.costs import (
    Query,
    Weights,
    end_vectors,
    joint_cost,
    shape_cost,
    start_vectors,
    target_costs,
    transition_cost,
)
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes

CLOSEST = 64
"""Replacements whose exact cost is computed, the nearest by joints."""


def explain(
    nodes: MotionNodes,
    names: Sequence[str],
    emotions: Sequence[str],
    query: Query,
    path: Ints,
    weights: Weights,
    runners_up: int = 3,
) -> list[dict[str, Any]]:
    """One dictionary for each phone: node, cost terms, whether it is right, and the next best nodes.

    A runner-up is a node that could stand at this place with its neighbours held; `extra_cost` is
    what the whole path would cost more.
    """
    rows: list[dict[str, Any]] = []
    for t, node in enumerate(path):
        if node < 0:
            rows.append({"index": t, "phone": "pau", "node": None})
            continue
        targets = target_costs(nodes, query, t, weights)
        first, last = t == 0 or path[t - 1] < 0, t + 1 == len(path) or path[t + 1] < 0
        row = {
            "index": t,
            "phone": PHONES[query.phones[t]] if query.phones[t] >= 0 else "pau",
            "emotion": emotions[query.emotions[t]] if query.emotions[t] >= 0 else None,
            "node": names[node],
            "node_phone": PHONES[nodes.phones[node]],
            "node_emotion": emotions[nodes.emotions[node]],
            "constrained": t in query.fixed,
            **_rightness(nodes, query, t, int(node)),
            "target_cost": float(targets[node]),
            **({} if first else _step(nodes, int(path[t - 1]), int(node), weights)),
            "runners_up": _runners_up(nodes, names, path, t, (first, last), targets, weights, runners_up),
        }
        rows.append(row)
    return rows


def shares(nodes: MotionNodes, query: Query, path: Ints) -> dict[str, float]:
    """Shares of phones (silence left out) that are said by another phone, viseme class or emotion."""
    spoken = query.phones >= 0
    if not spoken.any():
        return {"other_phones": 0.0, "other_visemes": 0.0, "other_emotions": 0.0}
    chosen = path[spoken]
    felt = query.emotions[spoken]
    return {
        "other_phones": float(np.mean(nodes.phones[chosen] != query.phones[spoken])),
        "other_visemes": float(np.mean(nodes.visemes[chosen] != query.visemes[spoken])),
        "other_emotions": float(np.mean((felt >= 0) & (nodes.emotions[chosen] != felt))),
    }


def _rightness(nodes: MotionNodes, query: Query, t: int, node: int) -> dict[str, bool]:
    silent = query.phones[t] < 0
    return {
        "right_phone": bool(silent or nodes.phones[node] == query.phones[t]),
        "right_viseme": bool(silent or nodes.visemes[node] == query.visemes[t]),
        "right_emotion": bool(query.emotions[t] < 0 or nodes.emotions[node] == query.emotions[t]),
    }


def _step(nodes: MotionNodes, i: int, j: int, weights: Weights) -> dict[str, Any]:
    p = int(nodes.before[j])
    step: dict[str, Any] = {"captured": p == i, "transition_cost": transition_cost(nodes, i, j, weights)}
    if p not in (i, -1):
        step["joint_cost"] = joint_cost(nodes, i, j, weights)
        step["shape_cost"] = weights.beta * shape_cost(nodes, i, p)
        step["context_penalty"] = 0.0 if nodes.visemes[i] == nodes.visemes[p] else weights.pnt
    return step


def _runners_up(
    nodes: MotionNodes,
    names: Sequence[str],
    path: Ints,
    t: int,
    edges: tuple[bool, bool],
    targets: Floats,
    weights: Weights,
    count: int,
) -> list[dict[str, Any]]:
    first, last = edges

    def cost(node: int) -> float:
        total = float(targets[node])
        total += 0.0 if first else transition_cost(nodes, int(path[t - 1]), node, weights)
        return total + (0.0 if last else transition_cost(nodes, node, int(path[t + 1]), weights))

    near = _nearest(nodes, path, t, edges, targets, weights)
    ranked = sorted((cost(int(n)), int(n)) for n in near if n != path[t])[:count]
    here = cost(int(path[t]))
    return [{"node": names[n], "extra_cost": c - here} for c, n in ranked if np.isfinite(c)]


def _nearest(nodes: MotionNodes, path: Ints, t: int, edges: tuple[bool, bool], targets: Floats, weights: Weights) -> Ints:
    first, last = edges
    guess = targets.copy()
    if not first:
        guess += ((start_vectors(nodes, weights) - end_vectors(nodes, weights)[path[t - 1]]) ** 2).sum(axis=1)
    if not last:
        guess += ((end_vectors(nodes, weights) - start_vectors(nodes, weights)[path[t + 1]]) ** 2).sum(axis=1)
    return np.argsort(guess, kind="stable")[:CLOSEST]
