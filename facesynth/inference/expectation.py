"""What sound, phones and emotion lead one to expect of the face: the small network of poses, as it is asked.

The network works at a rate of its own (`rate_of`), on four frames of log-mel bands for each of its frames. It reads
`before` frames back and `ahead` frames further, so that what it says of a frame is the same in a stream as at once.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Ints
from .errors import unknown
from .filters import cubic_at
from .folder import Folder
from .graphs import Graph
from .heard import exported_listening
from .long_arrays import BLOCK_ROWS, joined
from .phones import PHONES, SILENCE
from .sound import resample
from .speech import NEUTRAL, PhoneTrack, Speech

RATE, BANDS_FPS = 16000, 100.0
"""Of the sound that bands are taken from, Hz, and of the bands; band frame k is centred on k / BANDS_FPS seconds."""
EACH = 4
"""Frames of bands that the network hears for each of its own, evenly spaced around it."""
USUAL_FPS, SLOWEST_FPS = 30.0, 20.0
"""About how many frames a second the network works at, and the least, Hz."""
PHONE_SIZE = 2.0
"""How loud a phone is beside the standardised bands of the sound."""
BEYOND = 2
"""Frames of the network after a place that is read between two of them."""
LOG_SECOND = 2.5
"""Added to the logarithm of a phone's duration in seconds: phones of 80 ms are at 0."""

Single = NDArray[np.float32]
Bands = Callable[[Speech], Single]
"""From a speech to its log-mel bands [F, B]."""


def rate_of(fps: float) -> float:
    """Hz at which the network works for motion at `fps`: a whole fraction of it, near USUAL_FPS, or a multiple of a low one."""
    if fps < SLOWEST_FPS:
        return fps * float(np.ceil(SLOWEST_FPS / fps))
    return fps / max(1, round(fps / USUAL_FPS))


@dataclass(frozen=True, eq=False)
class Standard:
    """How bands are standardised."""

    mean: Single
    """[B]"""
    deviation: Single
    """[B]"""

    def at(self, bands: Single, times_s: Floats) -> Single:
        """[..., B] bands [F, B] at times [...] in seconds, linear between frames, held at the ends."""
        found = linear_at(bands, np.clip(times_s * BANDS_FPS, 0, len(bands) - 1))
        return np.asarray((found - self.mean) / self.deviation, np.float32)


def linear_at(bands: NDArray[Any], at: Floats) -> Single:
    """[..., B] rows of [F, B] at places [...] between 0 and F - 1."""
    low = at.astype(np.int64)
    share = (at - low).astype(np.float32)[..., None]
    here, there = (np.asarray(bands[rows], np.float32) for rows in (low, np.minimum(low + 1, len(bands) - 1)))
    return np.asarray(here + share * (there - here), np.float32)


@dataclass(frozen=True, eq=False)
class Said:
    """What is said, as the network is told it."""

    phones: Sequence[int]
    """[P] numbers in PHONES; none where nobody knows what is said."""
    ends_s: Floats
    """[P]"""
    emotions: Single
    """[P, E] how much of each of the model's emotions is felt."""

    @classmethod
    def of(cls, speech: Speech, emotions: tuple[str, ...]) -> Self:
        """Phones and emotions of a speech; what an emotion lacks in intensity is neutral, where the model knows that.

        Of speech whose phones nobody knows, each emotion is one piece.
        """
        track, feelings = speech.phones, speech.emotions
        if not track.known:
            track = PhoneTrack((SILENCE,) * len(feelings.labels), feelings.ends_s)
        felt, intensity = feelings.per_phone(track)
        if strange := next((emotion for emotion in felt if emotion not in emotions), None):
            raise unknown("emotion", strange, emotions)
        shares = np.eye(len(emotions), dtype=np.float32)[[emotions.index(emotion) for emotion in felt]]
        if NEUTRAL in emotions:
            calm = np.eye(len(emotions), dtype=np.float32)[emotions.index(NEUTRAL)]
            shares = calm + intensity[:, None].astype(np.float32) * (shares - calm)
        return cls([PHONES.index(label) for label in track.labels], track.ends_s, shares)

    @classmethod
    def unknown(cls, emotion: int, count: int) -> Self:
        """Of speech whose phones nobody knows, in one emotion of `count`."""
        return cls((), np.array([np.inf]), np.eye(count, dtype=np.float32)[[emotion]])

    @classmethod
    def numbered(cls, phones: Sequence[int], ends_s: Floats, emotions: Sequence[int], count: int) -> Self:
        """The same of numbers of phones [P] and of whole emotions [P], of which there are `count`."""
        return cls(phones, ends_s, np.eye(count, dtype=np.float32)[np.asarray(emotions)])


@dataclass(frozen=True, eq=False)
class Reading:
    """What the network is told of each of its frames."""

    standard: Standard
    rate: float
    """Frames per second, Hz."""
    phones: bool
    """Whether it is told what is said."""
    emotion_count: int
    """Emotions that it can be told; of a single one it is told nothing."""

    @property
    def width(self) -> int:
        """W, how many numbers a frame is told by."""
        return EACH * len(self.standard.mean) + self.said_width + (self.emotion_count if self.emotion_count > 1 else 0)

    @property
    def said_width(self) -> int:
        """How many of them, after what is heard, tell what is said."""
        return len(PHONES) + 2 if self.phones else 0

    def told(self, bands: NDArray[Any], said: Said, times_s: Floats, spacing_s: float | None = None) -> Single:
        """[F, W] at times [F]; spacing_s: between the frames of the bands, as long as EACH of them fill a frame unless given."""
        spacing_s = 1 / (EACH * self.rate) if spacing_s is None else spacing_s
        around = (np.arange(EACH) - (EACH - 1) / 2) * spacing_s
        heard = self.standard.at(bands, times_s[:, None] + around).reshape(len(times_s), -1)
        number = np.minimum(np.searchsorted(said.ends_s, times_s, side="right"), len(said.ends_s) - 1)
        columns = [heard]
        if self.phones and not len(said.phones):
            columns.append(np.zeros((len(times_s), self.said_width), np.float32))
        elif self.phones:
            each = PHONE_SIZE * np.eye(len(PHONES), dtype=np.float32)[np.asarray(said.phones)]
            columns += [each[number], _place(said.ends_s, number, times_s)]
        if self.emotion_count > 1:
            columns.append(said.emotions[number])
        return np.hstack(columns).astype(np.float32)


def _place(ends_s: Floats, number: Ints, times_s: Floats) -> Single:
    """[F, 2] how far a phone has come, 0..1, and the logarithm of how long it lasts."""
    starts_s = np.concatenate([[0.0], ends_s[:-1]])[number]
    lasting_s = np.maximum(ends_s[number] - starts_s, 1e-3)
    come = np.clip((times_s - starts_s) / lasting_s, 0, 1)
    return np.stack([come, np.log(lasting_s) + LOG_SECOND], axis=1).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Expectation:
    """A trained network, wherever it runs."""

    network: Callable[[Single], Single]
    """What `Reading.told` gives [F, W] to coordinates [F, D], each of the frames before it and itself."""
    reading: Reading
    before: int
    """Frames that the network reads back."""
    ahead: int
    """Frames by which its input runs ahead of its output."""

    @property
    def look_ahead_s(self) -> float:
        """How much of the sound after a frame must be known."""
        return (self.ahead + 0.5) / self.reading.rate

    def poses(self, bands: Single, said: Said, fps: float, count: int) -> Floats:
        """[count, D] at `fps`: bands [F, B] of the sound."""
        at = np.arange(count, dtype=np.float64) * (self.reading.rate / fps)
        stop = int(np.floor(at[-1] + 1e-9)) + 1 + BEYOND
        return joined((self._between(bands, said, at[a : a + BLOCK_ROWS], stop) for a in range(0, count, BLOCK_ROWS)), np.float64)

    def _between(self, bands: Single, said: Said, at: Floats, stop: int) -> Floats:
        """[n, D] at places [n] among the network's frames, of which there are `stop`."""
        first = max(0, int(np.floor(at[0])) - 1)
        last = min(stop, int(np.floor(at[-1] + 1e-9)) + 1 + BEYOND)
        return cubic_at(self.frames(bands, said, first, last), at - first)

    def frames(self, bands: Single, said: Said, first: int, stop: int, bands_from_s: float = 0.0) -> Floats:
        """[stop - first, D] the network's own frames; bands_from_s: where the first of the bands lies."""
        times_s = np.arange(first - self.before, stop + self.ahead) / self.reading.rate
        told = self.reading.told(bands, said, times_s - bands_from_s)
        return self.network(told)[self.before + self.ahead :].astype(np.float64)


def exported_bands(folder: Folder, threads: int) -> Bands:
    """What the graphs of a folder hear in a speech."""
    hear = exported_listening(folder, threads)
    return lambda speech: hear(resample(speech.audio, speech.sample_rate, RATE))


def exported_expectation(folder: Folder, arrays: Mapping[str, NDArray[Any]], threads: int) -> Expectation:
    """The network of a folder's graph `expectation`."""
    graph = Graph(folder, "expectation", threads)
    settings = folder.settings["expectation"]

    def network(told: Single) -> Single:
        return np.asarray(graph(heard=told[None])[0][0])

    standard = Standard(arrays["expectation_mean"], arrays["expectation_deviation"])
    emotions = len(folder.manifest["emotions"])
    reading = Reading(standard, float(settings["rate"]), bool(settings["phones"]), emotions)
    return Expectation(network, reading, int(settings["before"]), int(settings["ahead"]))
