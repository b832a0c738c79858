"""How large the constant PNT is: the papers only say "a large constant"."""

import numpy as np

from facesynth.inference.arrays import Ints
from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.steps import step_costs

PAIRS = 2000


def median_transition(nodes: Nodes, weights: Weights, seed: int = 0) -> float:
    """Median cost of a rule-2 step (i says the viseme of pre(j), but is not pre(j)) over random pairs.

    PNT is stated as a multiple of it, which makes it independent of the motion's unit. 0 where the
    database has no such pair.
    """
    i, j = alike_pairs(nodes, seed)
    return float(np.median(step_costs(nodes, i, j, weights))) if len(i) else 0.0


def alike_pairs(nodes: Nodes, seed: int = 0) -> tuple[Ints, Ints]:
    """[n], [n] random pairs of nodes (i, j) between which a step is one of rule 2."""
    rng = np.random.default_rng(seed)
    followers = np.flatnonzero(nodes.before >= 0)
    pairs = []
    for j in rng.choice(followers, PAIRS) if len(followers) else ():
        p = nodes.before[j]
        i = int(rng.choice(np.flatnonzero(nodes.visemes == nodes.visemes[p])))
        if i != p:
            pairs.append((i, int(j)))
    found = np.array(pairs, np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]
