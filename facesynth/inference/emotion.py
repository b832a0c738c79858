"""Speech in, emotion out: for a whole utterance, along time, or as the sound comes in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_audio, checked_piece, checked_rate, require_open
from .errors import FacesynthError
from .folder import MANIFEST, Folder
from .graphs import Graph
from .sound import checked_hz, resample
from .speech import EmotionTrack
from .voice import require_voice, voice_features

FRONT_ENDS = {"voice": "mel_cepstra", "paper": "cepstrum"}
LEAST_OF_A_SPEAKER = 4
SMALLEST_SPREAD = 1e-9

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """What was heard in a sound."""

    emotion: str
    """The decision of the pairwise votes."""
    probabilities: dict[str, float]


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


class EmotionDetector:
    """A folder exported from an emotion detector."""

    def __init__(self, folder: Folder, threads: int) -> None:
        self.manifest, self.settings = folder.manifest, folder.settings
        self.emotions, self.rate = tuple(folder.manifest["emotions"]), int(folder.manifest["sample_rate"])
        if self.settings["features"] not in FRONT_ENDS:
            raise FacesynthError(f"{folder.path / MANIFEST}: features is {self.settings['features']!r}; wanted voice or paper")
        self._normalise = bool(self.settings["normalise"])
        self._front = Graph(folder, FRONT_ENDS[self.settings["features"]], threads)
        self._machine = Graph(folder, "machine", threads)

    def features(self, audio: ArrayLike, rate: int) -> Floats:
        """Audio [S] to features [F]; FacesynthError where it is constant or too short."""
        sound = resample(checked_piece(audio), rate, self.rate)
        if self.settings["features"] == "voice":
            require_voice(sound.astype(np.float64))
            return voice_features(sound, self._mel)
        if not len(sound) or float(np.ptp(sound)) < 1e-4:
            raise FacesynthError("the sound is constant (silence?); choose a recording in which somebody speaks")
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
        """The emotion of a whole sound [S]; `speaker`: features [N, F] of other recordings of the same speaker."""
        x = self._of_speaker(self.features(audio, rate)[None], speaker)
        probabilities = self(x)[0].tolist()
        return Reading(str(self.decide(x)[0]), dict(zip(self.emotions, probabilities, strict=True)))

    def detect_track(
        self, audio: ArrayLike, rate: int, *, window_s: float = 2.0, hop_s: float = 0.5, speaker: Floats | None = None
    ) -> EmotionTrack:
        """Emotions along time: the most probable one of the windows that cover each moment."""
        sound, rate = checked_audio(audio), checked_hz(rate)
        _check_windows(window_s, hop_s)
        duration_s = len(sound) / rate
        starts = window_starts(duration_s, window_s, hop_s)
        pieces = [self._read(sound[round(s * rate) : round((s + window_s) * rate)], rate, speaker) for s in starts]
        heard = [(s, p) for s, p in zip(starts.tolist(), pieces, strict=True) if p is not None]
        return self._as_track(heard, window_s, hop_s, duration_s)

    def stream(
        self, *, window_s: float = 2.0, hop_s: float = 0.5, speaker: Floats | None = None, sample_rate: int | None = None
    ) -> EmotionStream:
        """Sound in pieces of any size; `sample_rate` must be the model's."""
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        _check_windows(window_s, hop_s)
        return EmotionStream(self, window_s, hop_s, speaker)

    def _mel(self, audio: NDArray[np.float32]) -> tuple[Floats, Floats, Floats]:
        power, bands, cepstra = self._front(audio=audio[None])
        return power[0], bands[0], cepstra[0]

    def _read(self, piece: NDArray[np.float32], rate: int, speaker: Floats | None) -> Floats | None:
        """[K] probabilities of one window, None where it is silent."""
        try:
            x = self.features(piece, rate)
        except FacesynthError:
            return None
        return self(self._of_speaker(x[None], speaker))[0]

    def _of_speaker(self, x: Floats, speaker: Floats | None) -> Floats:
        if not self._normalise:
            return x
        if speaker is None or len(speaker) < LEAST_OF_A_SPEAKER:
            raise FacesynthError(
                f"this detector compares a speaker with that speaker's own average: give it the features of at least "
                f"{LEAST_OF_A_SPEAKER} recordings in mixed emotions; got {0 if speaker is None else len(speaker)}"
            )
        return (x - speaker.mean(axis=0)) / (speaker.std(axis=0) + SMALLEST_SPREAD)

    def _as_track(self, heard: list[tuple[float, Floats]], window_s: float, hop_s: float, duration_s: float) -> EmotionTrack:
        if not heard:
            raise FacesynthError("the sound is constant (silence?); choose a recording in which somebody speaks")
        centres, probabilities = np.array([s for s, _ in heard]) + window_s / 2, np.array([p for _, p in heard])
        ends = np.append(np.arange(hop_s, duration_s - hop_s / 2, hop_s), duration_s)
        away = np.abs(centres - (ends - hop_s / 2)[:, None])
        covering = (away <= window_s / 2) | (away.argmin(axis=1)[:, None] == np.arange(len(centres)))
        best = (covering @ probabilities).argmax(axis=1)
        last = np.append(np.flatnonzero(np.diff(best)), len(best) - 1)
        return EmotionTrack(tuple(self.emotions[k] for k in best[last]), ends[last], np.ones(len(last)))


class EmotionStream:
    """`push` sound, get readings of windows; `finish` gives the track of everything."""

    def __init__(self, model: EmotionDetector, window_s: float, hop_s: float, speaker: Floats | None) -> None:
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
        return self.model._as_track(heard, self.window_s, self.hop_s, duration_s)

    def _window(self, start_s: float) -> list[tuple[float, dict[str, float]]]:
        rate = self.model.rate
        start, stop = round(start_s * rate) - self.state.first, round((start_s + self.window_s) * rate) - self.state.first
        read = self.model._read(self.state.heard[start:stop], rate, self.speaker)
        if read is None:
            return []
        starts, probabilities = (*self.state.starts_s, start_s), (*self.state.probabilities, read)
        self.state = replace(self.state, starts_s=starts, probabilities=probabilities)
        return [(start_s + self.window_s, dict(zip(self.model.emotions, read.tolist(), strict=True)))]


def window_starts(duration_s: float, window_s: float, hop_s: float) -> Floats:
    """[N] start of each window in seconds; the last one ends with the sound."""
    count = max(1, int(np.ceil((duration_s - window_s) / hop_s)) + 1)
    return np.minimum(np.arange(count) * hop_s, max(0.0, duration_s - window_s))


def _check_windows(window_s: float, hop_s: float) -> None:
    if not 0 < hop_s <= window_s:
        raise FacesynthError(f"windows of {window_s} s every {hop_s} s; wanted 0 < step <= window")
