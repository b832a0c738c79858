"""Speech in, motion out: the same fields as in facesynth, whose own objects may be given as well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth_runtime.errors import RuntimeInputError

DIMENSIONS = {"markers": 3, "landmarks": 2, "curves": 1}
SILENCE = "pau"


@dataclass(frozen=True, eq=False)
class PhoneTrack:
    """Phones one after the other, without gaps, from 0 to the end of the sound."""

    labels: tuple[str, ...]
    """ARPAbet, lower case, no stress; `pau` is silence."""
    ends_s: NDArray[np.float64]
    """[P] end of each phone, seconds, strictly increasing."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "ends_s", checked_ends(self.ends_s, len(self.labels), "phone"))

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def duration_s(self) -> float:
        """End of the last phone, seconds."""
        return float(self.ends_s[-1])


@dataclass(frozen=True, eq=False)
class EmotionTrack:
    """Emotions one after the other, without gaps, from 0 to the end, each with an intensity."""

    labels: tuple[str, ...]
    ends_s: NDArray[np.float64]
    intensities: NDArray[np.float64]
    """[E] 0 (neutral) to 1 (as recorded)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "ends_s", checked_ends(self.ends_s, len(self.labels), "emotion"))
        amounts = np.asarray(self.intensities, np.float64)
        if amounts.shape != (len(self.labels),) or not ((amounts >= 0) & (amounts <= 1)).all():
            raise RuntimeInputError(f"emotion intensities must be {len(self.labels)} numbers in 0..1; got {amounts.tolist()}")
        object.__setattr__(self, "intensities", amounts)

    @classmethod
    def constant(cls, emotion: str, duration_s: float, intensity: float = 1.0) -> Self:
        """One emotion for the whole utterance."""
        return cls((emotion,), np.array([duration_s]), np.array([intensity]))


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "audio", checked_audio(self.audio))


@dataclass(frozen=True)
class Layout:
    """Names and groups of K markers in 3-D (mm), K landmarks in 2-D (px) or K curves (0..1)."""

    kind: str
    names: tuple[str, ...]
    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    lip_pairs: tuple[tuple[int, int], ...] = ()
    neutral: tuple[float, ...] | None = None

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """From the manifest."""
        pairs = tuple((int(a), int(b)) for a, b in plain["lip_pairs"])
        groups = {name: tuple(members) for name, members in plain["groups"].items()}
        neutral = plain["neutral"]
        return cls(plain["kind"], tuple(plain["names"]), groups, pairs, None if neutral is None else tuple(neutral))

    @property
    def dimension(self) -> int:
        """Channels of one point."""
        return DIMENSIONS[self.kind]

    def points(self, frames: NDArray[Any]) -> NDArray[Any]:
        """View frames [..., C] as points [..., K, dimension]."""
        return frames.reshape(*frames.shape[:-1], len(self.names), self.dimension)


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of facial motion with head motion removed."""

    frames: NDArray[np.float32]
    """[T, C] in the layout's unit."""
    fps: float
    layout: Layout

    def __len__(self) -> int:
        return len(self.frames)


def checked_piece(audio: ArrayLike) -> NDArray[np.float32]:
    """Mono sound [S], -1..1, possibly none of it."""
    samples = np.asarray(audio)
    if samples.ndim != 1:
        raise RuntimeInputError(f"audio has shape {list(samples.shape)}; wanted mono samples [S]: take the mean of the channels")
    if samples.dtype.kind != "f":
        raise RuntimeInputError(f"audio is {samples.dtype}; wanted floats in -1..1: divide samples of 16 bits by 32768")
    if not np.isfinite(samples).all():
        raise RuntimeInputError("audio holds NaN or infinite samples; export the sound again")
    return samples.astype(np.float32, copy=False)


def checked_audio(audio: ArrayLike) -> NDArray[np.float32]:
    """The same, at least one sample."""
    samples = checked_piece(audio)
    if not len(samples):
        raise RuntimeInputError("audio has shape [0]; wanted mono samples [S] with S > 0")
    return samples


def checked_seed(seed: int) -> int:
    """A seed that numpy's generators take."""
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise RuntimeInputError(f"seed is {seed!r}; wanted a whole number that is not negative")
    return int(seed)


def checked_rate(got: float, wanted: int) -> None:
    """RuntimeInputError where sound has another rate than the one wanted."""
    if got != wanted:
        raise RuntimeInputError(
            f"the sound has {got} Hz; wanted {wanted} Hz: bring pieces there with facesynth_runtime.Resampler, whole sounds with "
            f"resample"
        )


def require_open(ended: bool) -> None:
    """RuntimeInputError where a stream was finished already."""
    if ended:
        raise RuntimeInputError("the stream was finished; open another one with model.stream()")


def checked_ends(ends_s: ArrayLike | Sequence[float], count: int, what: str) -> NDArray[np.float64]:
    """End times that increase from 0."""
    ends = np.asarray(ends_s, np.float64)
    if count == 0 or ends.shape != (count,):
        raise RuntimeInputError(
            f"a {what} track needs one end for each label, at least one; got {count} labels, {ends.size} ends"
        )
    if not np.isfinite(ends).all() or not (np.diff(ends, prepend=0.0) > 0).all():
        raise RuntimeInputError(f"the ends of a {what} track must increase from 0; got {np.round(ends[:8], 4).tolist()}")
    return ends


def frame_bounds(ends_s: NDArray[np.float64], fps: float) -> NDArray[np.int64]:
    """[P + 1] first frame of each phone and, last, the number of frames."""
    return np.concatenate([[0], np.round(np.asarray(ends_s, np.float64) * fps)]).astype(np.int64)


def emotions_of_phones(emotions: Any, phone_ends_s: NDArray[np.float64]) -> tuple[list[str], NDArray[np.float64]]:
    """The emotion that overlaps each phone most, and its intensity [P]."""
    starts = np.concatenate([[0.0], emotions.ends_s[:-1]])
    ends = np.concatenate([emotions.ends_s[:-1], [np.inf]])
    phone_starts = np.concatenate([[0.0], phone_ends_s[:-1]])
    overlap = np.minimum(phone_ends_s[:, None], ends) - np.maximum(phone_starts[:, None], starts)
    index = overlap.argmax(axis=1)
    return [emotions.labels[i] for i in index], emotions.intensities[index]
