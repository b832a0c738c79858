"""What the network of poses is trained to make small: distances of points and of their velocities, lips first."""

import numpy as np
import torch
from torch import Tensor, nn

from facesynth.inference.layout import Layout
from facesynth.methods.learn.windows import Batch

LIPS = 4.0
"""How much a lip point counts beside another one."""
MOST_OTHERS = 64
"""Points beside the lips that are looked at; of more, evenly spread ones tell enough."""
ROUND = 0.01
"""Distances are rounded off below this share of the motion's size, where a norm has no derivative."""
DEEPEST, SHALLOWEST = -5.0, 3.0
"""Logarithms of deviations, in units of the first component's, are held between these while they are learned."""


def lip_points(layout: Layout) -> list[int]:
    """Points of the lips; of the mouth where the layout does not name them, all points where it names neither."""
    named = [name for name in ("lips_inner", "lips_outer") if name in layout.groups] or ["mouth"] * ("mouth" in layout.groups)
    found = {int(point) for name in named for point in layout.group(name)}
    return sorted(found) or list(range(len(layout.names)))


class PointLoss(nn.Module):
    """Mean over frames of the weighted distances of points, and of their velocities; and how likely the deviations are.

    A mean of distances, not of their squares, leads to the pose in the middle of those that are said the same way: one odd
    recording does not pull it away.
    """

    basis: Tensor
    """[R, points * dimension] from components to points."""
    weights: Tensor
    """[points] mean 1."""

    def __init__(self, layout: Layout, basis: Tensor, size: float) -> None:
        """basis [C, R]: from components to channels; size: about how far a point moves, unit of the layout."""
        super().__init__()
        lips = lip_points(layout)
        others = np.setdiff1d(np.arange(len(layout.names)), lips)
        some = others[:: max(1, -(-len(others) // MOST_OTHERS))]
        weights = np.concatenate([np.full(len(lips), LIPS), np.full(len(some), len(others) / max(len(some), 1))])
        points = np.concatenate([np.array(lips), some]).astype(np.int64)
        columns = (points[:, None] * layout.dimension + np.arange(layout.dimension)).ravel()
        self.dimension, self.rounding = layout.dimension, (ROUND * size) ** 2
        self.register_buffer("basis", basis[torch.from_numpy(columns).to(basis.device)].T.contiguous())
        self.register_buffer("weights", torch.from_numpy(weights / weights.mean()).to(basis))

    def forward(self, predicted: Tensor, log_deviations: Tensor, batch: Batch) -> Tensor:
        """Of components [B, F', R] and logarithms of their deviations, the last WINDOW of which are those of the poses."""
        count = batch.poses.shape[1]
        predicted, log_deviations = predicted[:, -count:], log_deviations[:, -count:]
        missed = predicted - batch.poses
        apart = (missed @ self.basis).reshape(*missed.shape[:2], -1, self.dimension)  # [B, F, points, dimension]
        both = batch.present[:, 1:] * batch.present[:, :-1]
        near = self._mean_distance(apart, batch.present) + self._mean_distance(apart.diff(dim=1), both)
        return near + self._surprise(missed.detach(), log_deviations, batch.present)

    def _mean_distance(self, apart: Tensor, present: Tensor) -> Tensor:
        distances = (apart.square().sum(dim=-1) + self.rounding).sqrt()
        return ((distances * self.weights).mean(dim=-1) * present).sum() / present.sum().clamp(min=1)

    def _surprise(self, missed: Tensor, log_deviations: Tensor, present: Tensor) -> Tensor:
        """-log of the normal density of what was missed, without its constant, mean over components."""
        held = log_deviations.clamp(DEEPEST, SHALLOWEST)
        each = held + 0.5 * missed.square() * torch.exp(-2 * held)
        return (each.mean(dim=-1) * present).sum() / present.sum().clamp(min=1)
