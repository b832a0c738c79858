"""What recorded faces do that their lips do not explain; see `inference.residual`."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus
from facesynth.inference.residual import ARRAYS, ResidualMotion, loudness
from facesynth.methods.learn.point_loss import lip_points
from facesynth.motion.pca import Pca

EXPLAINING, KEPT = 8, 24
"""Principal components of the lips that explain the rest, and of what they leave that are kept."""
MOST_FRAMES = 40_000
"""Of longer corpora, whole recordings up to so many frames."""

Floats = NDArray[np.float64]


class Residual(nn.Module):
    """The arrays of a `ResidualMotion`."""

    frames: Tensor
    basis: Tensor
    loudness: Tensor
    bounds: Tensor
    emotions: Tensor

    def __init__(self) -> None:
        super().__init__()
        for name in ARRAYS:
            self.register_buffer(name, torch.zeros(0))

    def learn(self, corpus: Corpus) -> str:
        """From recordings, gaps bridged; why nothing is kept, empty where something is.

        Curves are no points that could be told from the lips, and might leave their range.
        """
        layout = corpus.layout
        lips = lip_points(layout)
        if layout.kind == "curves" or len(lips) == len(layout.names):
            return "the layout has no lips among points that could move beside them"
        kept, level, emotions = self._recorded(corpus)
        if not kept:
            return "no recording has a sample of every channel"
        columns = (np.array(lips)[:, None] * layout.dimension + np.arange(layout.dimension)).ravel()
        left = unexplained(np.concatenate(kept), columns)
        pca = Pca.fit(left, min(KEPT, left.shape[1]))
        basis = pca.basis.numpy().T * (~np.isin(np.arange(left.shape[1]), columns))
        bounds = np.cumsum([0, *map(len, kept)])
        single = (array.astype(np.float32) for array in (left @ basis.T, basis, np.concatenate(level)))
        for name, array in zip(ARRAYS, (*single, bounds, np.array(emotions, np.int64)), strict=True):
            setattr(self, name, torch.from_numpy(array).to(self.frames.device))
        return ""

    def motion(self, fps: float, share: float) -> ResidualMotion | None:
        """What speaks with it; None where nothing was kept."""
        frames, basis, level, bounds, emotions = (getattr(self, name).cpu().numpy() for name in ARRAYS)
        return ResidualMotion(frames, basis, level, bounds, emotions, fps, share) if self.any else None

    @property
    def any(self) -> bool:
        """Whether anything was kept."""
        return len(self.bounds) > 1

    @staticmethod
    def _recorded(corpus: Corpus) -> tuple[list[Floats], list[Floats], list[int]]:
        """Frames [T, C] about their mean, loudness [T] and emotion of whole recordings, up to MOST_FRAMES together."""
        kept: list[Floats] = []
        level: list[Floats] = []
        emotions: list[int] = []
        for utterance in corpus:
            frames = _bridged(utterance.motion.frames)
            if len(frames) > 1 and sum(map(len, kept)) + len(frames) <= MOST_FRAMES:
                kept.append(frames - frames.mean(axis=0))
                level.append(loudness(utterance.speech, corpus.fps, len(frames)))
                emotions.append(corpus.emotions.index(utterance.emotion))
        return kept, level, emotions


def unexplained(frames: Floats, columns: NDArray[np.int64]) -> Floats:
    """Frames [F, C] of mean 0 without what is linear in the first components of the channels `columns`, which become 0."""
    lips = frames[:, columns]
    _, directions = np.linalg.eigh(lips.T @ lips)
    lead = lips @ directions[:, -EXPLAINING:]
    left = frames - lead @ np.linalg.lstsq(lead.T @ lead, lead.T @ frames, rcond=None)[0]
    left[:, columns] = 0
    return np.asarray(left)


def _bridged(frames: NDArray[np.float32]) -> Floats:
    """Frames [T, C] with straight lines over gaps; none of a recording in which some channel has no sample."""
    present = ~np.isnan(frames)
    if not present.any(axis=0).all():
        return np.zeros((0, frames.shape[1]))
    at = np.arange(len(frames))
    columns = [np.interp(at, np.flatnonzero(ok), column[ok]) for column, ok in zip(frames.T, present.T, strict=True)]
    return np.stack(columns, axis=1).astype(np.float64)
