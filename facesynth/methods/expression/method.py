"""The expression eigenspace as a method of the zoo."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.expression import Expression as Runtime
from facesynth.inference.expression import Parts, patch_settings
from facesynth.inference.motion import Motion
from facesynth.inference.phone_context import CONTEXT, context_of
from facesynth.inference.speech import NEUTRAL, Speech
from facesynth.methods.expression.capabilities import CAPABILITIES
from facesynth.methods.expression.differences import Difference, difference_of, says_the_same, twins, whole_runs
from facesynth.methods.learn.frames import PoseSum, mean_pose
from facesynth.methods.learn.regression import Moments
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.pca import Pca

DRAWN = 0.05
"""How strongly the weights of phones are drawn to zero, as a share of the mean variance of what they weigh."""
FEWEST = 2
"""Sentences of an emotion that are needed beside their neutral twins."""


@register(CAPABILITIES)
class Expression(Method):
    """Adds expressive motion to the neutral motion of any method (Deng 2006, §5.2): what phones let expect, and variety about it.

    Parameters
    ----------
    components : float
        Of the expression eigenspace: a count, or a share of the variance.
    patch_s, boundary_s : float
        Length of a patch and of the zone in which it must fit what is there, s (30 and 5 frames of 120 Hz).
    tolerance : float
        epsilon of eq. 3.4: how far a fitting patch may lie from what is there.
    context : bool
        Whether what phones tell of a signal is learned, and only the remainder is grown; the dissertation grows all.
    variety : float
        Share of what is grown that is added; the dissertation's is 1.
    kept_s : float
        Of each emotion so many seconds, spread over the recordings, are kept to grow from; models stay small.
    """

    rest: Tensor
    """[C] mean neutral pose."""
    mean: Tensor
    """[C] the mean of all signals."""
    basis: Tensor
    """[C, D] the expression eigenspace."""
    weights: Tensor
    """[E, CONTEXT, D] of the expectation of each emotion's signals by the phones."""
    constants: Tensor
    """[E, D] the same, whatever is said."""
    signals: Tensor
    """[F, D] what recorded signals have beyond their expectation."""
    starts: Tensor
    """[R] first frame of each recording."""
    owners: Tensor
    """[R] number of each recording's emotion in `facts["expressions"]`."""

    def __init__(
        self,
        components: float = 0.995,
        patch_s: float = 0.5,
        boundary_s: float = 1 / 12,
        tolerance: float = 0.5,
        context: bool = True,
        variety: float = 0.4,
        kept_s: float = 40.0,
    ) -> None:
        super().__init__()
        if components <= 0 or not 0 < boundary_s < patch_s or min(tolerance, variety) < 0 or kept_s <= 0:
            raise FacesynthError(
                "expression wants positive components and kept_s, 0 < boundary_s < patch_s, nothing negative; got "
                + ", ".join(f"{name}={value:g}" for name, value in self.config.items())
            )
        for name in ("rest", "mean", "basis", "weights", "constants", "signals", "starts", "owners"):
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from sentences that were recorded in neutral and in an emotion; nothing is drawn from chance."""
        device = self.device
        self.learned_from(corpus)
        differences, unlike = differences_of(corpus)
        emotions, left_out = expressions_of(differences, corpus, unlike)
        learned = [d for d in differences if d.emotion in emotions]
        pca = Pca.fit(np.concatenate([run for d in learned for run in whole_runs(d.frames)]), self.config["components"])
        told = self._keep(neutral_pose(corpus), pca, emotions, learned)
        self.emotions = (NEUTRAL, *emotions)
        self.facts = {
            "expressions": list(emotions),
            "sentences": {e: len({d.sentence for d in differences if d.emotion == e}) for e in emotions},
            "variance": float(pca.variance_ratio.sum()),
            "told_by_phones": told,
            "other_phones": unlike,
            "emotions_left_out": left_out,
        }
        self.speaker().textures  # noqa: B018 - no recording may be shorter than a patch
        return self.to(device).eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """A face that feels what the speech's emotions say, and speaks not."""
        self.refuse(options)
        return self.speaker().synthesize(speech, seed=seed)

    def express(self, motion: Motion, speech: Speech, *, seed: int = 0) -> Motion:
        """A neutral motion of any method, with the speech's emotions added at their intensities."""
        return self.speaker().express(motion, speech, seed=seed)

    def speaker(self) -> Runtime:
        """The model that expresses: what an exported folder is, with this module's arrays for its graph."""
        return Runtime(
            Parts(
                layout=self.fitted_layout,
                fps=self.fps,
                emotions=tuple(self.facts["expressions"]),
                rest=self.rest.double().cpu().numpy(),
                weights=self.weights.double().cpu().numpy(),
                constants=self.constants.double().cpu().numpy(),
                signals=self.signals.double().cpu().numpy(),
                starts=self.starts.long().cpu().numpy(),
                owners=self.owners.long().cpu().numpy(),
                settings=patch_settings(self.fps, *(self.config[name] for name in ("patch_s", "boundary_s", "tolerance"))),
                variety=float(self.config["variety"]),
                decode=self.decode_array,
            )
        )

    def decode_array(self, signals: NDArray[np.float32]) -> NDArray[np.float32]:
        """Signals [..., T, D] to what they add to frames [..., T, C]."""
        added = self.mean + torch.from_numpy(signals).to(self.basis) @ self.basis.T
        return np.asarray(added.cpu().numpy())

    def _keep(self, rest: Floats, pca: Pca, emotions: tuple[str, ...], learned: list[Difference]) -> float:
        """Learn what phones tell of the signals and keep the remainders; the share of variance within emotions that is told."""
        signals = [pca.encode(torch.from_numpy(d.frames.astype(np.float32))).numpy() for d in learned]
        heard = [context_of(d.phones, len(d.frames), self.fps) for d in learned]
        owners = np.array([emotions.index(d.emotion) for d in learned])
        weights, constants = self._expectations(heard, signals, owners, len(emotions))
        rests = [s - x @ weights[k] - constants[k] for s, x, k in zip(signals, heard, owners, strict=True)]
        runs = [(k, run) for k in range(len(emotions)) for run in self._spread(rests, owners == k)]
        self.rest = torch.from_numpy(rest.astype(np.float32))
        self.mean, self.basis = pca.mean, pca.basis
        self.weights, self.constants = (torch.from_numpy(array.astype(np.float32)) for array in (weights, constants))
        self.signals = torch.from_numpy(np.concatenate([run for _, run in runs]).astype(np.float32))
        self.starts = torch.from_numpy(np.cumsum([0, *(len(run) for _, run in runs[:-1])]))
        self.owners = torch.from_numpy(np.array([owner for owner, _ in runs]))
        return _told(signals, rests, owners) if self.config["context"] else 0.0

    def _spread(self, rests: list[Floats], mine: NDArray[np.bool_]) -> list[Floats]:
        """About `kept_s` of the runs without gaps of one emotion, every so many of them."""
        runs = [run for k in np.flatnonzero(mine) for run in whole_runs(rests[k])]
        step = sum(map(len, runs)) / (self.config["kept_s"] * self.fps)
        return runs[:: max(1, int(np.ceil(step)))]

    def _expectations(
        self, heard: list[Floats], signals: list[Floats], owners: NDArray[np.int64], count: int
    ) -> tuple[Floats, Floats]:
        """Weights [E, CONTEXT, D] and constants [E, D] from contexts [T, CONTEXT] to signals [T, D]; zeros for none."""
        width = signals[0].shape[1]
        weights, constants = np.zeros((count, CONTEXT, width)), np.zeros((count, width))
        for number in range(count if self.config["context"] else 0):
            sums = Moments.zero(CONTEXT, width)
            for x, y in ((heard[k], signals[k]) for k in np.flatnonzero(owners == number)):
                whole = np.isfinite(y).all(axis=1)
                sums.add(x[whole].astype(np.float32), y[whole].astype(np.float32))
            ((weights[number], constants[number]),) = sums.solutions([DRAWN])
        return weights, constants


def _told(signals: list[Floats], rests: list[Floats], owners: NDArray[np.int64]) -> float:
    """Share of the variance of signals [T, D] within each emotion that the remainders do not have."""

    def within(tracks: list[Floats]) -> float:
        kinds = [np.concatenate([tracks[k] for k in np.flatnonzero(owners == number)]) for number in np.unique(owners)]
        return float(sum(np.nanvar(kind, axis=0).sum() * len(kind) for kind in kinds))

    return 1 - within(rests) / max(within(signals), 1e-12)


def differences_of(corpus: Corpus) -> tuple[list[Difference], int]:
    """Of all neutral recordings and their expressive twins; and how many pairs have other phones, which cannot be compared."""
    pairs = list(twins(corpus))
    alike = [(a, b) for a, b in pairs if says_the_same(a.speech.phones, b.speech.phones)]
    return [difference_of(a, b) for a, b in alike], len(pairs) - len(alike)


def expressions_of(differences: list[Difference], corpus: Corpus, unlike: int) -> tuple[tuple[str, ...], dict[str, str]]:
    """Emotions that can be learned, and why others cannot; FacesynthError where none can."""
    recorded = {record.emotion for record in corpus.usable_records}
    if NEUTRAL not in recorded:
        raise FacesynthError(f"{corpus.path} has no neutral recordings, and an expression is what an emotion adds to them")
    if recorded == {NEUTRAL}:
        raise FacesynthError(f"{corpus.path} was recorded in neutral alone; record the same sentences in another emotion too")
    left_out = {}
    for emotion in sorted(recorded - {NEUTRAL}):
        sentences = {d.sentence for d in differences if d.emotion == emotion and whole_runs(d.frames)}
        if len(sentences) < FEWEST:
            left_out[emotion] = (
                f"{emotion} has {len(sentences)} sentences that were recorded in neutral too with the same phones; "
                f"at least {FEWEST} are needed"
            )
    emotions = tuple(e for e in corpus.emotions if e in recorded - {NEUTRAL} - set(left_out))
    if not emotions:
        told = "; ".join(left_out.values()) + (f" ({unlike} pairs have other phones)" if unlike else "")
        raise FacesynthError(f"{corpus.path} teaches no expression: {told}")
    return emotions, left_out


def neutral_pose(corpus: Corpus) -> Floats:
    """[C] mean of the neutral recordings; channels that they lack have that of all."""
    poses = PoseSum(corpus.layout.channels)
    for utterance in corpus:
        if utterance.emotion == NEUTRAL:
            poses.add(utterance.motion.frames)
    return poses.mean(mean_pose(corpus))
