"""Learn from a part of the recordings, drive with the sound of the rest (Saisan 2004, §6): one table for one corpus."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.motion import Motion
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.prediction import one_step
from facesynth.methods.learn.frames import complete
from facesynth.methods.learn.regression import Moments
from facesynth.methods.registry import create

SAMPLES = 10
PENALTY = 1e-3
"""Of ridge on the system's own few features, as a share of their variance; it hardly matters."""

Frames = NDArray[np.float64]


@dataclass
class Errors:
    """Squared errors of each held-out utterance, by row of the table; all in the layout's unit."""

    whole: dict[str, list[float]] = field(default_factory=dict)
    """Mean squared error of a channel."""
    centred: dict[str, list[float]] = field(default_factory=dict)
    """The same with the utterance's own mean pose taken out of both."""
    diversity: dict[str, list[float]] = field(default_factory=dict)
    """Mean squared distance between pairs of samples."""
    ahead: dict[str, list[float]] = field(default_factory=dict)
    """One step ahead, of the system …"""
    still: dict[str, list[float]] = field(default_factory=dict)
    """… and of "no change"."""
    kurtosis: dict[str, list[float]] = field(default_factory=dict)
    """Excess kurtosis of every source of every fold."""
    chosen: dict[str, list[str]] = field(default_factory=dict)
    """Lead, orders and repairs of every fold."""

    def add(self, row: str, predicted: Frames, truth: Frames) -> None:
        """Judge one utterance [T, C]; missing samples of the truth do not count."""
        count = min(len(predicted), len(truth))
        error = predicted[:count] - truth[:count]
        self.whole.setdefault(row, []).append(float(np.nanmean(error**2)))
        self.centred.setdefault(row, []).append(float(np.nanmean((error - np.nanmean(error, axis=0)) ** 2)))

    def rows(self) -> dict[str, tuple[float, float]]:
        """Root mean square errors (whole, centred) by row."""
        return {row: (_root(self.whole[row]), _root(self.centred[row])) for row in self.whole}

    def better(self, row: str, other: str) -> float:
        """Share of held-out utterances on which a row has the smaller error."""
        return float(np.mean(np.array(self.whole[row]) < np.array(self.whole[other])))


def cross_validate(corpus: Corpus, configs: Mapping[str, Mapping[str, Any]], folds: int, seed: int = 0) -> Errors:
    """Mean shape, ridge from log-mel, and for each named config of `LDS` the system and ridge from its features."""
    errors = Errors()
    for train, test in corpus.folds(folds, seed):
        judge_fold(errors, configs, train, test, seed)
    return errors


def judge_fold(errors: Errors, configs: Mapping[str, Mapping[str, Any]], train: Corpus, test: Corpus, seed: int = 0) -> None:
    """What `cross_validate` does with one fold, added to `errors`."""
    mean, mel = create("mean_face").fit(train), create("ridge", features="log_mel").fit(train, seed=seed)
    for utterance in test:
        errors.add("mean shape", _frames(mean.synthesize(utterance.speech)), _frames(utterance.motion))
        errors.add("ridge, log-mel", _frames(mel.synthesize(utterance.speech)), _frames(utterance.motion))
    for name, config in configs.items():
        _judge(errors, name, LDS.from_config(config).fit(train, seed=seed), train, test)


def table(errors: Errors, unit: str) -> str:
    """Markdown: errors by row, then what only the systems have."""
    lines = [f"| | RMS error, {unit} | clip means removed | better than the mean shape in |", "|---|---:|---:|---:|"]
    for row, (whole, centred) in errors.rows().items():
        share = "" if row == "mean shape" else f"{errors.better(row, 'mean shape'):.0%}"
        lines.append(f"| {row} | {whole:.4g} | {centred:.4g} | {share} |")
    return "\n".join([*lines, *(_of_system(errors, name, unit) for name in errors.ahead)])


def _of_system(errors: Errors, name: str, unit: str) -> str:
    """What a system has and a regression has not."""
    kurtosis = np.array(errors.kurtosis[name])
    return (
        f"\n{name}: diversity of samples {_root(errors.diversity[name]):.4g} {unit};"
        f" one step ahead {_root(errors.ahead[name]):.4g}, no change {_root(errors.still[name]):.4g};"
        f" excess kurtosis of the noise {kurtosis.min():.1f} to {kurtosis.max():.1f}, median {np.median(kurtosis):.1f};"
        f" chosen: {'; '.join(errors.chosen[name])}."
    )


def _judge(errors: Errors, name: str, model: LDS, train: Corpus, test: Corpus) -> None:
    linear = _ridge(model, train)
    facts = model.facts
    errors.kurtosis.setdefault(name, []).extend(facts["kurtosis"])
    repaired = f", {len(facts['repaired'])} eigenvalues repaired" if facts["repaired"] else ""
    errors.chosen.setdefault(name, []).append(
        f"lead {facts['lead_ms']['chosen']:g} ms, states {facts['deterministic_order']['chosen']:g}"
        f" + {facts['stochastic_order']['chosen']:g}{repaired}"
    )
    for utterance in test:
        truth = _frames(utterance.motion)
        samples = [_frames(model.synthesize(utterance.speech, seed=seed)) for seed in range(SAMPLES)]
        errors.add(name, _frames(model.synthesize(utterance.speech, noise=0)), truth)
        errors.add(f"{name}, one sample", samples[0], truth)
        errors.add(f"{name}, mean of {SAMPLES}", np.mean(samples, axis=0), truth)
        errors.add(f"{name}, best of {SAMPLES}", min(samples, key=lambda sample: _distance(sample, truth)), truth)
        errors.add(f"ridge, features of {name}", linear(utterance), truth)
        pairs = [_distance(one, other) for i, one in enumerate(samples) for other in samples[:i]]
        errors.diversity.setdefault(name, []).append(float(np.mean(pairs)))
        if np.isfinite(truth).all():
            ahead, still = one_step(model, utterance.speech, truth)
            errors.ahead.setdefault(name, []).append(ahead)
            errors.still.setdefault(name, []).append(still)


def _ridge(model: LDS, train: Corpus) -> Callable[[Utterance], Frames]:
    """Linear regression from the system's features of a frame to the frame."""
    moments = Moments.zero(model.settings.features, train.layout.channels)
    for utterance in train:
        present = complete(utterance.motion.frames)
        heard = model.encode(utterance.speech, len(utterance.motion)).cpu().numpy()
        moments.add(heard[present], utterance.motion.frames[present])
    weights, bias = moments.solutions([PENALTY])[0]
    return lambda utterance: model.encode(utterance.speech, len(utterance.motion)).double().cpu().numpy() @ weights + bias


def _frames(motion: Motion) -> Frames:
    return motion.frames.astype(np.float64)


def _distance(one: Frames, other: Frames) -> float:
    count = min(len(one), len(other))
    return float(np.nanmean((one[:count] - other[:count]) ** 2))


def _root(values: list[float]) -> float:
    return float(np.sqrt(np.mean(values)))
