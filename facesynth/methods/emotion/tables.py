"""How well emotions are recognised: Cao 2005, Table I, and what it does not show."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.detector import Clip, DetectorSettings, EmotionDetector, by_speaker
from facesynth.methods.emotion.pairwise import Kernel
from facesynth.progress import track

Split = Literal["train = test", "random halves", "by sentence", "by speaker"]
SPLITS: tuple[Split, ...] = ("train = test", "random halves", "by sentence", "by speaker")
MOST_FOLDS = 10
COEFFICIENTS = (50, 100, 500, 1000)


@dataclass(frozen=True, eq=False)
class Recognition:
    """What became of every recording that was tested."""

    split: Split
    settings: DetectorSettings
    emotions: tuple[str, ...]
    confusion: NDArray[np.int64]
    """[K, K] rows: emotion as recorded; columns: as recognised."""

    @property
    def accuracy(self) -> float:
        """Share of recordings recognised."""
        return float(np.trace(self.confusion) / self.confusion.sum())

    @property
    def unweighted_recall(self) -> float:
        """Share recognised of each emotion, averaged over the emotions that were tested."""
        tested = self.confusion.sum(axis=1)
        return float((np.diag(self.confusion)[tested > 0] / tested[tested > 0]).mean())


def recognise(
    clips: Sequence[Clip], settings: DetectorSettings, split: Split, *, x: NDArray[np.float64] | None = None, seed: int = 0
) -> Recognition:
    """Train and test under one split; x [N, F]: features of the clips, if they are known.

    `by sentence` and `by speaker` leave each one out in turn, of more than 10 some together; of the halves, the first
    trains and the second tests.
    With `settings.normalise` each tested speaker is normalised by all of that speaker's recordings.
    """
    x = EmotionDetector(settings).features_of(clips) if x is None else x
    emotions = np.array([clip.emotion for clip in clips])
    names = tuple(sorted(set(emotions.tolist())))
    confusion = np.zeros((len(names), len(names)), np.int64)
    for train, test in _splits(clips, split, seed):
        detector = EmotionDetector(settings).fit_features(x[train], [clips[i] for i in train])
        asked = by_speaker(x, np.array([c.speaker for c in clips]))[test] if settings.normalise else x[test]
        for truth, decision in zip(emotions[test], detector.decide(asked), strict=True):
            confusion[names.index(truth), names.index(decision)] += 1
    return Recognition(split, settings, names, confusion)


def table_one(clips: Sequence[Clip], splits: Sequence[Split] = SPLITS[:3]) -> list[Recognition]:
    """The paper's features with 50 to 1000 coefficients, linear and radial kernel, under each split."""
    plain = DetectorSettings(features="paper", coefficients=max(COEFFICIENTS), classifier="svm", cost=1.0)
    x = EmotionDetector(plain).features_of(clips)
    kernels: tuple[Kernel, ...] = ("linear", "radial")
    rows = [(split, count, kernel) for split in splits for kernel in kernels for count in COEFFICIENTS]
    return [
        recognise(clips, replace(plain, coefficients=count, kernel=kernel), split, x=x[:, : 3 + count])
        for split, count, kernel in track(rows, "table I")
    ]


def _splits(clips: Sequence[Clip], split: Split, seed: int) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    everything = np.arange(len(clips))
    if split == "train = test":
        yield everything, everything
    elif split == "random halves":
        shuffled = np.random.default_rng(seed).permutation(len(clips))
        yield shuffled[: len(clips) // 2], shuffled[len(clips) // 2 :]
    else:
        groups = np.array([clip.sentence if split == "by sentence" else clip.speaker for clip in clips])
        if len(set(groups.tolist())) < 2:
            raise FacesynthError(f"a split {split} needs at least two; got {groups[0]!r} only")
        names = np.unique(groups)
        for left_out in np.array_split(names, min(len(names), MOST_FOLDS)):
            inside = np.isin(groups, left_out)
            yield everything[~inside], everything[inside]
