"""Dynamic programming with all transition costs in memory, by matrix products: what the engines are measured against.

The matrix takes Θ(N²) memory; it is made in one batch for each length of a phone.
"""

import numpy as np
import torch
from torch import Tensor

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.steps import end_vectors, start_vectors
from facesynth.inference.warp import stretched

BLOCK = 256


def transition_matrix(nodes: Nodes, weights: Weights, device: str = "cpu", dtype: torch.dtype = torch.float32) -> Tensor:
    """TC [N next, N previous]: rows are next, so that the minimum runs over contiguous memory.

    ‖a - b‖² = ‖a‖² + ‖b‖² - 2ab for PVC, and once for each length of pre(j) for DSC.
    """

    def on(array: np.ndarray) -> Tensor:
        return torch.as_tensor(array, device=device, dtype=dtype)

    every = np.arange(len(nodes))
    cost = _squared_distances(on(start_vectors(nodes, every, weights)), on(end_vectors(nodes, every, weights)))
    before = nodes.before
    lengths = np.where(before >= 0, nodes.lengths[before], 0)
    for length in np.unique(lengths[lengths >= 3]):
        rows = np.flatnonzero(lengths == length)
        fading, rising = _bend_vectors(nodes, int(length), before[rows])
        cost[torch.as_tensor(rows, device=device)] += weights.beta * _squared_distances(-on(rising), on(fading))
    visemes = torch.as_tensor(nodes.visemes, device=device)
    preceding = torch.as_tensor(before, device=device)
    cost += weights.pnt * (visemes[preceding][:, None] != visemes[None])
    cost[preceding < 0] = weights.alpha * weights.pnt
    captured = torch.nonzero(preceding >= 0).ravel()
    cost[captured, preceding[captured]] = 0
    return cost


def dense_search(targets: Floats, transitions: Tensor) -> Ints:
    """[T] the path of least cost by target costs [T, N] and a `transition_matrix`; a blocked min-plus product for each step."""
    asked = torch.as_tensor(targets).to(transitions.device, transitions.dtype)
    phi, back = asked[0], []
    for target in asked[1:]:
        blocks = [(rows + phi).min(dim=1) for rows in torch.split(transitions, BLOCK)]
        back.append(torch.cat([block.indices for block in blocks]))
        phi = torch.cat([block.values for block in blocks]) + target
    path = [int(phi.argmin())]
    for choice in reversed(back):
        path.append(int(choice[path[-1]]))
    return np.array(path[::-1])


def _squared_distances(a: Tensor, b: Tensor) -> Tensor:
    return torch.addmm((a * a).sum(1)[:, None] + (b * b).sum(1), a, b.T, alpha=-2).clamp_min_(0)


def _bend_vectors(nodes: Nodes, length: int, targets: Ints) -> tuple[Floats, Floats]:
    """D2[(1-w) resample(i)] of every node and D2[w p] of the nodes `targets`, flattened."""
    w = np.linspace(0, 1, length)[:, None]
    fading = np.diff((1 - w) * stretched(nodes, np.arange(len(nodes)), length), n=2, axis=1)
    rising = np.diff(w * stretched(nodes, targets, length), n=2, axis=1)
    return fading.reshape(len(fading), -1), rising.reshape(len(rising), -1)
