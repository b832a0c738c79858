"""The sound of an utterance and what is said in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_audio
from .errors import FacesynthError
from .phones import SILENCE

NEUTRAL = "neutral"
"""The emotion that intensities lead down to."""


@dataclass(frozen=True, eq=False)
class PhoneTrack:
    """Phones one after the other, without gaps, from 0 to the end of the sound."""

    labels: tuple[str, ...]
    """ARPAbet, lower case, no stress; `pau` is silence."""
    ends_s: NDArray[np.float64]
    """[P] end of each phone, seconds, strictly increasing."""
    confidences: NDArray[np.float64] | None = None
    """[P] 0 to 1, how sure it is that this phone was said; None where nobody has to doubt it."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "ends_s", _checked_ends(self.ends_s, len(self.labels), "phone"))
        if self.confidences is not None:
            object.__setattr__(self, "confidences", _checked_shares(self.confidences, len(self.labels), "confidences of phones"))

    def __len__(self) -> int:
        return len(self.labels)

    @classmethod
    def unknown(cls, duration_s: float) -> Self:
        """The track of a sound of which nobody knows what is said: one silence that nothing vouches for."""
        return cls((SILENCE,), np.array([duration_s]), np.zeros(1))

    @property
    def known(self) -> bool:
        """Whether anybody says what is spoken, be it that nobody speaks."""
        return self.confidences is None or bool(self.confidences.any()) or any(label != SILENCE for label in self.labels)

    def told(self, method: str) -> Self:
        """Itself; FacesynthError where nobody knows what is said, and the method must be told."""
        if not self.known:
            raise FacesynthError(
                f"{method} must be told what is said, and nobody knows the phones of this speech; give its words or phones,"
                " or take a model that hears the sound alone (ridge, lds, network phones=false)"
            )
        return self

    @property
    def starts_s(self) -> NDArray[np.float64]:
        """[P] start of each phone, seconds."""
        return np.concatenate([[0.0], self.ends_s[:-1]])

    @property
    def duration_s(self) -> float:
        """End of the last phone, seconds."""
        return float(self.ends_s[-1])

    def frame_bounds(self, fps: float) -> NDArray[np.int64]:
        """[P + 1] first frame of each phone and, last, the number of frames."""
        return frame_bounds(self.ends_s, fps)


@dataclass(frozen=True, eq=False)
class EmotionTrack:
    """Emotions one after the other, without gaps, from 0 to the end, each with an intensity."""

    labels: tuple[str, ...]
    ends_s: NDArray[np.float64]
    """[E] end of each interval, seconds, strictly increasing."""
    intensities: NDArray[np.float64]
    """[E] 0 (neutral) to 1 (as recorded)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "ends_s", _checked_ends(self.ends_s, len(self.labels), "emotion"))
        object.__setattr__(self, "intensities", _checked_shares(self.intensities, len(self.labels), "emotion intensities"))

    @classmethod
    def constant(cls, emotion: str, duration_s: float, intensity: float = 1.0) -> Self:
        """One emotion for the whole utterance."""
        return cls((emotion,), np.array([duration_s]), np.array([intensity]))

    def index_at(self, times_s: ArrayLike) -> NDArray[np.int64]:
        """Which interval each time lies in; times after the end belong to the last one."""
        return np.minimum(np.searchsorted(self.ends_s, np.asarray(times_s), side="right"), len(self.labels) - 1)

    def per_phone(self, phones: PhoneTrack) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """The emotion that overlaps each phone most, and its intensity [P]."""
        starts = np.concatenate([[0.0], self.ends_s[:-1]])
        ends = np.concatenate([self.ends_s[:-1], [np.inf]])
        overlap = np.minimum(phones.ends_s[:, None], ends) - np.maximum(phones.starts_s[:, None], starts)
        index = overlap.argmax(axis=1)
        return tuple(self.labels[i] for i in index), self.intensities[index]


@dataclass(frozen=True, eq=False)
class Speech:
    """What an utterance sounds like, says and feels."""

    audio: NDArray[np.float32]
    """[S] mono, -1..1."""
    sample_rate: int
    """Hz."""
    phones: PhoneTrack
    emotions: EmotionTrack
    text: str = ""
    """The transcript, as far as it is known."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "audio", checked_audio(self.audio))

    @property
    def duration_s(self) -> float:
        """Length of the phone track, which is the length of what is synthesised, seconds."""
        return self.phones.duration_s


def frame_bounds(ends_s: ArrayLike, fps: float) -> NDArray[np.int64]:
    """[P + 1] first frame of each phone that ends at `ends_s` [P] and, last, the number of frames: `round(end * fps)`.

    Rounding ends, never durations, keeps the frames from drifting against the sound.
    """
    return np.concatenate([[0], np.round(np.asarray(ends_s, np.float64) * fps)]).astype(np.int64)


def _checked_ends(ends_s: ArrayLike | Sequence[float], count: int, what: str) -> NDArray[np.float64]:
    ends = np.asarray(ends_s, np.float64)
    if count == 0 or ends.shape != (count,):
        raise FacesynthError(
            f"a {what} track needs one end time for each label and at least one; got {count} labels, {ends.size} ends"
        )
    if not np.isfinite(ends).all() or not (np.diff(ends, prepend=0.0) > 0).all():
        raise FacesynthError(f"the ends of a {what} track must increase from 0; got {np.round(ends[:8], 4).tolist()} …")
    return ends


def _checked_shares(values: ArrayLike, count: int, what: str) -> NDArray[np.float64]:
    shares = np.asarray(values, np.float64)
    if shares.shape != (count,) or not ((shares >= 0) & (shares <= 1)).all():
        raise FacesynthError(f"{what} must be {count} numbers in [0, 1]; got {shares.tolist()}")
    return shares
