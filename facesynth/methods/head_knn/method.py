"""The nearest recorded head movements as a method of the zoo."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.keys import HeadKeys
from facesynth.inference.head.knn import HeadKnn, HeadKnnStream, KnnSettings, Recorded
from facesynth.inference.head.search import Candidates, Scales
from facesynth.inference.head.voice import FEATURES, voice_features
from facesynth.inference.motion import Motion
from facesynth.inference.pitch import RATE
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.methods.head_knn.capabilities import CAPABILITIES
from facesynth.methods.head_knn.weights import Segment, search_weights
from facesynth.methods.learn.heads import about_mean, mean_head, poses_of, sound_windows, still_face, with_head
from facesynth.methods.method import Method
from facesynth.methods.parts import part
from facesynth.methods.registry import register

SMALLEST = 1e-6
"""Standard deviation of a channel that does not move."""


@register(CAPABILITIES)
class HeadKnnMethod(Method):
    """Recorded head movements whose sound is near, smoothly joined and on the way to key poses (Deng 2006, §4.3).

    There is one entry in the database for each recorded frame; a window of 30 ms is centred on it, which at 120 frames per
    second is the dissertation's hop of 8.4 ms.

    Parameters
    ----------
    components : int
        Of the 31 features.
    scaled : bool
        Whether features are divided by their standard deviations first; the dissertation's are not, and formants rule.
    neighbours : int
        K.
    near, rough, away : float
        Wn, Wr and Wa; all 0 lets them be searched on recordings left out (eq. 4.12 to 4.14).
    starts : int
        Random places from which weights are searched.
    validation : int
        So many recordings are left out for the search, and at most a third.
    beam : int
        Paths kept for each candidate; 1 is the dissertation's.
    entries : int
        Most recorded frames that are kept; more are thinned evenly.
    """

    frame: Tensor
    """[C] the face at rest."""
    feature_mean: Tensor
    """[31]"""
    feature_basis: Tensor
    """[31, D] from features to coefficients in their common standard deviation."""
    coefficients: Tensor
    moves: Tensor
    rest: Tensor
    move_scale: Tensor
    pose_scale: Tensor
    """See `Recorded`."""
    weights: Tensor
    """[3] Wn, Wr, Wa."""

    def __init__(
        self,
        components: int = 4,
        scaled: bool = True,
        neighbours: int = 7,
        near: float = 0.0,
        rough: float = 0.0,
        away: float = 0.0,
        starts: int = 20,
        validation: int = 8,
        beam: int = 1,
        entries: int = 40000,
    ) -> None:
        super().__init__()
        counts = {"neighbours": neighbours, "starts": starts, "validation": validation, "beam": beam, "entries": entries}
        if not 1 <= components <= FEATURES or min(counts.values()) < 1 or min(near, rough, away) < 0:
            given = ", ".join(f"{name}={value}" for name, value in self.config.items())
            raise FacesynthError(
                f"head_knn wants 1 to {FEATURES} components, counts of 1 or more and no negative weight; got {given}"
            )
        names = ("frame", "feature_mean", "feature_basis", "coefficients", "moves", "rest", "move_scale", "pose_scale", "weights")
        for name in names:
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the recordings in which the head's pose is known; FacesynthError for fewer than two."""
        self.learned_from(corpus)
        recordings = with_head(corpus)
        entry_of = self._learn_database(recordings, still_face(corpus))
        given = [self.config[name] for name in ("near", "rough", "away")]
        if any(given):
            self._keep("weights", np.array(given) / sum(given))
            return self.eval()
        rng = np.random.default_rng(seed)
        left_out = self._validation(recordings, rng)
        others = np.flatnonzero(~np.isin(entry_of, left_out))
        if len(others) < self.config["neighbours"]:
            raise FacesynthError(
                f"{len(others)} recorded frames are too few for {self.config['neighbours']} neighbours: record more"
            )
        model = self._speaker(np.full(3, 1 / 3), others)
        segments = [segment_of(model, recordings[i]) for i in left_out]
        found = search_weights(segments, model.recorded.scales, self.config["beam"], self.config["starts"], rng)
        self._keep("weights", found.weights)
        self.facts |= {"validation_error": found.error, "validated_on": [recordings[i].id for i in left_out]}
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, head_keys: HeadKeys | None = None, **options: Any) -> Motion:
        """Head motion from the sound, through key poses where some are given; nothing is random."""
        self.refuse(options)
        return self.speaker().synthesize(speech, seed=seed, head_keys=head_keys)

    def stream(
        self, *, look_ahead_s: float = 0.25, keys: HeadKeys | None = None, sample_rate: int | None = None
    ) -> HeadKnnStream:
        """Sound in pieces, poses out; see `HeadKnn.stream`."""
        return self.speaker().stream(look_ahead_s=look_ahead_s, keys=keys, sample_rate=sample_rate)

    def speaker(self) -> HeadKnn:
        """What runs without torch."""
        return self._speaker(self.weights.cpu().numpy().astype(np.float64), slice(None))

    def project(self, features: Tensor) -> list[Tensor]:
        """Features [..., 31] to coefficients [..., D] (eq. 4.1)."""
        return [(features - self.feature_mean) @ self.feature_basis]

    def _speaker(self, weights: Floats, entries: Any) -> HeadKnn:
        arrays = {name: getattr(self, name).cpu().numpy().astype(np.float64) for name in ("coefficients", "moves", "rest")}
        scales = Scales(self.move_scale.cpu().numpy().astype(np.float64), self.pose_scale.cpu().numpy().astype(np.float64))
        return HeadKnn(
            self.fitted_layout,
            self.frame.cpu().numpy(),
            self.fps,
            self.emotions,
            KnnSettings(
                self.config["neighbours"], (float(weights[0]), float(weights[1]), float(weights[2])), self.config["beam"]
            ),
            Recorded(arrays["coefficients"][entries], arrays["moves"][entries], arrays["rest"], scales, self.facts["pitch_hz"]),
            part(self.project, self.weights.device),
        )

    def _learn_database(self, recordings: list[Utterance], frame: NDArray[np.float32]) -> Ints:
        """[N] which recording each entry is of."""
        heard = [_features(u)[1:] for u in recordings]
        features = np.concatenate(heard)
        if np.isnan(features[:, 0]).all():
            raise FacesynthError("no voice is heard in the recordings; head motion is learned from speech")
        pitch_hz = float(np.nanmedian(features[:, 0]))
        features[np.isnan(features[:, 0]), 0] = pitch_hz
        mean, basis, share = _principal(features, self.config["components"], scaled=self.config["scaled"])
        coefficients = (features - mean) @ basis
        spread = max(float(np.sqrt(np.square(coefficients).sum(axis=1).mean())), SMALLEST)
        poses = [poses_of(u) for u in recordings]
        moves = np.concatenate([np.diff(p, axis=0) for p in poses])
        kept = np.linspace(0, len(moves) - 1, min(self.config["entries"], len(moves))).round().astype(np.int64)
        arrays = {
            "frame": frame,
            "feature_mean": mean,
            "feature_basis": basis / spread,
            "coefficients": coefficients[kept] / spread,
            "moves": moves[kept],
            "rest": mean_head(recordings),
            "move_scale": _spread(moves),
            "pose_scale": _spread(np.concatenate(about_mean(poses))),
        }
        for name, array in arrays.items():
            self._keep(name, array)
        self.facts = {"recordings": len(recordings), "entries": len(kept), "variance_share": share, "pitch_hz": pitch_hz}
        return np.repeat(np.arange(len(recordings)), [len(f) for f in heard])[kept]

    def _validation(self, recordings: list[Utterance], rng: np.random.Generator) -> list[int]:
        count = max(1, min(self.config["validation"], len(recordings) // 3))
        return sorted(int(i) for i in rng.permutation(len(recordings))[:count])

    def _keep(self, name: str, array: Any) -> None:
        self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(self.device))


def segment_of(model: HeadKnn, utterance: Utterance) -> Segment:
    """A recording with its true first and last pose as key poses."""
    truth = poses_of(utterance)
    audio = resample(utterance.speech.audio, utterance.speech.sample_rate, RATE)
    distances, index = model.near(audio, len(truth))
    keys = HeadKeys(np.array([0.0, (len(truth) - 1) / model.fps]), truth[[0, -1]])
    targets = keys.targets(0, len(truth), model.fps, model.recorded.rest)
    return Segment(Candidates(distances, model.recorded.moves[index], *targets), truth[0], truth)


def _features(utterance: Utterance) -> Floats:
    """[T, 31] of the sound around each recorded frame; no pitch (NaN) before the first voiced window."""
    return voice_features(sound_windows(utterance, utterance.motion.fps, len(utterance.motion)), np.nan)[0]


def _principal(features: Floats, components: int, *, scaled: bool) -> tuple[Floats, Floats, float]:
    """Mean [31] and principal directions [31, D] of features, and the share of the variance that they hold."""
    mean = features.mean(axis=0)
    scale = np.maximum(features.std(axis=0), SMALLEST) if scaled else np.ones(FEATURES)
    sizes, directions = np.linalg.eigh(np.cov(((features - mean) / scale).T))
    share = float(sizes[::-1][:components].sum() / max(sizes.sum(), SMALLEST))
    return mean, directions[:, ::-1][:, :components] / scale[:, None], share


def _spread(tracks: Floats) -> Floats:
    """[6] standard deviations; infinite for what never moves, which then counts in no norm."""
    found = tracks.std(axis=0)
    return np.where(found > SMALLEST, found, np.inf)
