"""Sound that was recorded apart from the video: how its clock lies against the camera's, and the motion on that clock."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.motion.irregular import read_at

RATE = 1000
"""Envelopes are compared at so many values a second: the offset is known to a millisecond."""
SMOOTH_S = 0.004
WINDOW_S = 10.0
"""Drift is read off pieces of this length, at least two of them; shorter recordings are too short to tell."""
SLACK_S = 0.5
"""So far may the pieces' offsets differ."""
INSIDE = 0.9
"""Share of a clip that must lie within a recorder's sound."""
LEAST_MATCH = 0.3
"""Correlation of the envelopes below which two sounds are not of the same event."""


@dataclass(frozen=True)
class Clock:
    """Time on the sound's clock = offset_s + (1 + drift) · time on the camera's."""

    offset_s: float
    drift: float
    """0 where it is not known."""
    match: float
    """Correlation of the two sounds' envelopes, -1..1."""
    drift_known: bool = True
    """Whether the recording was long enough to tell the drift."""

    def __str__(self) -> str:
        drift = (
            f"drift {self.drift * 1e6:+.0f} ppm" if self.drift_known else f"too short to tell a drift (under {2 * WINDOW_S:g} s)"
        )
        return f"moved by {self.offset_s * 1000:+.0f} ms to the separate sound, {drift}"


def clock_between(camera: NDArray[np.float32], camera_rate: int, sound: NDArray[np.float32], sound_rate: int) -> Clock:
    """The clock of a sound [S] against the sound [S'] that the camera recorded; FacesynthError where they do not match."""
    theirs, ours = _envelope(camera, camera_rate), _envelope(sound, sound_rate)
    offset, match = _offset(theirs, ours)
    if match < LEAST_MATCH:
        raise FacesynthError(
            f"the separate sound does not match the camera's own (correlation {match:.2f}, wanted {LEAST_MATCH});"
            " is it of another take?"
        )
    middles, offsets = _piecewise(theirs, ours, offset)
    if len(middles) < 2:
        return Clock(offset / RATE, 0.0, match, drift_known=False)
    drift, start = np.polyfit(middles, offsets, 1)
    return Clock(float(start) / RATE, float(drift), match)


@dataclass(frozen=True, eq=False)
class Recorder:
    """A sound that ran on while several clips were filmed."""

    audio: NDArray[np.float32]
    """[S]"""
    sample_rate: int
    envelope: Floats
    """How its loudness rises and falls."""

    @classmethod
    def of(cls, audio: NDArray[np.float32], sample_rate: int) -> "Recorder":
        """A recorder's sound, ready to be searched."""
        return cls(audio, sample_rate, _envelope(audio, sample_rate))

    def part_of(self, camera: NDArray[np.float32], camera_rate: int) -> NDArray[np.float32]:
        """The sound while a camera recorded its own [S']; FacesynthError where it is nowhere in it."""
        theirs = _envelope(camera, camera_rate)
        lag, match = _offset(theirs, self.envelope, least_overlap=INSIDE)
        if match < LEAST_MATCH:
            raise FacesynthError(
                f"the clip's own sound is nowhere in the recorder's (best correlation {match:.2f}, wanted {LEAST_MATCH})"
            )
        first, stop = (max(round(place / RATE * self.sample_rate), 0) for place in (lag, lag + len(theirs)))
        return self.audio[first:stop]


def on_clock(motion: Motion, clock: Clock) -> Motion:
    """The motion with frame i at i / fps on the sound's clock: cubic splines, NaN beyond its ends and at gaps."""
    count = max(round((clock.offset_s + (1 + clock.drift) * motion.duration_s) * motion.fps), 1)
    at = (np.arange(count) / motion.fps - clock.offset_s) / (1 + clock.drift) * motion.fps
    own = np.arange(len(motion), dtype=np.float64)
    head = None if motion.head is None else read_at(motion.head, own, at)
    eyes = None if motion.eyes is None else read_at(motion.eyes, own, at)
    if eyes is not None:
        eyes[:, 0] = np.clip(eyes[:, 0], 0, 1)
    return Motion(read_at(motion.frames, own, at), motion.fps, motion.layout, head, eyes)


def _envelope(audio: NDArray[np.float32], rate: int) -> Floats:
    """[S·RATE/rate] how the loudness rises and falls, whatever the microphone: differences of the log of the smoothed power."""
    edges = np.minimum(np.round(np.arange(int(len(audio) / rate * RATE) + 1) * rate / RATE).astype(np.int64), len(audio))
    power = np.diff(np.concatenate([[0.0], np.cumsum(np.square(audio, dtype=np.float64))])[edges])
    level = np.log(gaussian_filter1d(power, SMOOTH_S * RATE) + 1e-4 * power.max(initial=1e-12))
    return np.gradient(level) if len(level) > 1 else level


def _offset(theirs: Floats, ours: Floats, least_overlap: float = 0.0) -> tuple[int, float]:
    """By how many values `ours` lies later than `theirs`, and how well they then match.

    least_overlap: share of `theirs` that must lie within `ours`.
    """
    if len(ours) < least_overlap * len(theirs):
        raise FacesynthError("the recorder's sound is shorter than the clip")
    if min(len(theirs), len(ours)) < RATE // 5:
        raise FacesynthError("a sound of under 0.2 s cannot be matched with another")
    products = correlate(ours, theirs, mode="full")
    outside = int(least_overlap * len(theirs))
    lag = int(products[outside : len(products) - outside].argmax()) + outside - (len(theirs) - 1)
    first, stop = max(lag, 0), min(len(ours), len(theirs) + lag)
    a, b = ours[first:stop], theirs[first - lag : stop - lag]
    spread = np.sqrt((a @ a) * (b @ b))
    return lag, float(a @ b / spread) if spread > 0 else 0.0


def _piecewise(theirs: Floats, ours: Floats, offset: int) -> tuple[list[float], list[float]]:
    """Middle (values on the camera's clock) and offset of each piece that matches near the whole's offset."""
    window, slack = int(WINDOW_S * RATE), int(SLACK_S * RATE)
    middles, offsets = [], []
    for start in range(0, len(theirs) - window + 1, window):
        first = start + offset - slack
        piece = ours[max(first, 0) : max(start + offset + window + slack, 0)]
        if len(piece) < window:
            continue
        lag, match = _offset(theirs[start : start + window], piece)
        if match >= LEAST_MATCH:
            middles.append(start + window / 2)
            offsets.append(float(lag + max(first, 0) - start))
    return middles, offsets
