"""The cheapest path by torch tensors, wherever a model has been moved to."""

import numpy as np
import torch

from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.nodes import Floats, Ints, Nodes
from facesynth.inference.efase.search import Engine
from facesynth.motion.search.motion_nodes import MotionNodeSteps
from facesynth.motion.search.pruning import MotionNodeSearch


def torch_engine(nodes: Nodes, weights: Weights, device: str | torch.device = "cpu") -> Engine:
    """The engine on a device; a class of its bounds is one phone in one emotion, as in the numpy engine's."""
    classes = np.unique(np.stack([nodes.phones, nodes.emotions]), axis=1, return_inverse=True)[1].reshape(-1)
    search = MotionNodeSearch(MotionNodeSteps(nodes, weights), torch.from_numpy(classes)).to(device)

    def cheapest_path(targets: Floats) -> Ints:
        path: Ints = search.cheapest([torch.from_numpy(targets).to(device)]).path[0].cpu().numpy()
        return path

    return cheapest_path
