"""Sounds in which nobody speaks: notes of instruments of a soundfont, computed notes, noise; for `speech_or_music.py`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, fftconvolve, lfilter, sosfilt

Floats = NDArray[np.floating]
Rng = np.random.Generator
RATE = 16000
SCALES = ((0, 2, 4, 5, 7, 9, 11), (0, 2, 3, 5, 7, 8, 10), (0, 2, 4, 7, 9), (0, 3, 5, 7, 10), tuple(range(12)))
SUNG = {52, 53, 54, 85, 91}
"""Instruments of General MIDI that imitate voices: neither speech nor none."""
DRUMS = (35, 36, 38, 40, 41, 42, 44, 45, 46, 47, 49, 51)


def durations_s(rng: Rng, seconds: float) -> Floats:
    """Of notes that last so long together."""
    beat_s = rng.uniform(0.09, 0.6)
    count = int(np.ceil(2 * seconds / beat_s))
    found = beat_s * rng.choice([0.5, 1, 1, 1, 2], count)
    return found[: int(np.searchsorted(np.cumsum(found), seconds)) + 1]


def melody(rng: Rng, count: int) -> list[int]:
    """Keys of MIDI that wander up and down a scale."""
    scale = SCALES[rng.integers(len(SCALES))]
    root = int(rng.integers(45, 77))
    steps = np.clip(rng.integers(0, len(scale)) + np.cumsum(rng.integers(-3, 4, count)), 0, 2 * len(scale) - 1)
    return [root + 12 * (step // len(scale)) + scale[step % len(scale)] for step in map(int, steps)]


class Band:
    """Plays the instruments of a soundfont (with the package tinysoundfont)."""

    def __init__(self, path: Path) -> None:
        try:
            import tinysoundfont
        except ImportError as error:
            raise SystemExit("tinysoundfont plays the soundfont: pip install --no-deps tinysoundfont") from error
        self.synth = tinysoundfont.Synth(samplerate=RATE, gain=-6)
        self.font = self.synth.sfload(str(path))

    def play(self, rng: Rng, seconds: float, program: int | None = None) -> Floats:
        """[S] one instrument, its notes or chords, the one that is named or any; now and then drums."""
        drums = program is None and bool(rng.random() < 0.08)
        program = int(rng.choice([number for number in range(128) if number not in SUNG])) if program is None else program
        chords, rest = bool(rng.random() < 0.4), rng.uniform(0, 0.3)
        self.synth.sounds_off()
        self.synth.program_select(0, self.font, 128 if drums else 0, 0 if drums else program, drums)
        lengths = durations_s(rng, seconds)
        keys = rng.choice(DRUMS, len(lengths)).tolist() if drums else melody(rng, len(lengths))
        return np.concatenate(
            [
                part
                for key, length in zip(keys, lengths, strict=True)
                for part in self._note(
                    [key, key + 4 - int(rng.integers(2)), key + 7] if chords and not drums else [key], length, rest, rng
                )
            ]
        )[: round(seconds * RATE)]

    def _note(self, keys: list[int], length_s: float, rest: float, rng: Rng) -> list[Floats]:
        loud = int(rng.integers(60, 120))
        for key in keys:
            self.synth.noteon(0, key, loud)
        held = self._sound(length_s * (1 - rest))
        for key in keys:
            self.synth.noteoff(0, key)
        return [held, self._sound(length_s * rest)]

    def _sound(self, seconds: float) -> Floats:
        stereo = np.frombuffer(bytes(self.synth.generate(max(1, round(seconds * RATE)))), np.float32)
        return stereo.reshape(-1, 2).mean(axis=1)


def partials(phase: Floats, times_s: Floats, strengths: Floats, decay: float) -> Floats:
    """[S] overtones that die away, the higher ones sooner."""
    return np.sum(
        [a * np.sin(k * phase) * np.exp(-decay * np.sqrt(k) * times_s) for k, a in enumerate(strengths, start=1)], axis=0
    )


def plucked(hz: float, count: int, rng: Rng) -> Floats:
    """[count] a string (Karplus & Strong 1983): noise that goes round in a loop with a mean of two neighbours."""
    period = max(2, round(RATE / hz))
    loop = np.zeros(period + 2)
    loop[[0, period, period + 1]] = 1, -0.498, -0.498
    struck = np.zeros(count)
    struck[:period] = rng.uniform(-1, 1, period)[:count]
    return lfilter([1], loop, struck)


def timbre(rng: Rng) -> Callable[[float, Floats, Floats], Floats]:
    """A way to make a note from its pitch in Hz, its phase [S] and times [S]."""
    falling, decay, ratio, depth = (
        rng.uniform(0, 2),
        rng.choice([0, 0, 1, 3, 6]),
        rng.choice([1, 1.41, 2, 3, 3.5]),
        rng.uniform(0.5, 6),
    )
    drawn = rng.exponential(1, 20)
    ways: tuple[Callable[[float, Floats, Floats], Floats], ...] = (
        lambda hz, phase, t: np.sin(phase),
        lambda hz, phase, t: plucked(hz, len(t), rng),
        lambda hz, phase, t: np.sin(phase + depth * np.exp(-3 * t) * np.sin(ratio * phase)),
        lambda hz, phase, t: partials(phase, t, (np.arange(20) % 2 == 0)[: count(hz)] / np.arange(1.0, 21)[: count(hz)], decay),
        lambda hz, phase, t: partials(phase, t, 1 / np.arange(1.0, 21)[: count(hz)], decay),
        lambda hz, phase, t: partials(phase, t, drawn[: count(hz)] * np.arange(1.0, 21)[: count(hz)] ** -falling, decay),
        lambda hz, phase, t: np.sum(
            [np.sin(r * phase) * np.exp(-(1 + r) * t) for r in (1, 2.76, 5.4, 8.9) if r * hz < RATE / 2], axis=0
        ),
    )

    def count(hz: float) -> int:
        return max(1, min(20, int(7500 / hz)))

    return ways[rng.integers(len(ways))]


def tune(rng: Rng, seconds: float) -> Floats:
    """[S] computed notes or chords, with vibrato, a bass, noise and a room now and then."""
    note = timbre(rng)
    lengths = durations_s(rng, seconds)
    chords, bass, attack_s, held = rng.random() < 0.3, rng.random() < 0.3, rng.uniform(0.002, 0.06), rng.uniform(0.6, 1)
    depth = rng.uniform(0.005, 0.04) * (rng.random() < 0.35)
    trembling_hz, root = rng.uniform(4, 7.5), int(rng.integers(36, 50))
    parts = []
    for key, length_s in zip(melody(rng, len(lengths)), lengths, strict=True):
        t = np.arange(round(length_s * RATE)) / RATE
        sounds = []
        for one in [key, *([key + 4, key + 7] if chords else []), *([root] if bass else [])]:
            hz = 440 * 2 ** ((one - 69) / 12)
            phase = 2 * np.pi * np.cumsum(hz * (1 + depth * np.sin(2 * np.pi * trembling_hz * t))) / RATE
            made = note(hz, phase, t)
            sounds.append(made / (np.abs(made).max() + 1e-9))
        parts.append(np.sum(sounds, axis=0) * np.minimum(1, t / attack_s) * np.clip((length_s * held - t) / 0.02, 0, 1))
    sound = np.concatenate(parts)[: round(seconds * RATE)]
    if rng.random() < 0.3:
        sound = in_a_room(sound, rng)
    return sound + rng.normal(0, 1, len(sound)) * np.abs(sound).max() * 10 ** rng.uniform(-3, -1.5) * (rng.random() < 0.3)


def in_a_room(sound: Floats, rng: Rng) -> Floats:
    """[S] with an echo that dies away."""
    echo = rng.normal(0, 1, 6400) * np.exp(-np.arange(6400) / RATE * rng.uniform(8, 25))
    echo[0] = 8
    return fftconvolve(sound, echo)[: len(sound)]


def noise(rng: Rng, seconds: float) -> Floats:
    """[S] noise of a colour, gusts and breaths, clicks, hum, a siren, beats."""
    count = round(seconds * RATE)
    t, white = np.arange(count) / RATE, rng.normal(0, 1, round(seconds * RATE))
    low = rng.uniform(100, 2500)
    band = sosfilt(butter(2, [low, min(7500, low * rng.uniform(1.3, 6))], "band", fs=RATE, output="sos"), white)
    clicks = (rng.random(count) < rng.uniform(2, 12) / RATE) * rng.uniform(-1, 1, count)
    kinds = (
        white,
        np.cumsum(white - white.mean()),
        band * (0.15 + np.sin(np.pi * t / rng.uniform(0.5, 2.5)) ** 2),
        sosfilt(butter(2, [300, 6000], "band", fs=RATE, output="sos"), clicks),
        np.sum([np.sin(2 * np.pi * 50 * k * t + k) / k for k in (1, 2, 3, 5, 7)], axis=0) + 0.05 * white,
        np.sin(2 * np.pi * np.cumsum(rng.uniform(500, 900) + 300 * np.sin(2 * np.pi * t * rng.uniform(0.2, 2))) / RATE),
        white * np.exp(-rng.uniform(10, 50) * (t % rng.uniform(0.15, 0.6))),
    )
    return kinds[rng.integers(len(kinds))]
