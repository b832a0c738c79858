"""Algorithm 1 of Deng 2008, pair by pair, in plain Python."""

import numpy as np

from facesynth.methods.efase.costs import target_costs, transition_cost


def literal(nodes, query, weights):
    """Algorithm 1 of Deng 2008 as written."""
    n, count = len(nodes), len(query)
    steps = np.array([[transition_cost(nodes, i, j, weights) for j in range(n)] for i in range(n)])
    phi, back = target_costs(nodes, query, 0, weights), []
    for t in range(1, count):
        total = phi[:, None] + steps
        back.append(total.argmin(axis=0))
        phi = total.min(axis=0) + target_costs(nodes, query, t, weights)
    path = [int(phi.argmin())]
    for choice in reversed(back):
        path.append(int(choice[path[-1]]))
    return phi.min(), np.array(path[::-1])
