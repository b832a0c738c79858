"""Speech in, emotion out: for a whole utterance, along time, or as the sound comes in."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Floats
from .checks import checked_audio, checked_piece, checked_rate, require_open
from .contours import STILL
from .emotion_track import HOP_S, NOBODY_SPEAKS, WINDOW_S, check_windows, mean_of_windows, track_of, window_starts
from .errors import FacesynthError
from .folder import MANIFEST, Folder
from .graphs import Graph, Part
from .sound import checked_hz, resample
from .speech import EmotionTrack
from .voice import heard_voice_features, voice_features

FRONT_ENDS = {"voice_and_phone_net": "mel_cepstra", "voice": "mel_cepstra", "paper": "cepstrum"}
"""Kinds of features, and the graphs that they begin with."""
PHONES = "phones"
"""The graph of the phone network, which the first of them needs too."""
LEAST_OF_A_SPEAKER = 4
"""Recordings from which a speaker's own mean and spread are taken."""
SMALLEST_SPREAD = 1e-9


@dataclass(frozen=True)
class Reading:
    """What was heard in a sound."""

    emotion: str
    """The decision of the pairwise votes."""
    probabilities: dict[str, float]
    """Of each emotion; the largest may be another than the decision."""


@dataclass(frozen=True, eq=False)
class EmotionState:
    """All that a stream remembers between two pieces of sound."""

    heard: NDArray[np.float32]
    """[S'] sound that later windows need."""
    first: int
    """Which sample `heard` begins with."""
    windows: int
    """How many windows were read."""
    starts_s: tuple[float, ...]
    """Start of each window in which somebody spoke."""
    probabilities: tuple[Floats, ...]
    """[K] of each of them."""

    @property
    def samples(self) -> int:
        """How many samples were fed."""
        return self.first + len(self.heard)


@dataclass(frozen=True)
class ReaderSettings:
    """How a detector listens."""

    features: str
    """`voice` (statistics of timbre, pitch, dynamics and rhythm), `voice_and_phone_net` (the same and statistics of the phone
    network's layers) or `paper` (three moments and the cepstrum)."""
    normalise: bool
    """Whether a speaker is compared with that speaker's own average."""
    rate: int
    """Hz of the sound that it listens to."""


class EmotionReader:
    """A trained detector, whether its parts are graphs of a folder or modules of torch.

    Parts are called with named arrays: `front(audio [1, S])` gives power, mel bands and cepstra of a voice, or the paper's
    cepstrum [1, n]; `machine(features [N, F])` gives margins [N, pairs], probabilities [N, K] and the decision [N];
    `network`, where the features ask for it, is as in `Ear`.
    """

    def __init__(
        self,
        emotions: tuple[str, ...],
        settings: ReaderSettings,
        front: Part,
        machine: Part,
        manifest: Mapping[str, Any] = MappingProxyType({}),
        *,
        network: Part | None = None,
    ) -> None:
        self.emotions, self.settings, self.rate, self.manifest = emotions, settings, settings.rate, manifest
        self._front, self._machine, self._network = front, machine, network

    def features(self, audio: ArrayLike, rate: int) -> Floats:
        """Audio [S] to features [F]; FacesynthError where it is constant or too short."""
        sound = resample(checked_piece(audio), rate, self.rate)
        if self._network is not None:
            return heard_voice_features(sound, self._front, self._network)
        if self.settings.features == "voice":
            return voice_features(sound, self._front)
        if not len(sound) or float(np.ptp(sound)) < STILL:
            raise FacesynthError(NOBODY_SPEAKS)
        exact = sound.astype(np.float64)
        moments = [exact.mean(), exact.var(), np.sqrt(np.mean(np.square(exact)))]
        return np.concatenate([moments, self._front(audio=sound[None])[0][0]])

    def __call__(self, x: Floats) -> Floats:
        """Features [N, F] to probabilities [N, K]."""
        return self._machine(features=np.asarray(x, np.float64))[1]

    def decide(self, x: Floats) -> NDArray[np.str_]:
        """Features [N, F] to the emotion that wins most pairs [N]."""
        return np.array(self.emotions)[self._machine(features=np.asarray(x, np.float64))[2]]

    def detect(self, audio: ArrayLike, rate: int, speaker: Floats | None = None) -> Reading:
        """The emotion of a whole sound [S].

        speaker: features [N, F] of recordings of the same speaker in mixed emotions (a minute of speech cut into pieces will
        do); a detector that normalises needs them.
        """
        x = self._of_speaker(self.features(audio, rate)[None], speaker)
        probabilities = self(x)[0].tolist()
        return Reading(str(self.decide(x)[0]), dict(zip(self.emotions, probabilities, strict=True)))

    def detect_track(
        self, audio: ArrayLike, rate: int, *, window_s: float = WINDOW_S, hop_s: float = HOP_S, speaker: Floats | None = None
    ) -> EmotionTrack:
        """Emotions along time: the most probable one of the windows that cover each moment."""
        return track_of(*self.along(audio, rate, window_s=window_s, hop_s=hop_s, speaker=speaker), self.emotions)

    def along(
        self,
        audio: ArrayLike,
        rate: int,
        *,
        window_s: float = WINDOW_S,
        hop_s: float = HOP_S,
        speaker: Floats | None = None,
        watched: Callable[[list[float]], Iterable[float]] = iter,
    ) -> tuple[Floats, Floats]:
        """Ends [H] (s) of steps of `hop_s` and the probabilities [H, K] there: the mean of the windows that cover a step.

        Windows in which nobody speaks do not count; where there are no others, the nearest one does. `watched` goes through
        the windows' starts, and may show how far it is.
        """
        sound, rate = checked_audio(audio), checked_hz(rate)
        check_windows(window_s, hop_s)
        duration_s = len(sound) / rate
        starts = window_starts(duration_s, window_s, hop_s).tolist()
        heard = [(s, self.read(sound[round(s * rate) : round((s + window_s) * rate)], rate, speaker)) for s in watched(starts)]
        return mean_of_windows([(s, p) for s, p in heard if p is not None], window_s, hop_s, duration_s)

    def stream(
        self,
        *,
        window_s: float = WINDOW_S,
        hop_s: float = HOP_S,
        speaker: Floats | None = None,
        sample_rate: int | None = None,
    ) -> "EmotionStream":
        """Sound in pieces of any size; `sample_rate` must be the model's."""
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        check_windows(window_s, hop_s)
        return EmotionStream(self, window_s, hop_s, speaker)

    def read(self, piece: NDArray[np.float32], rate: int, speaker: Floats | None) -> Floats | None:
        """[K] probabilities of one window, None where nobody speaks in it."""
        try:
            x = self.features(piece, rate)
        except FacesynthError:
            return None
        return self(self._of_speaker(x[None], speaker))[0]

    def _of_speaker(self, x: Floats, speaker: Floats | None) -> Floats:
        if not self.settings.normalise:
            return x
        if speaker is None or len(speaker) < LEAST_OF_A_SPEAKER:
            raise FacesynthError(
                f"this detector compares a speaker with that speaker's own average: give it the features of at least "
                f"{LEAST_OF_A_SPEAKER} recordings of the speaker in mixed emotions; got {0 if speaker is None else len(speaker)}"
            )
        return beside_own_average(x, speaker)


def load_detector(folder: Folder, threads: int) -> EmotionReader:
    """The detector that was exported to a folder."""
    manifest, features = folder.manifest, folder.settings["features"]
    if features not in FRONT_ENDS:
        raise FacesynthError(f"{folder.path / MANIFEST}: features is {features!r}; wanted {', '.join(FRONT_ENDS)}")
    settings = ReaderSettings(features, bool(folder.settings["normalise"]), int(manifest["sample_rate"]))
    front, machine = Graph(folder, FRONT_ENDS[features], threads), Graph(folder, "machine", threads)
    network = Graph(folder, PHONES, threads) if features == "voice_and_phone_net" else None
    return EmotionReader(tuple(manifest["emotions"]), settings, front, machine, manifest, network=network)


class EmotionStream:
    """`push` sound, get readings of windows; `finish` gives the track of everything."""

    def __init__(self, model: EmotionReader, window_s: float, hop_s: float, speaker: Floats | None) -> None:
        self.model, self.window_s, self.hop_s, self.speaker = model, window_s, hop_s, speaker
        self.state = EmotionState(np.zeros(0, np.float32), 0, 0, (), ())
        self._ended = False

    def push(self, audio: ArrayLike) -> list[tuple[float, dict[str, float]]]:
        """More sound [S]: end in seconds and probabilities of every window that became full and in which somebody spoke."""
        require_open(self._ended)
        heard = np.concatenate([self.state.heard, checked_piece(audio)])
        self.state = replace(self.state, heard=heard)
        found = []
        while round((self.state.windows * self.hop_s + self.window_s) * self.model.rate) <= self.state.samples:
            reading = self._window(self.state.windows * self.hop_s)
            first = round((self.state.windows + 1) * self.hop_s * self.model.rate)
            # The last window, which ends with the sound, may begin as much as a window before its end.
            first = min(first, max(0, self.state.samples - round(self.window_s * self.model.rate) - 1))
            kept = max(first - self.state.first, 0)
            self.state = replace(
                self.state, heard=self.state.heard[kept:], first=self.state.first + kept, windows=self.state.windows + 1
            )
            found += reading
        return found

    def finish(self) -> EmotionTrack:
        """The emotions along the whole sound, as `detect_track` finds them."""
        require_open(self._ended)
        if not self.state.samples:
            raise FacesynthError("no sound was pushed; wanted mono samples [S]")
        self._ended, duration_s = True, self.state.samples / self.model.rate
        for start_s in window_starts(duration_s, self.window_s, self.hop_s)[self.state.windows :].tolist():
            self._window(start_s)
        heard = list(zip(self.state.starts_s, self.state.probabilities, strict=True))
        return track_of(*mean_of_windows(heard, self.window_s, self.hop_s, duration_s), self.model.emotions)

    def _window(self, start_s: float) -> list[tuple[float, dict[str, float]]]:
        rate = self.model.rate
        start, stop = round(start_s * rate) - self.state.first, round((start_s + self.window_s) * rate) - self.state.first
        read = self.model.read(self.state.heard[start:stop], rate, self.speaker)
        if read is None:
            return []
        starts, probabilities = (*self.state.starts_s, start_s), (*self.state.probabilities, read)
        self.state = replace(self.state, starts_s=starts, probabilities=probabilities)
        return [(start_s + self.window_s, dict(zip(self.model.emotions, read.tolist(), strict=True)))]


def beside_own_average(x: Floats, recordings: Floats) -> Floats:
    """Features [N, F] in spreads from the mean of a speaker's recordings [M, F]."""
    return (x - recordings.mean(axis=0)) / (recordings.std(axis=0) + SMALLEST_SPREAD)
