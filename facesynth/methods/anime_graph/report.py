"""How well emotion maps do on sentences they did not see, and how many parallel sentences they need."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from facesynth.inference.arrays import Floats
from facesynth.inference.closures import keep_shut
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.mapping import (
    WIDTHS,
    MapLearner,
    MapSettings,
    Samples,
    dropped_shift,
    fit_map,
    lasting_shift,
    matched,
    require_pairs,
)
from facesynth.methods.anime_graph.parallel import Take, aligned, emotion_pairs
from facesynth.methods.anime_graph.split import Split
from facesynth.motion.rbf import KERNELS, RbfMap
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
    """The mean difference of the two emotions added to every frame."""
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
class MapTrial:
    """What maps are judged with: recordings, their components and split."""

    takes: Sequence[Take]
    split: Split
    components: FaceComponents
    layout: Layout
    centres: int = 250

    @threadpool_limits.wrap(limits=1)  # as for learning maps
    def score(self, source: str, target: str, *, folds: int | None = None, seed: int = 0) -> MapScore:
        """Leave sentences out, one by one or in so many `folds`, and map them by what the others teach."""
        pairs, samples = self._pairs(source, target)
        sentences = sorted({a.sentence for a, _ in pairs})
        folds = min(folds or len(sentences), len(sentences))
        errors: dict[str, list[float]] = {}
        for fold in track(range(folds), f"{source} to {target}"):
            left_out = set(sentences[fold::folds])
            known = [s for s in samples if s.sentence not in left_out]
            learner = MapLearner(known, self.centres, seed=seed)
            maps = {f"{kernel} {width}": learner.fit(width, kernel) for kernel in KERNELS for width in WIDTHS}
            shifts = self._shifts(known)
            mean = self._mean_difference([p for p in pairs if p[0].sentence not in left_out])
            for pair in pairs:
                if pair[0].sentence in left_out:
                    for name, error in self._errors(pair, maps, shifts, mean).items():
                        errors.setdefault(name, []).append(error)
        means = {name: float(np.mean(values)) for name, values in errors.items()}
        unchanged, mean_difference = means.pop("unchanged"), means.pop("mean difference")
        return MapScore(source, target, len(sentences), unchanged, mean_difference, means)

    def learning_curve(
        self, source: str, target: str, settings: MapSettings, counts: Sequence[int] = (1, 2, 3, 5, 10, 15, 30), *, seed: int = 0
    ) -> dict[int, float]:
        """Unit-cube RMS on the last fifth of the sentences by the number of others learned from."""
        pairs, samples = self._pairs(source, target)
        sentences = np.random.default_rng(seed).permutation(sorted({a.sentence for a, _ in pairs})).tolist()
        asked = set(sentences[-max(1, len(sentences) // 5) :])
        curve = {}
        for count in (c for c in counts if c <= len(sentences) - len(asked)):
            learned = set(sentences[:count])
            # One sentence cannot be left out of itself: its map takes the median width.
            fitting = settings if count > 1 else replace(settings, width="median")
            known = [s for s in samples if s.sentence in learned]
            rbf, shifts = fit_map(known, fitting, seed=seed), self._shifts(known)
            errors = [self._errors(p, {"map": rbf}, shifts, np.zeros(1))["map"] for p in pairs if p[0].sentence in asked]
            curve[count] = float(np.mean(errors))
        return curve

    def left_out(self, source: str, target: str, name: str, *, seed: int = 0) -> tuple[Floats, Floats, Floats]:
        """[T, C] the first sentence in the source emotion, recorded in the target, and mapped by what the others teach.

        name: kernel and width, as in `MapScore.mapped`.
        """
        pairs, samples = self._pairs(source, target)
        a, b = pairs[0]
        known = [s for s in samples if s.sentence != a.sentence]
        kernel, width = next((k, w) for k in KERNELS for w in WIDTHS if f"{k} {w}" == name)
        rbf = MapLearner(known, self.centres, seed=seed).fit(width, kernel)
        truth = b.frames[aligned(a, b, self.split.speech)]
        return a.frames.astype(np.float64), truth.astype(np.float64), self.mapped(a, rbf, *self._shifts(known))

    def with_sentences(self, most: int) -> "MapTrial":
        """The same with at most so many sentences, those that were recorded in the most emotions."""
        emotions: dict[str, set[str]] = {}
        for take in self.takes:
            emotions.setdefault(take.sentence, set()).add(take.emotion)
        kept = sorted(emotions, key=lambda sentence: (-len(emotions[sentence]), sentence))[:most]
        return replace(self, takes=[take for take in self.takes if take.sentence in kept])

    def _pairs(self, source: str, target: str) -> tuple[list[tuple[Take, Take]], list[Samples]]:
        pairs = emotion_pairs(self.takes, source, target)
        require_pairs(self.split, len({a.sentence for a, _ in pairs}), source, target)
        return pairs, matched(self.takes, self.split, source, target)

    def _mean_difference(self, pairs: Sequence[tuple[Take, Take]]) -> Floats:
        differences = [b.frames[aligned(a, b, self.split.speech)] - a.frames for a, b in pairs]
        return np.concatenate(differences).mean(axis=0, dtype=np.float64)

    def _errors(
        self, pair: tuple[Take, Take], maps: dict[str, RbfMap], shifts: tuple[Floats, Floats], mean: Floats
    ) -> dict[str, float]:
        a, b = pair
        truth = b.frames[aligned(a, b, self.split.speech)]
        guesses = {name: self.mapped(a, rbf, *shifts) for name, rbf in maps.items()}
        guesses |= {"unchanged": a.frames.astype(np.float64), "mean difference": a.frames + mean}
        return {name: unit_cube_rms(guess, truth, self.layout) for name, guess in guesses.items()}

    def _shifts(self, known: Sequence[Samples]) -> tuple[Floats, Floats]:
        return lasting_shift(known, self.split.emotional), dropped_shift(known, self.components.mixing.numpy())

    def mapped(self, take: Take, rbf: RbfMap, shift: Floats, dropped: Floats) -> Floats:
        """[T, C] a recording, mapped."""
        import torch

        change = np.tile(shift, (len(take.components), 1))
        change[:, self.split.emotional] = rbf(torch.from_numpy(take.components[:, self.split.emotional])).numpy()
        moved = take.frames + change @ self.components.mixing.numpy().T + dropped
        return keep_shut(moved, take.frames.astype(np.float64), self.layout)


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
