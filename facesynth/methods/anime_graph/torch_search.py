"""The paths through the graph by torch tensors, wherever a model has been moved to."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from facesynth.inference.anime_graph.search import PathSearch, Step, Weights, path_cost
from facesynth.inference.arrays import Floats, Ints
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.jumps import JumpSteps
from facesynth.motion.search.posterior import posterior


def torch_search(device: str | torch.device = "cpu") -> PathSearch:
    """The engine on a device; the cheapest path is numpy's, ties included."""

    def on(array: Floats | Ints) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(array))[None].to(device)

    def targets(steps: Sequence[Step], weights: Weights) -> list[Tensor]:
        return [on(weights.target(step)) for step in steps]

    def jumps(steps: Sequence[Step], weights: Weights) -> JumpSteps:
        first, last, links = ([on(getattr(step, name)) for step in steps] for name in ("first", "last", "link"))
        return JumpSteps(first, last, links, weights.jump, weights.jump_cost).to(device)

    def best_path(steps: Sequence[Step], weights: Weights) -> tuple[Ints, float]:
        path: Ints = cheapest(targets(steps, weights), jumps(steps, weights)).path[0].cpu().numpy()
        return path, path_cost(steps, path, weights)

    def soft_path(steps: Sequence[Step], weights: Weights, temperature: float) -> list[Floats]:
        found = posterior(targets(steps, weights), jumps(steps, weights), temperature)
        return [shares[0].cpu().numpy() for shares in found.nodes]

    return PathSearch(best_path, soft_path)
