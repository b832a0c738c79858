"""How well emotion maps do on sentences they did not see, and how many parallel sentences they need."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.closures import keep_shut
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.mapping import (
    WIDTHS,
    EmotionMap,
    MapSettings,
    fit_emotion_map,
    matched,
    require_pairs,
    require_sentences,
)
from facesynth.methods.anime_graph.parallel import Take, aligned, emotion_pairs
from facesynth.methods.anime_graph.split import Split, split_components
from facesynth.motion.rbf import KERNELS
from facesynth.progress import track


@dataclass(frozen=True)
class MapScore:
    """Unit-cube RMS to the recorded target emotion, mean over left-out sentences; lower is better."""

    source: str
    target: str
    sentences: int
    """Sentences recorded in both emotions; each was left out once, or with others of its fold."""
    unchanged: float
    mean_difference: float
    """The mean difference of the two emotions added to every frame, lips kept shut as by a map."""
    mapped: dict[str, float]
    """By kernel and width."""

    @property
    def best(self) -> str:
        """The kernel and width with the least error."""
        return min(self.mapped, key=lambda name: self.mapped[name])

    def helps(self, name: str) -> bool:
        """Whether mapping with this kernel and width comes nearer than both doing nothing and the mean difference."""
        return self.mapped[name] < min(self.unchanged, self.mean_difference)


@dataclass(frozen=True, eq=False)
class Learned:
    """What a trial learned of takes without some sentences."""

    components: FaceComponents
    split: Split
    takes: Sequence[Take]
    """The takes that are judged, left-out sentences too, in those components."""


Learner = Callable[[Sequence[Take]], tuple[FaceComponents, Split]]
"""From takes to components and split."""


def learner(layout: Layout, *, variance: float, override: Sequence[int] | None = None, seed: int = 0) -> Learner:
    """Learns components and split as the anime graph does."""

    def learn(takes: Sequence[Take]) -> tuple[FaceComponents, Split]:
        components = FaceComponents().fit(np.concatenate([t.frames for t in takes]), layout, variance=variance, seed=seed)
        return components, split_components(_encoded(takes, components), components, layout, override, seed=seed)

    return learn


def _encoded(takes: Sequence[Take], components: FaceComponents) -> Sequence[Take]:
    return [replace(take, components=components.encode_array(take.frames)) for take in takes]


ALL_KINDS = tuple(f"{kernel} {width}" for kernel in KERNELS for width in WIDTHS)


@dataclass(frozen=True, eq=False)
class MapTrial:
    """What maps are judged with: recordings, and how components and split are learned.

    A sentence that is left out is left out of everything: components and split are learned again without it.
    """

    takes: Sequence[Take]
    layout: Layout
    learn: Learner
    centres: int = 250
    kinds: Sequence[str] = ALL_KINDS
    """Kernels and widths that are judged."""
    judged: frozenset[str] | None = None
    """Sentences that are mapped and that maps are learned from; None: all."""
    _known: dict[frozenset[str], Learned] = field(default_factory=dict)

    def without(self, left_out: Iterable[str] = ()) -> Learned:
        """Components and split learned from all takes but those of some sentences, once."""
        key = frozenset(left_out)
        if key not in self._known:
            components, split = self.learn([take for take in self.takes if take.sentence not in key])
            asked = [take for take in self.takes if self.judged is None or take.sentence in self.judged]
            self._known[key] = Learned(components, split, _encoded(asked, components))
        return self._known[key]

    def score(self, source: str, target: str, *, folds: int | None = None, seed: int = 0) -> MapScore:
        """Leave sentences out, one by one or in so many `folds`, and map them by what the others teach."""
        sentences = self._sentences(source, target)
        folds = min(folds or len(sentences), len(sentences))
        errors: dict[str, list[float]] = {}
        for fold in track(range(folds), f"{source} to {target}"):
            left_out = set(sentences[fold::folds])
            learned = self.without(left_out)
            require_pairs(learned.split, len(sentences), source, target)
            pairs = emotion_pairs(learned.takes, source, target)
            known = [pair for pair in pairs if pair[0].sentence not in left_out]
            maps = self._maps(learned, known, seed)
            mean = self._mean_difference(learned, known)
            for pair in pairs:
                if pair[0].sentence in left_out:
                    for name, error in self._errors(learned, pair, maps, mean).items():
                        errors.setdefault(name, []).append(error)
        means = {name: float(np.mean(values)) for name, values in errors.items()}
        unchanged, mean_difference = means.pop("unchanged"), means.pop("mean difference")
        return MapScore(source, target, len(sentences), unchanged, mean_difference, means)

    def learning_curve(
        self, source: str, target: str, settings: MapSettings, counts: Sequence[int] = (1, 2, 3, 5, 10, 15, 30), *, seed: int = 0
    ) -> dict[int, float]:
        """Unit-cube RMS on the last fifth of the sentences by the number of others learned from."""
        sentences = np.random.default_rng(seed).permutation(self._sentences(source, target)).tolist()
        asked = set(sentences[-max(1, len(sentences) // 5) :])
        learned = self.without(asked)
        require_pairs(learned.split, len(sentences), source, target)
        pairs = emotion_pairs(learned.takes, source, target)
        curve = {}
        for count in (c for c in counts if c <= len(sentences) - len(asked)):
            # One sentence cannot be left out of itself: its map takes the median width.
            fitting = settings if count > 1 else replace(settings, width="median")
            known = matched([pair for pair in pairs if pair[0].sentence in sentences[:count]], learned.split)
            fitted = fit_emotion_map(known, learned.split, fitting, learned.components.mixing.numpy(), seed=seed)
            errors = [self._error(learned, pair, fitted) for pair in pairs if pair[0].sentence in asked]
            curve[count] = float(np.mean(errors))
        return curve

    def left_out(self, source: str, target: str, name: str, *, seed: int = 0) -> tuple[Floats, Floats, Floats]:
        """[T, C] the first sentence in the source emotion, recorded in the target, and mapped by what the others teach.

        name: kernel and width, as in `MapScore.mapped`.
        """
        first, *_ = self._sentences(source, target)
        learned = self.without({first})
        require_pairs(learned.split, len(self._sentences(source, target)), source, target)
        pairs = emotion_pairs(learned.takes, source, target)
        known = [pair for pair in pairs if pair[0].sentence != first]
        a, b = next(pair for pair in pairs if pair[0].sentence == first)
        fitted = replace(self, kinds=(name,))._maps(learned, known, seed)[name]
        return a.frames.astype(np.float64), _truth(learned, a, b), self.mapped(learned, a, fitted)

    def with_sentences(self, most: int) -> "MapTrial":
        """The same with at most so many sentences, those that were recorded in the most emotions."""
        emotions: dict[str, set[str]] = {}
        for take in self.takes:
            emotions.setdefault(take.sentence, set()).add(take.emotion)
        kept = sorted(emotions, key=lambda sentence: (-len(emotions[sentence]), sentence))[:most]
        return replace(self, judged=frozenset(kept), _known={})

    def _sentences(self, source: str, target: str) -> list[str]:
        asked = [take for take in self.takes if self.judged is None or take.sentence in self.judged]
        sentences = sorted({a.sentence for a, _ in emotion_pairs(asked, source, target)})
        require_sentences(len(sentences), source, target)
        return sentences

    def _maps(self, learned: Learned, known: Sequence[tuple[Take, Take]], seed: int) -> dict[str, EmotionMap]:
        """By kernel and width."""
        samples, mixing = matched(known, learned.split), learned.components.mixing.numpy()
        named = {f"{kernel} {width}": MapSettings(width, kernel, self.centres) for kernel in KERNELS for width in WIDTHS}
        return {name: fit_emotion_map(samples, learned.split, named[name], mixing, seed=seed) for name in self.kinds}

    def _mean_difference(self, learned: Learned, known: Sequence[tuple[Take, Take]]) -> Floats:
        return np.concatenate([_truth(learned, a, b) - a.frames for a, b in known]).mean(axis=0)

    def _errors(
        self, learned: Learned, pair: tuple[Take, Take], maps: Mapping[str, EmotionMap], mean: Floats
    ) -> dict[str, float]:
        a, b = pair
        truth = _truth(learned, a, b)
        frames = a.frames.astype(np.float64)
        plain = {"unchanged": frames, "mean difference": keep_shut(frames + mean, frames, self.layout, a.fps)}
        errors = {name: unit_cube_rms(guess, truth, self.layout) for name, guess in plain.items()}
        return errors | {name: self._error(learned, pair, fitted) for name, fitted in maps.items()}

    def _error(self, learned: Learned, pair: tuple[Take, Take], fitted: EmotionMap) -> float:
        return unit_cube_rms(self.mapped(learned, pair[0], fitted), _truth(learned, *pair), self.layout)

    def mapped(self, learned: Learned, take: Take, fitted: EmotionMap) -> Floats:
        """[T, C] a recording, mapped."""
        import torch

        change = np.tile(fitted.shift, (len(take.components), 1))
        emotional = learned.split.emotional
        change[:, emotional] += fitted.rbf(torch.from_numpy(take.components[:, emotional])).numpy()
        moved = take.frames + change @ learned.components.mixing.numpy().T + fitted.dropped
        return keep_shut(moved, take.frames.astype(np.float64), self.layout, take.fps)


def _truth(learned: Learned, a: Take, b: Take) -> Floats:
    """[T, C] what was recorded in the other emotion when the same was said."""
    return b.frames[aligned(a, b, learned.split.speech)].astype(np.float64)


def unit_cube_rms(first: NDArray, second: NDArray, layout: Layout) -> float:
    """RMS over coordinates of each frame, mean over frames [T, C], both scaled together into the unit cube (§5.2).

    Curves, which have no extent in space, are not scaled.
    """
    if len(first) != len(second):
        raise FacesynthError(f"motions of equal length are compared; got {len(first)} and {len(second)} frames")
    scale = 1.0
    if layout.dimension > 1:
        points = layout.points(np.concatenate([first, second])).reshape(-1, layout.dimension)
        scale = float(np.ptp(points, axis=0).max())
    return float(np.sqrt(np.square(first - second).mean(axis=1)).mean() / scale)
