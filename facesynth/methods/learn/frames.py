"""What the reference methods take from a corpus."""

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout


class PoseSum:
    """Running mean of frames [T, C] in which samples may be missing."""

    def __init__(self, channels: int) -> None:
        self.total = np.zeros(channels)
        self.count = np.zeros(channels, np.int64)

    def add(self, frames: NDArray[np.float32]) -> None:
        """Count the samples of [T, C] that are not NaN."""
        present = ~np.isnan(frames)
        self.total += np.where(present, frames, 0.0).sum(axis=0, dtype=np.float64)
        self.count += present.sum(axis=0)

    def mean(self, otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
        """[C] the mean, and what stands in for channels of which no sample was counted."""
        return np.where(self.count > 0, self.total / np.maximum(self.count, 1), otherwise)


def mean_pose(corpus: Corpus) -> NDArray[np.float64]:
    """[C] mean of all recorded samples; FacesynthError where a channel has none."""
    poses = PoseSum(corpus.layout.channels)
    for utterance in corpus:
        poses.add(utterance.motion.frames)
    if not poses.count.all():
        raise FacesynthError(
            f"{_missing(corpus.layout, poses.count)} is missing in every frame of {corpus.path}; take it out of the layout"
        )
    return poses.mean(np.zeros(corpus.layout.channels))


def complete(frames: NDArray[np.float32]) -> NDArray[np.bool_]:
    """[T] frames in which no sample is missing."""
    return np.asarray(~np.isnan(frames).any(axis=1))


def complete_frames(corpus: Corpus) -> NDArray[np.float32]:
    """[N, C] all frames of a corpus in which no sample is missing; FacesynthError where there are too few to learn from."""
    frames = corpus.arrays().frames
    kept = frames[complete(frames)]
    if len(kept) < 2:
        raise FacesynthError(f"{corpus.path} has {len(kept)} frames without gaps; at least 2 are needed: fill or record more")
    return kept


def _missing(layout: Layout, count: NDArray[np.int64]) -> str:
    return layout.names[int(np.flatnonzero(count == 0)[0]) // layout.dimension]
