"""Nodes that lie far from all others of their phone: a marker that jumped, a phone that was cut wrongly, another mouth shape."""

import numpy as np

from facesynth.inference.arrays import Floats
from facesynth.inference.warp import time_warp
from facesynth.motion.maps.isomap import nearest
from facesynth.motion.maps.phone_map import Cluster

PLACES = 5
"""Frames by which a node is compared, evenly over its time."""
NEIGHBOURS = 5
FEWEST = 12
"""Nodes of a phone below which none can be told to be odd."""


def remoteness(cluster: Cluster) -> Floats:
    """[K] distance of each node to its fifth nearest of the same phone, as a multiple of the median of all nodes.

    Compared at the same relative times, in the space that is mapped: what a map tears apart is no outlier. Ones where the
    phone has too few nodes.
    """
    if len(cluster.names) < FEWEST:
        return np.ones(len(cluster.names))
    pieces = np.split(cluster.frames, cluster.starts[1:])
    shapes = np.stack([time_warp(piece, PLACES).ravel() for piece in pieces])
    lengths, _ = nearest(shapes, shapes, NEIGHBOURS + 1)
    return lengths[:, -1] / max(float(np.median(lengths[:, -1])), 1e-12)
