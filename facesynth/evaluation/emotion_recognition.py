"""Which emotion a face shows, by a classifier that learned from real motion of other sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.motion.pca import Pca

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

VARIANCE = 0.95
"""Share of the motion's variance that is looked at: the components beyond it are noise, which standardising would enlarge."""
QUANTILES = (0.1, 0.5, 0.9)


class EmotionRecogniser:
    """Logistic regression on statistics of an utterance's motion: how the face is held, and how widely it moves.

    The features are mean, standard deviation and three quantiles over time of each principal component of the
    motion (95 % of its variance), standardised over the training utterances.
    """

    def __init__(self, pca: Pca, classifier: Pipeline) -> None:
        self.pca = pca
        self.classifier = classifier

    @classmethod
    def fit(cls, corpus: Corpus) -> Self:
        """Learn from recorded motion; FacesynthError where it shows fewer than two emotions."""
        from sklearn.linear_model import LogisticRegression
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        recordings = [(utterance.emotion, utterance.motion) for utterance in corpus if _complete(utterance.motion).size]
        emotions = [emotion for emotion, _ in recordings]
        if len(set(emotions)) < 2:
            raise FacesynthError(f"recognising emotions takes recordings in two of them; got {sorted(set(emotions))}")
        pca = Pca.fit(np.concatenate([_complete(motion) for _, motion in recordings]), VARIANCE)
        classifier = make_pipeline(StandardScaler(), LogisticRegression(max_iter=5000))
        classifier.fit(np.stack([_statistics(pca, motion) for _, motion in recordings]), emotions)
        return cls(pca, classifier)

    @property
    def emotions(self) -> tuple[str, ...]:
        """The emotions that it tells apart, in alphabetical order."""
        return tuple(map(str, self.classifier.classes_))

    def recognise(self, motion: Motion) -> str:
        """The emotion that a motion of the training layout shows most."""
        if not _complete(motion).size:
            raise FacesynthError("the motion has no frame without missing samples; fill its gaps first")
        return str(self.classifier.predict(_statistics(self.pca, motion)[None])[0])


@dataclass(frozen=True, eq=False)
class Confusion:
    """Which emotion was asked, and which was recognised."""

    emotions: tuple[str, ...]
    counts: NDArray[np.int64]
    """[E asked, E recognised] utterances."""

    @classmethod
    def of(cls, asked: Sequence[str], recognised: Sequence[str]) -> Self:
        """Count pairs of labels."""
        emotions = tuple(sorted({*asked, *recognised}))
        counts = np.zeros((len(emotions), len(emotions)), np.int64)
        for one, other in zip(asked, recognised, strict=True):
            counts[emotions.index(one), emotions.index(other)] += 1
        return cls(emotions, counts)

    @property
    def accuracy(self) -> float:
        """Share of all utterances that were recognised as asked; NaN without utterances."""
        total = self.counts.sum()
        return float(np.trace(self.counts) / total) if total else float("nan")

    @property
    def unweighted_average_recall(self) -> float:
        """Mean over the asked emotions of the share recognised: each emotion counts the same, however rare."""
        asked = self.counts.sum(axis=1)
        recalls = np.diag(self.counts)[asked > 0] / asked[asked > 0]
        return float(recalls.mean()) if recalls.size else float("nan")


def _complete(motion: Motion) -> NDArray[np.float32]:
    return motion.frames[~np.isnan(motion.frames).any(axis=1)]


def _statistics(pca: Pca, motion: Motion) -> NDArray[np.float64]:
    """[5 D] mean, deviation and quantiles over time of the components."""
    coordinates = pca.encode(torch.from_numpy(_complete(motion))).numpy().astype(np.float64)
    return np.concatenate([coordinates.mean(axis=0), coordinates.std(axis=0), *np.quantile(coordinates, QUANTILES, axis=0)])
