"""How large the constant PNT is: the papers only say "a large constant"."""

from __future__ import annotations

import numpy as np

from facesynth.methods.efase.costs import Weights, transition_cost
from facesynth.methods.efase.nodes import MotionNodes

PAIRS = 2000


def median_transition(nodes: MotionNodes, weights: Weights, seed: int = 0) -> float:
    """Median cost of a rule-2 step (i says the viseme of pre(j), but is not pre(j)) over random pairs.

    PNT is stated as a multiple of it, which makes it independent of the motion's unit. 0 where the
    database has no such pair.
    """
    rng = np.random.default_rng(seed)
    followers = np.flatnonzero(nodes.before >= 0)
    if not len(followers):
        return 0.0
    costs = []
    for j in rng.choice(followers, PAIRS):
        p = nodes.before[j]
        alike = np.flatnonzero(nodes.visemes == nodes.visemes[p])
        i = int(rng.choice(alike))
        if i != p:
            costs.append(transition_cost(nodes, i, int(j), weights))
    return float(np.median(costs)) if costs else 0.0
