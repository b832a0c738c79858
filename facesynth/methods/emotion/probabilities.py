"""From the margins of pairwise classifiers to the probabilities of classes."""

from itertools import combinations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

CLOSEST_TO_CERTAIN = 1e-7


def fit_sigmoid(margins: NDArray[np.float64], positive: NDArray[np.bool_]) -> tuple[float, float]:
    """Slope and offset (a, b) of Platt's sigmoid: P(positive | m) = 1 / (1 + exp(a m + b)).

    Regularised maximum likelihood (Lin, Lin, Weng 2007): the targets are (N+ + 1) / (N+ + 2) and 1 / (N- + 2) in
    place of 1 and 0, so that separable margins keep a finite slope. The problem is convex; Newton's method with
    halved steps solves it.
    """
    count = positive.sum()
    target = np.where(positive, (count + 1) / (count + 2), 1 / (len(positive) - count + 2))
    parameters = np.array([0.0, np.log((len(positive) - count + 1) / (count + 1))])
    design = np.stack([margins, np.ones_like(margins)], axis=1)
    loss = _loss(design @ parameters, target)
    for _ in range(100):
        p = 1 / (1 + np.exp(np.clip(design @ parameters, -500, 500)))
        gradient = design.T @ (target - p)
        if np.abs(gradient).max() < 1e-7 * len(margins):
            break
        hessian = (design * (p * (1 - p))[:, None]).T @ design + 1e-12 * np.eye(2)
        step = np.linalg.solve(hessian, gradient)
        while (new := _loss(design @ (parameters - step), target)) > loss and np.abs(step).max() > 1e-12:
            step = step / 2
        parameters, loss = parameters - step, new
    return float(parameters[0]), float(parameters[1])


def _loss(exponent: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    return float(np.sum(target * exponent + np.logaddexp(0, -exponent)))


def couple(pairwise: Tensor, classes: int) -> Tensor:
    """Pairwise probabilities [..., K(K-1)/2] of the first of each pair to class probabilities [..., K].

    Wu, Lin and Weng 2004, second approach: minimise sum over i, j of (r_ji p_i - r_ij p_j)² with sum p = 1. That is
    a quadratic form Q with Q_ii = sum over j of r_ji² and Q_ij = -r_ji r_ij; its minimiser on the simplex solves
    [Q 1; 1ᵀ 0] [p; b] = [0; 1] and is positive by itself. Pairs are (0, 1), (0, 2), …, (1, 2), ….
    """
    safe = pairwise.to(torch.float64).clamp(CLOSEST_TO_CERTAIN, 1 - CLOSEST_TO_CERTAIN)
    first, second = _pairs(classes, safe.device)
    r = safe.new_zeros(*safe.shape[:-1], classes, classes)
    r[..., first, second], r[..., second, first] = safe, 1 - safe
    system = safe.new_ones(*safe.shape[:-1], classes + 1, classes + 1)
    system[..., :classes, :classes] = -r * r.transpose(-1, -2) + torch.diag_embed(r.square().sum(-2))
    system[..., classes, classes] = 0
    right = safe.new_zeros(*safe.shape[:-1], classes + 1, 1)
    right[..., classes, 0] = 1
    solved = torch.linalg.solve(system, right)[..., :classes, 0].clamp(min=0)
    return solved / solved.sum(-1, keepdim=True)


def vote(margins: Tensor, classes: int) -> Tensor:
    """Margins [..., K(K-1)/2] to the class [...] that wins most pairs; ties go to the lowest, as in libsvm."""
    first, second = _pairs(classes, margins.device)
    positive = (margins > 0).to(torch.int64)
    won = positive.new_zeros(*margins.shape[:-1], classes)
    won.index_add_(won.dim() - 1, first, positive)
    won.index_add_(won.dim() - 1, second, 1 - positive)
    return (won * (classes + 1) - torch.arange(classes, device=won.device)).argmax(-1)


def _pairs(classes: int, device: torch.device) -> tuple[Tensor, ...]:
    """First and second class of each pair: (0, 1), (0, 2), …, (1, 2), …"""
    return torch.tensor(list(combinations(range(classes), 2)), device=device).T.unbind()
