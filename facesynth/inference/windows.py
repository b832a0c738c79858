"""Windows of sound, one for each frame of a motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class FrameWindows:
    """Window t is centred on the middle of frame t, `lead_s` later, since lips move before the sound is heard.

    The centre is `round(((t + 1/2) / fps + lead_s) rate)`, never a sum of rounded hops: the clocks stay together for any fps.
    """

    fps: float
    rate: int
    """Hz, of the sound."""
    length: int
    """Samples of a window."""
    lead_s: float

    @property
    def look_ahead_s(self) -> float:
        """Window t ends at t / fps + this, seconds."""
        return 0.5 / self.fps + self.lead_s + (self.length - self.length // 2) / self.rate

    def starts(self, first: int, stop: int) -> NDArray[np.int64]:
        """[stop - first] first sample of each frame's window, counted from the start of the sound."""
        times_s = (np.arange(first, max(first, stop)) + 0.5) / self.fps + self.lead_s
        return np.round(times_s * self.rate).astype(np.int64) - self.length // 2

    def cut(self, sound: NDArray[np.float32], at: int, first: int, stop: int) -> NDArray[np.float32]:
        """[stop - first, length] windows of a sound whose samples from `at` on are given; around them there is silence."""
        starts = self.starts(first, stop) - at
        before, after = max(0, -int(starts[0])), max(0, int(starts[-1]) + self.length - len(sound))
        low = max(0, int(starts[0]))
        around = np.pad(sound[low : max(low, int(starts[-1]) + self.length)], (before, after))
        return around[(starts - starts[0])[:, None] + np.arange(self.length)]
