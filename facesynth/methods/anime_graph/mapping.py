"""Learning emotion maps from parallel sentences (Cao 2005, §5.2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
import torch

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.anime_graph.parallel import Take, aligned
from facesynth.methods.anime_graph.split import Split
from facesynth.motion.rbf import KERNELS, Kernel, RbfMap, closest_distance, cluster_means, median_distance

Width = Literal["closest", "median", "cross-validated"]
WIDTHS: tuple[Width, ...] = ("closest", "median", "cross-validated")
FEWEST_SENTENCES = 3
"""Parallel sentences without which a map is not learned (the paper had ten)."""
MOST_SAMPLES = 6000
"""Neighbouring frames repeat each other: of more aligned frames than this, evenly spaced ones are clustered."""
WIDTH_FACTORS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Widths that cross-validation tries, in median distances of the centres."""
RIDGES = (1e-6, 1e-3, 1e-1, 10.0)
"""Ridges that it tries with each: recordings of one sentence differ from take to take, which is noise to a map."""
FOLDS = 4


@dataclass(frozen=True)
class MapSettings:
    """How a map is fitted."""

    width: Width = "cross-validated"
    kernel: Kernel = "exponential"
    centres: int = 250

    def __post_init__(self) -> None:
        if self.width not in WIDTHS:
            raise unknown("width", self.width, WIDTHS)
        if self.kernel not in KERNELS:
            raise unknown("kernel", self.kernel, KERNELS)
        if self.centres < 1:
            raise FacesynthError(f"a map needs at least one centre; got {self.centres}")


@dataclass(frozen=True, eq=False)
class Samples:
    """Frames of one sentence in two emotions, matched by what is said."""

    source: Floats
    """[T, E] emotional components in the first emotion."""
    target: Floats
    """[T, E] in the second."""
    shift: Floats
    """[D] mean difference of all components."""
    frame_shift: Floats
    """[C] mean difference of the frames."""
    sentence: str


def matched(pairs: Sequence[tuple[Take, Take]], split: Split) -> list[Samples]:
    """Matched emotional components of pairs of takes; aligned by the speech components alone."""
    return [_matched(a, b, split) for a, b in pairs]


def _matched(a: Take, b: Take, split: Split) -> Samples:
    path = aligned(a, b, split.speech)
    there = b.components[path]
    shift = (there - a.components).mean(axis=0)
    frame_shift = (b.frames[path] - a.frames).mean(axis=0, dtype=np.float64)
    return Samples(a.components[:, split.emotional], there[:, split.emotional], shift, frame_shift, a.sentence)


def require_pairs(split: Split, sentences: int, source: str, target: str) -> None:
    """FacesynthError where a map from one emotion to another cannot be learned."""
    require_sentences(sentences, source, target)
    if not len(split.emotional):
        raise FacesynthError(
            f"mapping {source} to {target} is impossible: no component of this corpus' motion changes with emotion more than "
            "chance would have it; name some with `emotional_components`"
        )


def require_sentences(sentences: int, source: str, target: str) -> None:
    """FacesynthError where too few sentences were recorded in both emotions."""
    if sentences < FEWEST_SENTENCES:
        raise FacesynthError(
            f"mapping {source} to {target} needs at least {FEWEST_SENTENCES} sentences recorded in both (ten are good); "
            f"the corpus has {sentences}"
        )


def fit_map(samples: Sequence[Samples], settings: MapSettings, *, seed: int = 0) -> RbfMap:
    """The displacement `e_j - e_i` as a function of e_i, through K-means centres (eq. 10)."""
    return MapLearner(samples, settings.centres, seed=seed).fit(settings.width, settings.kernel)


class MapLearner:
    """Matched sentences, clustered once, from which maps of any width and kernel are fitted."""

    def __init__(self, samples: Sequence[Samples], centres: int, *, seed: int = 0) -> None:
        self.samples, self.centres, self.seed = samples, centres, seed
        self.x, shift = _stacked(samples)
        self.at, self.values = cluster_means(self.x, shift, centres, seed=seed)

    def fit(self, width: Width, kernel: Kernel) -> RbfMap:
        """A map; `width` says how its kernels' reach is found."""
        if width == "closest":
            # The kernels as printed, exp(-x/d) and exp(-x²/d), d the distance of the two closest samples.
            d = closest_distance(self.x)
            return RbfMap.fit(self.at, self.values, width=d if kernel == "exponential" else float(np.sqrt(d)), kernel=kernel)
        median = median_distance(self.at)
        if width == "median":
            return RbfMap.fit(self.at, self.values, width=median, kernel=kernel)
        factor, ridge = self._cross_validated(kernel)
        return RbfMap.fit(self.at, self.values, width=factor * median, kernel=kernel, ridge=ridge)

    def _cross_validated(self, kernel: Kernel) -> tuple[float, float]:
        """Width factor and ridge with the least squared error on sentences left out."""
        error = dict.fromkeys(product(WIDTH_FACTORS, RIDGES), 0.0)
        for learner, asked, wanted in self._folds:
            median = median_distance(learner.at)
            for factor, ridge in error:
                rbf = RbfMap.fit(learner.at, learner.values, width=factor * median, kernel=kernel, ridge=ridge)
                error[factor, ridge] += float(np.square(rbf(torch.from_numpy(asked)).numpy() - wanted).sum())
        return min(error, key=lambda key: error[key])

    @cached_property
    def _folds(self) -> "list[tuple[MapLearner, Floats, Floats]]":
        """Learners of most sentences, with what the others ask and want of them."""
        sentences = sorted({s.sentence for s in self.samples})
        folds = []
        for fold in range(min(FOLDS, len(sentences))):
            left_out = set(sentences[fold::FOLDS])
            learner = MapLearner([s for s in self.samples if s.sentence not in left_out], self.centres, seed=self.seed)
            folds.append((learner, *_stacked([s for s in self.samples if s.sentence in left_out])))
        return folds


def lasting_shift(samples: Sequence[Samples], split: Split) -> Floats:
    """[D] by how much an emotion shifts the components on average; 0 for those that a map changes instead.

    The paper copies the speech components. Emotions shift them a little all the same (a smile widens the mouth in
    every vowel), and copying them lost to adding the mean difference of two emotions. Where speech and emotion are mixed,
    all components are shifted, and a map adds what depends on the pose: far from all that it knows it is then the mean
    difference, and no pose of speech is taken for one of an emotion.
    """
    shift = _average(samples, "shift")
    if not split.mixed:
        shift[split.emotional] = 0.0
    return shift


def _beside_shift(samples: Sequence[Samples], split: Split) -> Sequence[Samples]:
    """What a map is to learn beside the lasting shift: all of the emotional components' difference, or where they are mixed
    what is left of it, of each by its weight.
    """
    shift = lasting_shift(samples, split)[split.emotional]
    return [replace(s, target=s.source + split.weights * (s.target - s.source - shift)) for s in samples]


class EmotionMap(NamedTuple):
    """A map from one emotion to another."""

    rbf: RbfMap
    """Displacement of the emotional components, as a function of them."""
    shift: Floats
    """[D] what is added to all components beside."""
    dropped: Floats
    """[C] what is added to the frame outside of them."""


def fit_emotion_map(
    samples: Sequence[Samples], split: Split, settings: MapSettings, mixing: Floats, *, seed: int = 0
) -> EmotionMap:
    """The map that matched sentences teach; mixing [C, D] says what each component does."""
    rbf = fit_map(_beside_shift(samples, split), settings, seed=seed)
    return EmotionMap(rbf, lasting_shift(samples, split), dropped_shift(samples, mixing))


def dropped_shift(samples: Sequence[Samples], mixing: Floats) -> Floats:
    """[C] by how much an emotion shifts what the components do not hold."""
    return _average(samples, "frame_shift") - mixing @ _average(samples, "shift")


def _average(samples: Sequence[Samples], name: str) -> Floats:
    return np.average([getattr(s, name) for s in samples], axis=0, weights=[len(s.source) for s in samples])


def _stacked(samples: Sequence[Samples]) -> tuple[Floats, Floats]:
    x, y = (np.concatenate([getattr(s, side) for s in samples]) for side in ("source", "target"))
    step = max(1, -(-len(x) // MOST_SAMPLES))
    return x[::step], (y - x)[::step]
