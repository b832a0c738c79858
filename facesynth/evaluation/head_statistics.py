"""How a head moves, as distributions: a head may be unlike the recorded one at every moment and still move like a person's."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from scipy.stats import ks_2samp

from facesynth.evaluation.pair import Array
from facesynth.inference.head.voice import pitch_windows
from facesynth.inference.motion import Motion
from facesynth.inference.pitch import RATE
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech

SMOOTHING_S = 0.04
"""Standard deviation of a smoothing that takes the noise of cameras out of recorded speeds; made ones get the same."""
PAUSE_DB = -30.0
"""What is fainter than the loudest tenth by this is a pause."""
BANDS_HZ = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
SPECTRUM_S = 2.0
"""Length of the windows of the spectrum."""


@dataclass(frozen=True, eq=False)
class HeadSample:
    """One head, taken apart."""

    speech_speed: Array
    """[n] deg/s while something is said."""
    pause_speed: Array
    """[m] deg/s in pauses."""
    ranges: Array
    """[3] largest less smallest pitch, yaw and roll, deg."""
    power: Array
    """[bands] share of the power of angular velocity in BANDS_HZ; sums to 1 where the head moves."""


def take_apart(motion: Motion, speech: Speech) -> HeadSample:
    """What a head does in one utterance; its pose must be known all along."""
    assert motion.head is not None  # noqa: S101 - chosen by the caller
    turns = Rotation.from_rotvec(motion.head[:, :3].astype(np.float64))
    angles = np.unwrap(turns.as_euler("YXZ"), axis=0)
    smooth = np.degrees(gaussian_filter1d(angles, SMOOTHING_S * motion.fps, axis=0, mode="nearest"))
    velocity = np.diff(smooth, axis=0) * motion.fps
    speed = np.linalg.norm(velocity, axis=1)
    pause = pauses(speech, motion.fps, len(speed))
    return HeadSample(speed[~pause], speed[pause], np.ptp(smooth, axis=0), _band_power(velocity, motion.fps))


def pauses(speech: Speech, fps: float, count: int) -> NDArray[np.bool_]:
    """[count] frames in which nothing is said."""
    audio = resample(speech.audio, speech.sample_rate, RATE)
    level = np.sqrt(np.square(pitch_windows(fps).cut(audio, 0, 0, count).astype(np.float64)).mean(axis=1))
    return np.asarray(level < np.percentile(level, 90) * 10 ** (PAUSE_DB / 20))


def distances(made: Sequence[HeadSample], recorded: Sequence[HeadSample]) -> dict[str, float]:
    """0 (alike) to 1: Kolmogorov-Smirnov for speeds and ranges, half the absolute difference for shares of power.

    `pause_ratio` is the mean speed in pauses over that in speech, of the made heads (1).
    """
    speech_speed, pause_speed = (_both(made, recorded, name) for name in ("speech_speed", "pause_speed"))
    powers = [np.mean([sample.power for sample in samples], axis=0) for samples in (made, recorded)]
    return {
        "speed in speech": float(ks_2samp(*speech_speed).statistic),
        "speed in pauses": float(ks_2samp(*pause_speed).statistic) if min(map(len, pause_speed)) else float("nan"),
        "range": float(
            np.mean([ks_2samp(*(np.array([s.ranges[k] for s in side]) for side in (made, recorded))).statistic for k in range(3)])
        ),
        "spectrum": float(np.abs(powers[0] - powers[1]).sum() / 2),
        "pause ratio": float(pause_speed[0].mean() / max(speech_speed[0].mean(), 1e-9)) if len(pause_speed[0]) else float("nan"),
    }


def _both(made: Sequence[HeadSample], recorded: Sequence[HeadSample], name: str) -> tuple[Array, Array]:
    return np.concatenate([getattr(s, name) for s in made]), np.concatenate([getattr(s, name) for s in recorded])


def _band_power(velocity: Array, fps: float) -> Array:
    length = min(len(velocity), round(SPECTRUM_S * fps))
    starts = range(0, len(velocity) - length + 1, max(1, length // 2))
    taper = np.hanning(length)[:, None]
    power = np.sum([np.square(np.abs(np.fft.rfft(velocity[a : a + length] * taper, axis=0))).sum(axis=1) for a in starts], axis=0)
    hz = np.fft.rfftfreq(length, 1 / fps)
    shares = np.array([power[(hz >= low) & (hz < high)].sum() for low, high in pairwise(BANDS_HZ)])
    return shares / max(float(shares.sum()), 1e-12)
