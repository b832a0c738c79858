"""Slow, aimless movement: what no living face or head is without."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d


def wander(count: int, fps: float, hz: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[count] smooth Gaussian noise of mean 0 and standard deviation 1 that changes direction about `hz` times a second.

    White noise under a Gaussian of standard deviation s has variance 1 / (2 s sqrt(pi)): it is divided by that, not by
    what happened to be drawn, so that short and long stretches wander alike.
    """
    sigma = fps / hz / 4
    margin = int(np.ceil(4 * sigma))
    white = rng.normal(size=count + 2 * margin)
    smooth = gaussian_filter1d(white, sigma, mode="constant")[margin : margin + count]
    return smooth * np.sqrt(2 * sigma * np.sqrt(np.pi))
