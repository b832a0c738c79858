"""How large the constant PNT is: the papers only say "a large constant"."""

import numpy as np

from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.steps import step_costs

PAIRS = 2000


def median_transition(nodes: Nodes, weights: Weights, seed: int = 0) -> float:
    """Median cost of a rule-2 step (i says the viseme of pre(j), but is not pre(j)) over random pairs.

    PNT is stated as a multiple of it, which makes it independent of the motion's unit. 0 where the
    database has no such pair.
    """
    rng = np.random.default_rng(seed)
    followers = np.flatnonzero(nodes.before >= 0)
    if not len(followers):
        return 0.0
    pairs = []
    for j in rng.choice(followers, PAIRS):
        p = nodes.before[j]
        alike = np.flatnonzero(nodes.visemes == nodes.visemes[p])
        i = int(rng.choice(alike))
        if i != p:
            pairs.append((i, int(j)))
    if not pairs:
        return 0.0
    i, j = np.array(pairs).T
    return float(np.median(step_costs(nodes, i, j, weights)))
