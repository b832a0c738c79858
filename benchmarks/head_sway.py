"""A head that is alive: slow sway, and small nods where the voice is loud."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

SWAY_DEGREES = (0.9, 1.4, 0.8)
"""Standard deviation of pitch, yaw and roll."""
SWAY_S = 0.6
"""Width of the smoothing that makes the sway slow."""
NOD_DEGREES = 2.2
"""How far the head goes down at full loudness."""


def quiet_head(count: int, fps: float, loudness: NDArray[np.float64], seed: int) -> NDArray[np.float32]:
    """[T, 6] head pose for a motion that has none; loudness [T] in 0..1 makes the nods."""
    rng = np.random.default_rng(seed)
    margin = int(4 * SWAY_S * fps) + 1
    noise = gaussian_filter1d(rng.normal(size=(count + 2 * margin, 3)), SWAY_S * fps, axis=0)
    noise = noise[margin : margin + count] / max(noise.std(), 1e-9)
    turn = np.radians(SWAY_DEGREES) * noise
    nod = gaussian_filter1d(loudness - loudness.mean(), 0.09 * fps, mode="nearest") if count else loudness
    turn[:, 0] += np.radians(NOD_DEGREES) * nod
    return np.hstack([turn, np.zeros((count, 3))]).astype(np.float32)
