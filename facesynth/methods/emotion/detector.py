"""Speech in, emotion out: for a whole utterance or along time."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.arrays import Floats
from facesynth.inference.emotion import FRONT_ENDS, SMALLEST_SPREAD, EmotionReader, ReaderSettings, Reading, beside_own_average
from facesynth.inference.emotion_track import HOP_S, WINDOW_S, track_of
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.pitch import RATE
from facesynth.inference.speech import EmotionTrack
from facesynth.methods.emotion.discriminant import Shrinkage, fit_discriminant
from facesynth.methods.emotion.pairwise import Kernel, PairwiseClassifier
from facesynth.methods.emotion.probabilities import vote
from facesynth.methods.emotion.svm import SvmSettings, fit_svm
from facesynth.methods.model_file import read_header, read_tensors, write_model
from facesynth.methods.parts import part
from facesynth.progress import track
from facesynth.speech.cepstrum import RealCepstrum
from facesynth.speech.mel_cepstra import MelCepstra
from facesynth.speech.phone_network import phone_network

CLASSIFIERS = ("discriminant", "svm")


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

    `features` is `voice` (187 statistics of timbre, pitch, dynamics and rhythm), `voice_and_phone_net` (the same and 864 of
    the phone network's layers) or `paper` (three moments and `coefficients` of the cepstrum). `classifier`: `discriminant`
    (linear, its covariance shrunken by `shrinkage`) or `svm` (`kernel` to `nu`, as in the paper). `normalise`: every speaker's
    features are brought to that speaker's own mean and spread, over all of the speaker's recordings; a new speaker then needs
    some too.
    """

    features: Literal["voice_and_phone_net", "voice", "paper"] = "voice_and_phone_net"
    coefficients: int = 500
    classifier: Literal["discriminant", "svm"] = "discriminant"
    shrinkage: Shrinkage = "auto"
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


class EmotionDetector(nn.Module):
    """Features, scaling and a classifier of pairs of emotions.

    No `Method`: it learns from labelled sounds and gives emotions, where methods learn from a corpus and give motion.
    """

    name = "emotion"
    """As methods have one: in model files and in exported folders."""

    shift: Tensor
    """[F] subtracted from the features."""
    scale: Tensor
    """[F] and then multiplied."""

    def __init__(self, settings: DetectorSettings | None = None) -> None:
        super().__init__()
        self.settings = settings or DetectorSettings()
        if self.settings.features not in FRONT_ENDS:
            raise unknown("feature set", self.settings.features, FRONT_ENDS)
        if self.settings.classifier not in CLASSIFIERS:
            raise unknown("classifier", self.settings.classifier, CLASSIFIERS)
        paper = self.settings.features == "paper"
        self.front = RealCepstrum(self.settings.coefficients) if paper else MelCepstra()
        self.emotions: tuple[str, ...] = ()
        self.provenance: dict[str, Any] = {}

    def features(self, audio: NDArray[Any], rate: int) -> Floats:
        """Audio [S] to features [F]; FacesynthError where it is constant or too short."""
        return self._listening().features(audio, rate)

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
        y = np.array([emotions.index(clip.emotion) for clip in clips])
        groups = speakers if len(set(speakers.tolist())) > 1 else np.array([clip.sentence for clip in clips])
        device = self._device
        self._fit_scaling(x)
        self.machine = self._fit_machine(self._scaled(torch.from_numpy(x)).numpy(), y, groups)
        self.emotions = tuple(emotions)
        return self.to(device).eval()

    def _fit_machine(self, x: NDArray[np.float64], y: NDArray[np.int64], groups: NDArray[Any]) -> PairwiseClassifier:
        if self.settings.classifier == "discriminant":
            return fit_discriminant(x, y, self.settings.shrinkage, groups)
        return fit_svm(x, y, SvmSettings(**{f.name: getattr(self.settings, f.name) for f in fields(SvmSettings)}), groups)

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

    def judge(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Features [N, F] to margins [N, pairs], probabilities [N, K] and the class [N] that wins most pairs."""
        margins = self.machine.margins(self._scaled(features))
        return margins, self.machine.probabilities(margins), vote(margins, self.machine.classes)

    def reader(self) -> EmotionReader:
        """The detector that listens: what an exported folder is, with these modules for its graphs."""
        if not self.emotions:
            raise FacesynthError("this emotion detector is not trained; call fit(clips) or load(path) first")
        return self._listening()

    def decide(self, x: Floats) -> NDArray[np.str_]:
        """Features [N, F] to the emotion that wins most pairs [N]."""
        return self.reader().decide(x)

    def detect(self, audio: NDArray[Any], rate: int, speaker: Floats | None = None) -> Reading:
        """The emotion of a whole sound [S]; `speaker`: features [N, F] of recordings of the same speaker (`features_of`)."""
        return self.reader().detect(audio, rate, speaker)

    def detect_track(
        self, audio: NDArray[Any], rate: int, *, window_s: float = WINDOW_S, hop_s: float = HOP_S, speaker: Floats | None = None
    ) -> EmotionTrack:
        """Emotions along time: the most probable one of the windows that cover each moment."""
        return track_of(*self.along(audio, rate, window_s=window_s, hop_s=hop_s, speaker=speaker), self.emotions)

    def along(
        self, audio: NDArray[Any], rate: int, *, window_s: float = WINDOW_S, hop_s: float = HOP_S, speaker: Floats | None = None
    ) -> tuple[Floats, Floats]:
        """Ends [H] (s) of steps of `hop_s` and the probabilities [H, K] there, with a bar of progress."""
        return self.reader().along(
            audio, rate, window_s=window_s, hop_s=hop_s, speaker=speaker, watched=lambda starts: track(starts, "emotion")
        )

    def _listening(self) -> EmotionReader:
        settings = ReaderSettings(self.settings.features, self.settings.normalise, RATE)
        front, machine = part(self._front, self._device), part(self.judge, self._device)
        network = phone_network().part if settings.features == "voice_and_phone_net" else None
        return EmotionReader(self.emotions, settings, front, machine, network=network)

    @property
    def _device(self) -> torch.device:
        return next((buffer.device for buffer in self.buffers()), torch.device("cpu"))

    def _front(self, audio: Tensor) -> Sequence[Tensor]:
        found = self.front(audio.double())
        return found if isinstance(found, tuple) else (found,)

    def save(self, path: str | Path) -> None:
        """Write one safetensors file, atomically."""
        if not self.emotions:
            raise FacesynthError("this emotion detector is not trained; there is nothing to save")
        config, emotions = asdict(self.settings), list(self.emotions)
        header = {"method": self.name, "config": config, "emotions": emotions, "provenance": self.provenance}
        write_model(path, self, header)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; FacesynthError for any other file."""
        header = read_header(path, what="an emotion detector")
        if header["method"] != cls.name:
            raise FacesynthError(f"{path} holds a model of method {header['method']!r}, not an emotion detector")
        # Files written before there was a choice hold support vectors.
        detector = cls(DetectorSettings.from_config({"classifier": "svm", **header["config"]}))
        detector.emotions, detector.provenance = tuple(header["emotions"]), header["provenance"]
        linear = detector.settings.classifier == "discriminant"
        detector.machine = PairwiseClassifier(len(detector.emotions), "linear" if linear else detector.settings.kernel)
        read_tensors(path, detector, header)
        return detector.eval()


def by_speaker(x: NDArray[np.float64], speakers: NDArray[Any]) -> NDArray[np.float64]:
    """Features [N, F] of mean 0 and spread 1 for each speaker [N]."""
    result = np.empty_like(x)
    for speaker in np.unique(speakers):
        own = x[speakers == speaker]
        result[speakers == speaker] = beside_own_average(own, own)
    return result
