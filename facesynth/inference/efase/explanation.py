"""Why the search chose what it chose, phone by phone."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arrays import Floats, Ints
from ..efase.costs import Query, Weights, target_costs
from ..efase.nodes import Nodes
from ..efase.steps import end_vectors, start_vectors, step_costs, step_terms
from ..phones import PHONES, SILENCE

CLOSEST = 64
"""Replacements whose exact cost is computed, the nearest by joints."""


def explain(
    nodes: Nodes,
    names: Sequence[str],
    emotions: Sequence[str],
    query: Query,
    path: Ints,
    weights: Weights,
    runners_up: int = 3,
) -> list[dict[str, Any]]:
    """One dictionary for each phone: node, cost terms, whether it is right, and the next best nodes.

    A runner-up is a node that could stand at this place with its neighbours held; `extra_cost` is
    what the whole path would cost more. Without runners_up (0) it takes little time.
    """
    rows: list[dict[str, Any]] = []
    for t, node in enumerate(path.tolist()):
        if node < 0:
            rows.append({"index": t, "phone": SILENCE, "node": None})
            continue
        targets = target_costs(nodes, query, t, weights)
        before = int(path[t - 1]) if t > 0 else -1
        row = {
            "index": t,
            "phone": PHONES[query.phones[t]] if query.phones[t] >= 0 else SILENCE,
            "emotion": emotions[query.emotions[t]] if query.emotions[t] >= 0 else None,
            "node": names[node],
            "node_phone": PHONES[nodes.phones[node]],
            "node_emotion": emotions[nodes.emotions[node]],
            "constrained": t in query.fixed,
            **_rightness(nodes, query, t, node),
            "target_cost": float(targets[node]),
            **(_step(nodes, before, node, weights) if before >= 0 else {}),
            **({"runners_up": _runners_up(nodes, names, path, t, targets, weights, runners_up)} if runners_up else {}),
        }
        rows.append(row)
    return rows


def shares(nodes: Nodes, query: Query, path: Ints) -> dict[str, float]:
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


def _rightness(nodes: Nodes, query: Query, t: int, node: int) -> dict[str, bool]:
    silent = query.phones[t] < 0
    return {
        "right_phone": bool(silent or nodes.phones[node] == query.phones[t]),
        "right_viseme": bool(silent or nodes.visemes[node] == query.visemes[t]),
        "right_emotion": bool(query.emotions[t] < 0 or nodes.emotions[node] == query.emotions[t]),
    }


def _step(nodes: Nodes, i: int, j: int, weights: Weights) -> dict[str, Any]:
    p, pair = int(nodes.before[j]), (np.array([i]), np.array([j]))
    step: dict[str, Any] = {"captured": p == i, "transition_cost": float(step_costs(nodes, *pair, weights)[0])}
    if p not in (i, -1):
        terms = step_terms(nodes, *pair)
        step["joint_cost"] = float(weights.eta * terms.place[0, 0] + terms.speed[0, 0])
        step["shape_cost"] = float(weights.beta * terms.bend[0, 0])
        step["context_penalty"] = float(weights.pnt * terms.switches[0, 0])
    return step


def _runners_up(
    nodes: Nodes, names: Sequence[str], path: Ints, t: int, targets: Floats, weights: Weights, count: int
) -> list[dict[str, Any]]:
    chosen = int(path[t])
    before, after = path[t - 1 : t] if t > 0 else path[:0], path[t + 1 : t + 2]
    before, after = before[before >= 0], after[after >= 0]
    some = np.append(_nearest(nodes, before, after, targets, weights), chosen)
    costs = targets[some]
    for i in before.tolist():
        costs = costs + step_costs(nodes, np.full(len(some), i), some, weights)
    for j in after.tolist():
        costs = costs + step_costs(nodes, some, np.full(len(some), j), weights)
    ranked = [k for k in np.lexsort((some, costs)).tolist() if some[k] != chosen and np.isfinite(costs[k])][:count]
    return [{"node": names[some[k]], "extra_cost": float(costs[k] - costs[-1])} for k in ranked]


def _nearest(nodes: Nodes, before: Ints, after: Ints, targets: Floats, weights: Weights) -> Ints:
    """The nodes that look cheapest by target cost and joints, none or one node standing before and after."""
    everything, guess = np.arange(len(nodes)), targets.copy()
    for i in before:
        guess += ((start_vectors(nodes, everything, weights) - end_vectors(nodes, np.array([i]), weights)) ** 2).sum(axis=1)
    for j in after:
        guess += ((end_vectors(nodes, everything, weights) - start_vectors(nodes, np.array([j]), weights)) ** 2).sum(axis=1)
    return np.argsort(guess, kind="stable")[:CLOSEST]
