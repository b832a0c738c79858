"""The cheapest path, and the mean over paths, by torch tensors, wherever a model has been moved to."""

from collections.abc import Sequence

import numpy as np
import torch

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.search import Engine
from facesynth.inference.efase.soft import Mix, Mixture
from facesynth.motion.search.motion_nodes import MotionNodeSteps, NodePath
from facesynth.motion.search.posterior import posterior
from facesynth.motion.search.pruning import MotionNodeSearch


def torch_engine(nodes: Nodes, weights: Weights, device: str | torch.device = "cpu") -> Engine:
    """The engine on a device; a class of its bounds is one phone in one emotion, as in the numpy engine's."""
    classes = np.unique(np.stack([nodes.phones, nodes.emotions]), axis=1, return_inverse=True)[1].reshape(-1)
    search = MotionNodeSearch(MotionNodeSteps(nodes, weights), torch.from_numpy(classes)).to(device)

    def cheapest_path(targets: Floats) -> Ints:
        path: Ints = search.cheapest([torch.from_numpy(targets).to(device)]).path[0].cpu().numpy()
        return path

    return cheapest_path


def torch_mix(nodes: Nodes, weights: Weights, device: str | torch.device = "cpu") -> Mix:
    """Means over the paths through some candidates, on a device."""
    steps = MotionNodeSteps(nodes, weights).to(device)

    def mix(chosen: Sequence[Ints], costs: Sequence[Floats], temperature: float) -> list[Mixture]:
        path = NodePath(steps, [torch.from_numpy(which).to(device) for which in chosen])
        found = posterior([torch.from_numpy(cost)[None].to(device) for cost in costs], path, temperature)
        shares = [each[0].cpu().numpy() for each in found.nodes]
        captured = [0.0, *(float(found.captured(t)[0].cpu()) for t in range(len(chosen) - 1))]
        return [Mixture(*parts) for parts in zip(chosen, shares, captured, strict=True)]

    return mix
