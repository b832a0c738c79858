"""What stands behind a head, and how linear light becomes display values."""

import numpy as np
from numpy.typing import NDArray


def backdrop(width: int, height: int) -> NDArray[np.float32]:
    """[height, width, 3] a grey studio wall, brighter behind the lit side, with a little noise against banding."""
    y, x = np.mgrid[0:height, 0:width] / float(height)
    distance = np.hypot((x - 0.42 * width / height) * 1.0, (y - 0.40) * 1.15)
    glow = 0.20 * np.exp(-((distance / 0.75) ** 2)) + 0.036
    grain = np.random.default_rng(7).normal(0, 0.0012, (height, width))
    return ((glow + grain)[..., None] * np.array([0.92, 0.97, 1.06])).clip(0).astype(np.float32)


def display_curve(steps: int = 16384) -> NDArray[np.uint8]:
    """[steps] display value of linear light 0..4: a shoulder that keeps highlights, then the sRGB curve."""
    linear = (np.arange(steps) + 0.5) * 4 / steps
    mapped = 0.80 * linear * (1 + linear / 12.0) / (1 + 0.42 * linear)
    encoded = np.where(mapped <= 0.0031308, 12.92 * mapped, 1.055 * np.maximum(mapped, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(255 * np.clip(encoded, 0, 1)).astype(np.uint8)
