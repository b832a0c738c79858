"""The low-pass filter whose cut-offs the data name (Cao 2005, §4.3, smoothing)."""

from functools import cached_property

import numpy as np

from ..arrays import Floats
from ..filters import butterworth, forth_and_back
from ..long_arrays import copied, let_go, row_blocks

ORDER = 6
"""Order of the Butterworth filter, which runs forth and back."""
PASS_ALL = 0.98
"""Cut-offs above this share of half the frame rate need no filter."""
FORGETS = 1e-5
"""Share of a step that is left of it where a filter no longer feels it."""


class LowPass:
    """Takes from each of D components what lies above its cut-off; nothing is shifted in time."""

    def __init__(self, cutoffs_hz: Floats, fps: float) -> None:
        self.filtered = np.flatnonzero(cutoffs_hz < PASS_ALL * fps / 2)
        self._sections = butterworth(ORDER, 2 * cutoffs_hz[self.filtered] / fps)
        self._reach = np.round(2 * fps / cutoffs_hz[self.filtered]).astype(np.int64)

    def __call__(self, components: Floats) -> Floats:
        """Components [T, D], smooth."""
        columns = self.filtered
        if not len(columns) or len(components) < 2:
            return components.copy()
        reach = np.minimum(len(components) - 1, self._reach)
        every = len(columns) == components.shape[1]
        filtered = forth_and_back(self._sections, components if every else components[:, columns], reach)
        if every:
            return filtered
        smooth = copied(components)
        for rows in row_blocks(filtered):
            smooth[rows, columns] = filtered[rows]
            let_go(smooth)
        return smooth

    @cached_property
    def settles_frames(self) -> int:
        """How far the filters reach to either side; it is the lowest cut-off that reaches farthest."""
        if not len(self.filtered):
            return 0
        far = int(np.ceil(2 * np.log(FORGETS) / np.log(self._sections[:, 2].max())))  # by the pole nearest to the circle
        step = np.repeat([0.0, 1.0], far)[:, None].repeat(len(self.filtered), axis=1)
        felt = np.abs(forth_and_back(self._sections, step, 0)[:far]).max(axis=1) > FORGETS
        return far - int(felt.argmax())
