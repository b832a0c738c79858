"""A model of phones alone beside a network that hears: the mean of what both say.

They err in different places. Key shapes, which never heard a voice, know what is meant at a phone and mistake no stranger's; the
network knows how it was said this time.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .coarticulation.model import coarticulation_of
from .folder import Folder
from .long_arrays import Growing, let_go, row_blocks
from .motion import Motion
from .speech import Speech

PREFIX = "beside_"
"""Of its arrays in the network's folder."""


@dataclass(frozen=True, eq=False)
class Beside:
    """Another model of the same layout and rate."""

    synthesize: Callable[[Speech], Motion]
    share: float
    """How much of the mean is its own, 0..1."""

    def mixed(self, frames: Floats, speech: Speech) -> Floats:
        """[T, C] the mean of frames [T, C] and what it says of the same speech."""
        other, parts = self.synthesize(speech).frames, Growing(np.float64)
        for rows in row_blocks(frames):
            parts.add(frames[rows] + self.share * (other[rows].astype(np.float64) - frames[rows]))
            let_go(other)
        return parts.whole()


def exported_beside(folder: Folder, arrays: Mapping[str, NDArray[Any]], threads: int) -> Beside | None:
    """What stands beside a folder's network; None where nothing does."""
    stated = folder.settings.get("beside")
    if stated is None:
        return None
    own = {name.removeprefix(PREFIX): array for name, array in arrays.items() if name.startswith(PREFIX)}
    return Beside(coarticulation_of(folder, own, stated["closed_gap"], threads).synthesize, float(stated["share"]))
