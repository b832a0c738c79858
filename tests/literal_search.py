"""The cost and Algorithm 1 of Deng 2008, pair by pair, in plain Python."""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from facesynth.inference.warp import time_warp


def target_costs(nodes, query, t, weights):
    """[N] OC + EMP + B and what is heard, of every node at position t, node by node."""
    costs = []
    for n in range(len(nodes)):
        cost, same = 0.0, nodes.visemes[n] == query.visemes[t]
        if query.phones[t] >= 0 and nodes.phones[n] != query.phones[t]:
            cost += (weights.gamma if same else 1.0) * weights.delta * weights.pnt
        if query.emotions[t] >= 0 and nodes.emotions[n] != query.emotions[t]:
            cost += weights.phi * weights.pnt
        if query.heard is not None:
            cost += query.heard[t, n]
        forbidden = query.strict is not None and query.strict[t] and not same
        costs.append(np.inf if forbidden or query.fixed.get(t, n) != n else cost)
    return np.array(costs)


def joint_cost(nodes, i, j, weights):
    """Squared jump of position, and of velocity per frame, from the end of i to the start of j."""
    last, first = nodes.motion(i), nodes.motion(j)
    leave = last[-1] - last[-2] if len(last) > 1 else 0 * last[-1]
    arrive = first[1] - first[0] if len(first) > 1 else 0 * first[0]
    return float(weights.eta * ((first[0] - last[-1]) ** 2).sum() + ((arrive - leave) ** 2).sum())


def shape_cost(nodes, i, p):
    """Bending of the blend of i, stretched to p's length, into p; 0 below 3 frames."""
    target = nodes.motion(p)
    if len(target) < 3:
        return 0.0
    w = np.linspace(0, 1, len(target))[:, None]
    blend = w * target + (1 - w) * time_warp(nodes.motion(i), len(target))
    return float((np.diff(blend, n=2, axis=0) ** 2).sum())


def transition_cost(nodes, i, j, weights):
    """TC(i, j), first rule that applies (eq. 4)."""
    p = int(nodes.before[j])
    if p == i:
        return 0.0
    if p < 0:
        return weights.alpha * weights.pnt
    cost = weights.beta * shape_cost(nodes, i, p) + joint_cost(nodes, i, j, weights)
    return cost if nodes.visemes[i] == nodes.visemes[p] else cost + weights.pnt


def path_cost(nodes, query, path, weights):
    """The whole COST of one path [T]."""
    targets = sum(target_costs(nodes, query, t, weights)[node] for t, node in enumerate(path))
    return float(targets + sum(transition_cost(nodes, int(i), int(j), weights) for i, j in pairwise(path)))


@lru_cache(maxsize=2)
def transition_costs(nodes, weights):
    """[N from, N to]; the same nodes are asked again and again."""
    return np.array([[transition_cost(nodes, i, j, weights) for j in range(len(nodes))] for i in range(len(nodes))])


def literal(nodes, query, weights):
    """Algorithm 1 as written: the least cost, and its path of the lowest nodes."""
    steps, count = transition_costs(nodes, weights), len(query)
    phi, back = target_costs(nodes, query, 0, weights), []
    for t in range(1, count):
        total = phi[:, None] + steps
        back.append(total.argmin(axis=0))
        phi = total.min(axis=0) + target_costs(nodes, query, t, weights)
    path = [int(phi.argmin())]
    for choice in reversed(back):
        path.append(int(choice[path[-1]]))
    return phi.min(), np.array(path[::-1])
