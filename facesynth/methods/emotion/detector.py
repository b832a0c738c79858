"""Speech in, emotion out: for a whole utterance or along time."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from facesynth.atomic import atomic_path
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.sound import resample
from facesynth.inference.speech import EmotionTrack
from facesynth.methods.emotion.paper_features import paper_features
from facesynth.methods.emotion.svm import Kernel, Svm, SvmSettings
from facesynth.methods.emotion.voice_features import voice_features
from facesynth.progress import track

RATE = 16000
FORMAT = 1
FEATURES = ("voice", "paper")
SMALLEST_SPREAD = 1e-9
WINDOW_S, HOP_S = 2.0, 0.5
"""Along time: length of what is listened to at once, and its step."""
LEAST_OF_A_SPEAKER = 4
"""Recordings from which a speaker's own mean and spread are taken."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A recording of one emotion."""

    audio: NDArray[np.float32]
    """[S] mono."""
    rate: int
    """Hz."""
    emotion: str
    speaker: str = ""
    sentence: str = ""


@dataclass(frozen=True)
class DetectorSettings:
    """What a detector is made of; the keys of configs/emotion.yaml.

    `features` is `voice` (187 statistics of timbre, pitch, dynamics and rhythm) or `paper` (three moments and
    `coefficients` of the cepstrum). `normalise`: every speaker's features are brought to that speaker's own mean and
    spread, over all of the speaker's recordings; a new speaker then needs some too.
    """

    features: Literal["voice", "paper"] = "voice"
    coefficients: int = 500
    kernel: Kernel = "radial"
    formulation: Literal["C", "nu"] = "C"
    cost: float = 3.0
    nu: float = 0.5
    normalise: bool = False

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> Self:
        """Settings from a dictionary; an unknown key is answered with the nearest known one."""
        known = [f.name for f in fields(cls)]
        for key in config:
            if key not in known:
                raise unknown("emotion setting", key, known)
        return cls(**config)


@dataclass(frozen=True)
class Reading:
    """What was heard in a sound."""

    emotion: str
    """The decision of the pairwise votes."""
    probabilities: dict[str, float]
    """Of each emotion; the largest may be another than the decision."""


class EmotionDetector(nn.Module):
    """Features, scaling and a support vector machine."""

    shift: Tensor
    """[F] subtracted from the features."""
    scale: Tensor
    """[F] and then multiplied."""

    def __init__(self, settings: DetectorSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or DetectorSettings()
        if self.settings.features not in FEATURES:
            raise unknown("feature set", self.settings.features, FEATURES)
        self.emotions: tuple[str, ...] = ()
        self.provenance: dict[str, Any] = {}

    def features(self, audio: NDArray[Any], rate: int) -> NDArray[np.float64]:
        """Audio [S] to features [F]; FacesynthError where it is constant or too short."""
        sound = resample(np.asarray(audio, np.float32), rate, RATE).astype(np.float64)
        if self.settings.features == "voice":
            return voice_features(sound)
        if not len(sound) or float(np.ptp(sound)) < 1e-4:
            raise FacesynthError("the sound is constant (silence?); choose a recording in which somebody speaks")
        return paper_features(sound, self.settings.coefficients)

    def features_of(self, clips: Sequence[Clip], workers: Workers = ALONE) -> NDArray[np.float64]:
        """[N, F] features of many recordings, the same whoever extracts them."""
        return np.array(list(spread(self._features_of_clip, clips, workers, "features")))

    def _features_of_clip(self, clip: Clip) -> NDArray[np.float64]:
        return self.features(clip.audio, clip.rate)

    def fit(self, clips: Sequence[Clip], workers: Workers = ALONE) -> Self:
        """Learn from recordings of at least two emotions."""
        return self.fit_features(self.features_of(clips, workers), clips)

    def fit_features(self, x: NDArray[np.float64], clips: Sequence[Clip]) -> Self:
        """The same, from features [N, F] that were computed before."""
        emotions = sorted({clip.emotion for clip in clips})
        if len(emotions) < 2:
            raise FacesynthError(f"detection needs recordings of at least two emotions; got {', '.join(emotions) or 'none'}")
        speakers = np.array([clip.speaker for clip in clips])
        if self.settings.normalise:
            x = by_speaker(x, speakers)
        self._fit_scaling(x)
        y = np.array([emotions.index(clip.emotion) for clip in clips])
        groups = speakers if len(set(speakers.tolist())) > 1 else np.array([clip.sentence for clip in clips])
        chosen = {f.name: getattr(self.settings, f.name) for f in fields(SvmSettings)}
        self.machine = Svm.fit(self._scaled(torch.from_numpy(x)).numpy(), y, SvmSettings(**chosen), groups)
        self.emotions = tuple(emotions)
        return self.eval()

    def _fit_scaling(self, x: NDArray[np.float64]) -> None:
        """The paper's features to [-1, 1]; the voice's, of many shapes, to mean 0 and spread 1."""
        if self.settings.features == "paper":
            low, high = x.min(axis=0), x.max(axis=0)
            shift, spread = (low + high) / 2, (high - low) / 2
        else:
            shift, spread = x.mean(axis=0), x.std(axis=0)
        scale = np.where(spread > SMALLEST_SPREAD, 1 / np.maximum(spread, SMALLEST_SPREAD), 0)
        self.register_buffer("shift", torch.from_numpy(shift))
        self.register_buffer("scale", torch.from_numpy(scale))

    def _scaled(self, x: Tensor) -> Tensor:
        return (x.to(torch.float64) - self.shift) * self.scale

    def forward(self, x: Tensor) -> Tensor:
        """Features [..., F] to probabilities [..., K]."""
        return self.machine(self._scaled(x))

    def decide(self, x: NDArray[np.float64]) -> NDArray[np.str_]:
        """Features [N, F] to the emotion that wins most pairs [N]."""
        return np.array(self.emotions)[self.machine.decide(self._scaled(torch.from_numpy(x))).numpy()]

    def detect(self, audio: NDArray[Any], rate: int, speaker: NDArray[np.float64] | None = None) -> Reading:
        """The emotion of a whole sound [S].

        speaker: features [N, F] of recordings of the same speaker in mixed emotions (`features_of`, or a minute of
        speech cut into pieces); a detector that normalises needs them.
        """
        x = self._of_speaker(self.features(audio, rate)[None], speaker)
        probabilities = self(torch.from_numpy(x))[0].tolist()
        return Reading(str(self.decide(x)[0]), dict(zip(self.emotions, probabilities, strict=True)))

    def detect_track(
        self,
        audio: NDArray[Any],
        rate: int,
        *,
        window_s: float = WINDOW_S,
        hop_s: float = HOP_S,
        speaker: NDArray[np.float64] | None = None,
    ) -> EmotionTrack:
        """Emotions along time: the most probable one of the windows that cover each moment."""
        ends_s, probabilities = self.along(audio, rate, window_s=window_s, hop_s=hop_s, speaker=speaker)
        return track_of(ends_s, probabilities, self.emotions)

    def along(
        self,
        audio: NDArray[Any],
        rate: int,
        *,
        window_s: float = WINDOW_S,
        hop_s: float = HOP_S,
        speaker: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ends [H] (s) of steps of `hop_s` and the probabilities [H, K] there: the mean of the windows that cover a step.

        Windows in which nobody speaks do not count; where there are no others, the nearest one does.
        """
        duration_s = len(audio) / rate
        if not 0 < hop_s <= window_s:
            raise FacesynthError(
                f"windows must be at least as long as their step and both positive; got {window_s} and {hop_s} s"
            )
        count = max(1, int(np.ceil((duration_s - window_s) / hop_s)) + 1)
        starts = np.minimum(np.arange(count) * hop_s, max(0.0, duration_s - window_s))
        pieces = [audio[round(s * rate) : round((s + window_s) * rate)] for s in starts]
        x = [self._quiet_or_features(piece, rate) for piece in track(pieces, "emotion", len(pieces))]
        heard = [k for k, features in enumerate(x) if features is not None]
        if not heard:
            raise FacesynthError("the sound is constant (silence?); choose a recording in which somebody speaks")
        known = np.array([x[k] for k in heard])
        probabilities = self(torch.from_numpy(self._of_speaker(known, speaker))).numpy()
        ends_s = np.append(np.arange(hop_s, duration_s - hop_s / 2, hop_s), duration_s)
        apart_s = np.abs(starts[heard] + window_s / 2 - (ends_s - hop_s / 2)[:, None])  # [H, windows]
        covering = (apart_s <= window_s / 2) | (apart_s == apart_s.min(axis=1, keepdims=True))
        return ends_s, covering @ probabilities / covering.sum(axis=1, keepdims=True)

    def _quiet_or_features(self, piece: NDArray[Any], rate: int) -> NDArray[np.float64] | None:
        try:
            return self.features(piece, rate)
        except FacesynthError:
            return None

    def _of_speaker(self, x: NDArray[np.float64], speaker: NDArray[np.float64] | None) -> NDArray[np.float64]:
        if not self.emotions:
            raise FacesynthError("this emotion detector is not trained; call fit(clips) or load(path) first")
        if not self.settings.normalise:
            return x
        if speaker is None or len(speaker) < LEAST_OF_A_SPEAKER:
            raise FacesynthError(
                f"this detector compares a speaker with that speaker's own average: give it at least {LEAST_OF_A_SPEAKER} "
                f"recordings of the speaker in mixed emotions; got {0 if speaker is None else len(speaker)}"
            )
        return (x - speaker.mean(axis=0)) / (speaker.std(axis=0) + SMALLEST_SPREAD)

    def save(self, path: str | Path) -> None:
        """Write one safetensors file, atomically."""
        if not self.emotions:
            raise FacesynthError("this emotion detector is not trained; there is nothing to save")
        header = {
            "settings": asdict(self.settings),
            "emotions": self.emotions,
            "provenance": self.provenance,
            "format": FORMAT,
        }
        tensors = {key: value.contiguous() for key, value in self.state_dict().items()}
        with atomic_path(path) as part:
            save_file(tensors, part, metadata={"facesynth_emotion": json.dumps(header, sort_keys=True)})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; FacesynthError for any other file."""
        if not Path(path).is_file():
            raise FacesynthError(f"{path}: no such emotion detector; train one with train/emotion.py")
        try:
            with safe_open(path, "pt") as file:
                text = (file.metadata() or {}).get("facesynth_emotion")
                tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - safe_open is no mapping
        except (SafetensorError, OSError) as error:
            raise FacesynthError(f"{path} is not an emotion detector, or is truncated ({error})") from None
        header = json.loads(text) if text else {}
        if header.get("format") != FORMAT:
            raise FacesynthError(f"{path} is not an emotion detector of format {FORMAT}; train it again")
        detector = cls(DetectorSettings(**header["settings"]))
        detector.emotions, detector.provenance = tuple(header["emotions"]), header["provenance"]
        detector.machine = Svm(len(detector.emotions), detector.settings.kernel)
        for key, value in tensors.items():
            owner, _, leaf = key.rpartition(".")
            detector.get_submodule(owner).register_buffer(leaf, value)
        return detector.eval()


def track_of(ends_s: NDArray[np.float64], probabilities: NDArray[np.float64], emotions: Sequence[str]) -> EmotionTrack:
    """The most probable emotion of each step, those of one emotion in a row as one interval."""
    best = probabilities.argmax(axis=1)
    last = np.append(np.flatnonzero(np.diff(best)), len(best) - 1)
    return EmotionTrack(tuple(emotions[k] for k in best[last]), ends_s[last], np.ones(len(last)))


def by_speaker(x: NDArray[np.float64], speakers: NDArray[Any]) -> NDArray[np.float64]:
    """Features [N, F] of mean 0 and spread 1 for each speaker [N]."""
    result = np.empty_like(x)
    for speaker in np.unique(speakers):
        own = x[speakers == speaker]
        result[speakers == speaker] = (own - own.mean(axis=0)) / (own.std(axis=0) + SMALLEST_SPREAD)
    return result
