"""Statistics of a voice by which emotions differ, none of which depends on how loud the recording is."""

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .contours import HOP, Contours, FrontEnd, contours
from .ear import FRAMES_PER_S, RATE, Ear
from .graphs import Part

PERCENTILES = (10, 50, 90)
STRETCHES = 5
"""Into how many stretches an utterance is cut to see where it rises and falls."""
LAYERS = slice(0, 3)
"""Hidden layers of the phone network that emotions are read from; the last one tells phones apart and little else."""
MODULATION_HZ = ((0.5, 2), (2, 4), (4, 8), (8, 16), (16, 32))


def voice_features(audio: NDArray[np.float32], front: FrontEnd) -> Floats:
    """Audio [S] at 16 kHz to [187]: timbre, pitch, dynamics, colour of the voiced, rhythm, course.

    FacesynthError where it is constant or too short.
    """
    return _statistics(contours(audio, front))


def heard_voice_features(audio: NDArray[np.float32], front: FrontEnd, network: Part) -> Floats:
    """The same and [864] what the phone network makes of the voice: [1051].

    The network was trained to hear phones of anybody, and what its layers take into account for that (who speaks, how
    high, how tense) is what differs between emotions: mean and spread of LAYERS while somebody speaks.
    """
    voice = contours(audio, front)
    hidden = Ear(network).hear(audio)[1][:, LAYERS]
    begin = round(voice.begin_s * FRAMES_PER_S)
    count = max(1, round(len(voice.level) * HOP / RATE * FRAMES_PER_S))
    spoken = hidden[begin : begin + count].astype(np.float64)
    pooled = np.concatenate([spoken.mean(axis=0), spoken.std(axis=0)], axis=1).ravel()
    return np.concatenate([_statistics(voice), pooled])


def _statistics(voice: Contours) -> Floats:
    return np.concatenate([_timbre(voice), _melody(voice), _dynamics(voice), _colour(voice), _rhythm(voice), _course(voice)])


def _timbre(voice: Contours) -> Floats:
    """[58] mean and spread of the cepstra but the first, which is loudness; spread of their slopes."""
    shape = voice.cepstra[:, 1:]
    return np.concatenate([shape.mean(axis=0), shape.std(axis=0), _slopes(voice.cepstra).std(axis=0)])


def _melody(voice: Contours) -> Floats:
    """[14] where the pitch lies, how far and how fast it moves, which way it bends, how clear the voice is."""
    pitch, clear = voice.pitch[voice.voiced], voice.periodicity
    place = np.linspace(-1, 1, len(pitch))
    spread = np.percentile(pitch, [5, 20, 50, 80, 95])
    moving = np.abs(np.diff(pitch)).mean()
    bends = (np.polyfit(place, pitch, 2)[0], np.polyfit(place, pitch, 1)[0])
    span = np.ptp(np.percentile(pitch, [10, 90]))
    clarity = (clear[voice.voiced].mean(), clear.mean())
    return np.array([pitch.mean(), pitch.std(), *spread, span, voice.voiced.mean(), moving, *clarity, *bends])


def _dynamics(voice: Contours) -> Floats:
    """[10] spread of the level, how fast it moves, how much of the time is near the loudest; length."""
    level = voice.level
    near = ((level > -1).mean(), (level > -2).mean())
    spread = np.percentile(level, [10, 25, 50, 75, 90])
    return np.array([level.std(), *spread, np.abs(np.diff(level)).mean(), *near, np.log(len(level) / 100)])


def _colour(voice: Contours) -> Floats:
    """[40] mean, spread and percentiles of the spectrum's colour where the voice sounds."""
    sounding = voice.colour[voice.voiced]
    spread = np.percentile(sounding, PERCENTILES, axis=0).ravel()
    return np.concatenate([sounding.mean(axis=0), sounding.std(axis=0), spread])


def _rhythm(voice: Contours) -> Floats:
    """[50] how strongly ten bands are modulated at five ranges of rate."""
    bands = voice.bands.reshape(len(voice.bands), 10, -1).mean(axis=2)
    length = max(512, len(bands))
    power = np.square(np.abs(np.fft.rfft(bands - bands.mean(axis=0), length, axis=0)))
    rate_hz = np.fft.rfftfreq(length, 0.01)
    strength = [power[(rate_hz >= low) & (rate_hz < high)].mean(axis=0) / len(bands) for low, high in MODULATION_HZ]
    return np.log(np.array(strength) + 1e-6).ravel()


def _course(voice: Contours) -> Floats:
    """[15] pitch, level and brightness in five stretches of the utterance."""
    stretches = np.array_split(np.arange(len(voice.level)), STRETCHES)
    middle = float(np.median(voice.pitch[voice.voiced]))
    pitch = [_median(voice.pitch[s][voice.voiced[s]], middle) for s in stretches]
    level = np.array([voice.level[s].mean() for s in stretches])
    return np.concatenate([pitch, level - level.mean(), [voice.colour[s, 1].mean() for s in stretches]])


def _median(values: Floats, otherwise: float) -> float:
    return float(np.median(values)) if len(values) > 2 else otherwise


def _slopes(tracks: Floats) -> Floats:
    """[T, D] slope of a line through five frames."""
    padded = np.pad(tracks, ((2, 2), (0, 0)), mode="edge")
    return (padded[3:-1] - padded[1:-3] + 2 * (padded[4:] - padded[:-4])) / 10
