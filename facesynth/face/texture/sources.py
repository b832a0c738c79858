"""Which training picture each synthesised frame is drawn from."""

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facesynth.inference.errors import FacesynthError
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.pictures import PictureSteps

CANDIDATES = 48
"""Nearest training shapes that are considered for each frame."""


def nearest(targets: NDArray[np.float64], shapes: NDArray[np.float64]) -> NDArray[np.int64]:
    """[T] the training shape [N, K, 2] nearest (L2) to each target [T, K, 2] (Saisan 2004, §5)."""
    _check(targets, shapes)
    return cKDTree(_flat(shapes)).query(_flat(targets))[1].astype(np.int64)


def coherent(
    targets: NDArray[np.float64],
    shapes: NDArray[np.float64],
    looks: NDArray[np.float64],
    clip_starts: NDArray[np.bool_],
    jump_weight: float = 0.1,
) -> NDArray[np.int64]:
    """[T] training pictures near the targets whose sequence does not flicker.

    The least sum of (mean squared distance of shapes) + `jump_weight` times (mean squared difference of looks, in units of the
    median difference between recorded neighbours) over all sequences of candidates, as `PictureSteps` has it. Staying on
    a picture, or going on to the one recorded after it, costs nothing.

    targets [T, K, 2] and shapes [N, K, 2] px; looks [N, Q] what the mouth looks like; clip_starts [N] marks the first
    picture of each clip.
    """
    _check(targets, shapes)
    distance, index = cKDTree(_flat(shapes)).query(_flat(targets), k=np.arange(1, min(CANDIDATES, len(shapes)) + 1))
    unary = distance**2 / targets.shape[1]
    natural = np.median(_squared(looks[1:], looks[:-1])[~clip_starts[1:]]) if len(looks) > 1 else 1.0
    scale = jump_weight * np.median(unary[:, 0]) / max(natural, np.finfo(float).tiny)
    steps = PictureSteps(torch.from_numpy(looks), torch.from_numpy(clip_starts), torch.from_numpy(index), scale)
    path = cheapest([target[None] for target in torch.from_numpy(unary)], steps).path[0].numpy()
    return np.take_along_axis(index, path[:, None], axis=1)[:, 0].astype(np.int64)


def _squared(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return ((a - b) ** 2).mean(axis=-1)


def _flat(shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    return shapes.reshape(len(shapes), -1)


def _check(targets: NDArray[np.float64], shapes: NDArray[np.float64]) -> None:
    if targets.ndim != 3 or shapes.ndim != 3 or targets.shape[1:] != shapes.shape[1:] or not len(shapes) or not len(targets):
        raise FacesynthError(
            f"targets [T, K, 2] and training shapes [N, K, 2] do not fit; got {targets.shape} and {shapes.shape}"
        )
