"""The mean over all paths through the graph, the cheaper the more: eq. 2 of Cao 2005 at a temperature.

The same recursion as in `search`, with `-tau log sum exp(-· / tau)` in the place of `min`; tau -> 0 is the cheapest
path. A mean of many recorded phones is nearer to what is said than any of them, and moves less.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.candidates import Chooser
from facesynth.methods.anime_graph.plan import Plan, make_piece
from facesynth.methods.anime_graph.search import Step, Weights
from facesynth.methods.learn.posterior import posterior

LEAST_SHARE = 1e-3
"""Candidates that are less probable than this are left out of the mean."""


def soft_path(steps: Sequence[Step], weights: Weights, temperature: float) -> list[NDArray[np.float64]]:
    """The posterior probability [n] of each candidate of each phone; temperature in the unit of eq. 2, above 0."""
    if not temperature > 0:
        raise FacesynthError(f"a soft search needs a temperature above 0; got {temperature:g}: take best_path instead")
    targets = [torch.from_numpy(weights.target(step)) for step in steps]
    moves = [torch.from_numpy(step_costs(before, step, weights)) for before, step in pairwise(steps)]
    return [shares.numpy() for shares in posterior(targets, moves, temperature).nodes]


def step_costs(before: Step, step: Step, weights: Weights) -> NDArray[np.float64]:
    """[n, n'] what eq. 2 asks for the step from each candidate to each of the next phone; nothing where it was captured."""
    jumps, apart = step_terms(before, step)
    return weights.jump * jumps + weights.jump_cost * apart


def step_terms(before: Step, step: Step) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """[n, n'] 1 where a step is a jump, and how far apart the frames are that meet there; 0 where it was captured."""
    squared = (before.last**2).sum(axis=1)[:, None] + (step.first**2).sum(axis=1) - 2 * before.last @ step.first.T
    jumps, apart = np.ones_like(squared), np.sqrt(np.maximum(squared, 0.0))
    linked = np.flatnonzero(step.link >= 0)
    jumps[step.link[linked], linked] = apart[step.link[linked], linked] = 0.0
    return jumps, apart


def mean_motion(chooser: Chooser, plan: Plan, weights: Weights, temperature: float) -> NDArray[np.float64]:
    """[frames, D] each phone the mean of its candidates, brought to its time; not yet smoothed."""
    frames = []
    shares_of = soft_path(plan.steps, weights, temperature)
    for wish, candidates, shares in zip(plan.wishes, plan.candidates, shares_of, strict=True):
        likely = np.flatnonzero(shares >= min(LEAST_SHARE, shares.max()))
        pieces = np.stack([make_piece(chooser, wish, candidates, int(i)).motion for i in likely])
        frames.append(np.tensordot(shares[likely] / shares[likely].sum(), pieces, 1))
    return np.concatenate(frames)
