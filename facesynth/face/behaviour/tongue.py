"""What the tongue does for each phone; markers on the skin do not see it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.speech import PhoneTrack

TIP_UP: Mapping[str, float] = {
    **dict.fromkeys(["t", "d", "n", "en", "l", "el"], 1.0),
    **dict.fromkeys(["s", "z"], 0.7),
    "r": 0.6,
    **dict.fromkeys(["th", "dh", "er", "y"], 0.5),
    **dict.fromkeys(["sh", "zh", "ch", "jh", "iy", "ey"], 0.4),
    **dict.fromkeys(["ih", "ay", "oy"], 0.3),
    "eh": 0.2,
    **dict.fromkeys(["ae", "ah", "ax", "k", "g", "ng"], 0.1),
}
"""How far the tip is lifted, 0..1; 0 where a phone is not listed."""

TIP_OUT: Mapping[str, float] = {"th": 0.34, "dh": 0.34, "l": 0.06, "el": 0.06}
"""Weight of tongueOut."""

SMOOTHING_S = 0.022
"""Standard deviation of the Gaussian between one target and the next."""


def tongue_track(targets: Mapping[str, float], phones: PhoneTrack | None, count: int, fps: float) -> NDArray[np.float64]:
    """[T] a target per phone as a smooth curve; zeros without phones."""
    if phones is None:
        return np.zeros(count)
    phone = np.searchsorted(phones.ends_s, (np.arange(count) + 0.5) / fps, side="right")
    heights = np.array([targets.get(label, 0.0) for label in phones.labels] + [0.0])  # nothing after the last phone
    return gaussian_filter1d(heights[phone], SMOOTHING_S * fps, mode="nearest")
