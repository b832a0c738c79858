"""The same search with all transition costs in memory, by matrix products, on any torch device.

Θ(N²) memory: for graphics cards, and as the reference that the sparse search is measured against.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from facesynth.inference.warp import time_warp
from facesynth.methods.efase.costs import Query, Weights, end_vectors, path_cost, start_vectors, target_costs
from facesynth.methods.efase.nodes import MotionNodes
from facesynth.methods.efase.search import Path

BLOCK = 256


def transition_matrix(nodes: MotionNodes, weights: Weights, device: str = "cpu", dtype: torch.dtype = torch.float32) -> Tensor:
    """TC [N next, N previous]: rows are next, so that the minimum runs over contiguous memory.

    ‖a - b‖² = ‖a‖² + ‖b‖² - 2ab for PVC, and once for each length of pre(j) for DSC.
    """

    def on(array: np.ndarray) -> Tensor:
        return torch.as_tensor(array, device=device, dtype=dtype)

    cost = _squared_distances(on(start_vectors(nodes, weights)), on(end_vectors(nodes, weights)))
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


def dense_search(nodes: MotionNodes, query: Query, weights: Weights, transitions: Tensor) -> Path:
    """Algorithm 1 of Deng 2008 over a given `transition_matrix`; a blocked min-plus product for each step."""
    targets = [
        torch.as_tensor(target_costs(nodes, query, t, weights)).to(transitions.device, transitions.dtype)
        for t in range(len(query))
    ]
    phi, back = targets[0], []
    for target in targets[1:]:
        blocks = [(rows + phi).min(dim=1) for rows in torch.split(transitions, BLOCK)]
        back.append(torch.cat([block.indices for block in blocks]))
        phi = torch.cat([block.values for block in blocks]) + target
    path = [int(phi.argmin())]
    for choice in reversed(back):
        path.append(int(choice[path[-1]]))
    found = np.array(path[::-1])
    return Path(found, path_cost(nodes, query, found, weights), 1.0)


def _squared_distances(a: Tensor, b: Tensor) -> Tensor:
    return torch.addmm((a * a).sum(1)[:, None] + (b * b).sum(1), a, b.T, alpha=-2).clamp_min_(0)


def _bend_vectors(nodes: MotionNodes, length: int, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D2[(1-w) resample(i)] of every node and D2[w p] of the nodes `targets`, flattened."""
    w = np.linspace(0, 1, length)[:, None]
    fading = [np.diff((1 - w) * time_warp(nodes.motion(i), length), n=2, axis=0).ravel() for i in range(len(nodes))]
    rising = [np.diff(w * nodes.motion(p), n=2, axis=0).ravel() for p in targets]
    return np.stack(fading), np.stack(rising)
