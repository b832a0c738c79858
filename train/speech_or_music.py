"""Learn to tell speech from music by what the phone network's layers hold; writes the weights that come with facesynth.

python train/speech_or_music.py SPEECH... --soundfont FluidR3_GM.sf2 -o speech_or_music.npz [--scenes 160] [--seed 0]

SPEECH are folders of recordings of speech alone, each drawn as often; those of facesynth were GRID s1 (CC BY 4.0) twice, two
takes of FACEGOOD (MIT), one of BEAT2 (Apache-2.0), the built-in performer's voice and 80 voices of espeak-ng in 16 languages.
Scenes are made of them and of music and noise that nobody recorded (`tunes.py`; the soundfont FluidR3 is under the MIT licence),
one after the other at many levels. Speech is changed, too: sung to a tune or on one note, whispered, in noise, in a room, through
a telephone, over music that is softer, of another size or colour. A logistic regression tells, from the mean of all layers over
0.22 s, which of both sounds. Wanted beside facesynth: the extras `train` and `voice`, and tinysoundfont (MIT), which stands in
none, for it asks for pyaudio, which is compiled and not needed here: `pip install --no-deps tinysoundfont`.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyworld
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt
from sklearn.linear_model import LogisticRegression
from tunes import RATE, Band, Floats, Rng, in_a_room, noise, tune

from facesynth.inference.ear import STEP, Ear
from facesynth.inference.speech_or_music import SpeechOrMusic, smoothed
from facesynth.speech.audio import load_audio, resample
from facesynth.speech.phone_graph import phone_hearing

SCENE_S, PIECE_S = 20.0, 8.0
PITCH_FRAME_MS = 10.0
STRENGTH = 1e-3
"""Inverse of the penalty on the weights."""
EVERY = 3
"""Frames: neighbours hold the same."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path, nargs="+")
    parser.add_argument("--soundfont", type=Path, required=True)
    parser.add_argument("-o", "--output", type=Path, default=Path("speech_or_music.npz"))
    parser.add_argument("--scenes", type=int, default=160)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    # load
    rng = np.random.default_rng(options.seed)
    folders = [sorted(path for path in folder.iterdir() if path.is_file()) for folder in options.speech]
    band, ear = Band(options.soundfont), Ear(phone_hearing().network)

    # hear scenes
    heard, labels = [], []
    for number in range(options.scenes):
        sound, spoken = scene(rng, folders, band)
        hidden = ear.hear(sound)[1]
        means = smoothed(hidden.reshape(len(hidden), -1))
        told = np.flatnonzero(spoken[: len(means)] >= 0)[::EVERY]
        heard.append(means[told].astype(np.float16))
        labels.append(spoken[told])
        print(f"scene {number + 1} of {options.scenes}", end="\r", flush=True)

    # learn; the standardisation goes into the weights
    rows, spoken = np.concatenate(heard).astype(np.float32), np.concatenate(labels)
    mean, deviation = rows.mean(axis=0), rows.std(axis=0) + 1e-3
    learned = LogisticRegression(C=STRENGTH, max_iter=300).fit((rows - mean) / deviation, spoken)
    weights = learned.coef_[0] / deviation
    bias = float(learned.intercept_[0] - mean @ weights)
    rule = SpeechOrMusic(weights.astype(np.float32), bias)
    right = ((rows @ rule.weights + rule.bias > 0) == spoken).mean()
    print(f"{len(rows):,} frames, {spoken.mean():.0%} of them speech; told right {right:.1%}")
    np.savez(options.output, weights=rule.weights, bias=np.float32(bias))


def scene(rng: Rng, folders: Sequence[Sequence[Path]], band: Band) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """[S] sound, and of each of the network's frames whether it is speech (1), something else (0), or silent (-1)."""
    sounds, marks = zip(*_parts(rng, folders, band), strict=True)
    sound = np.concatenate(sounds)
    return (sound + rng.normal(0, 10 ** -rng.uniform(3, 4.5), len(sound))).astype(np.float32), np.concatenate(marks)[::STEP]


def _parts(rng: Rng, folders: Sequence[Sequence[Path]], band: Band) -> Iterator[tuple[Floats, NDArray[np.int64]]]:
    seconds, quietest_db, speech = 0.0, rng.choice([6.0, 25.0]), bool(rng.integers(2))
    while seconds < SCENE_S:
        if rng.random() < 0.15:
            pause = np.zeros(round(rng.uniform(0.2, 2) * RATE))
            yield pause, np.full(len(pause), -1)
        made = changed(piece(rng, folders), rng, band) if speech else no_speech(rng, band, rng.uniform(1, 6))
        made = made / (np.abs(made).max() + 1e-9) * 10 ** (-rng.uniform(0, quietest_db) / 20)
        yield made, np.where(sounding(made), int(speech), -1)
        seconds, speech = seconds + len(made) / RATE, not speech


def piece(rng: Rng, folders: Sequence[Sequence[Path]]) -> Floats:
    """[S] speech of any of the folders, at most PIECE_S of it."""
    files = folders[int(rng.integers(len(folders)))]
    audio, rate = load_audio(files[int(rng.integers(len(files)))])
    sound = resample(audio, rate, RATE)
    first = int(rng.integers(max(1, len(sound) - round(PIECE_S * RATE))))
    return sound[first : first + round(PIECE_S * RATE)].astype(np.float64)


def no_speech(rng: Rng, band: Band, seconds: float) -> Floats:
    kind = rng.random()
    return band.play(rng, seconds) if kind < 0.5 else tune(rng, seconds) if kind < 0.8 else noise(rng, seconds)


def changed(sound: Floats, rng: Rng, band: Band) -> Floats:
    """The same speech, worse or otherwise; one time in twelve as it is."""
    ways: tuple[tuple[int, Callable[[], Floats]], ...] = (
        (2, lambda: sung(sound, rng)),
        (1, lambda: sosfilt(butter(4, [300, 3400], "band", fs=RATE, output="sos"), sound)),
        (2, lambda: sound + rng.normal(0, level(sound) * 10 ** (-rng.uniform(3, 25) / 20), len(sound))),
        (2, lambda: over_music(sound, rng, band)),
        (1, lambda: in_a_room(sound, rng)),
        (1, lambda: np.interp(np.arange(0, len(sound) - 1, rng.uniform(0.8, 1.3)), np.arange(len(sound)), sound)),
        (2, lambda: brighter_or_duller(sound, rng)),
        (1, lambda: sound),
    )
    drawn = [way for times, way in ways for _ in range(times)]
    return drawn[rng.integers(len(drawn))]()


def over_music(sound: Floats, rng: Rng, band: Band) -> Floats:
    """Speech that is 4 to 20 dB louder than what plays."""
    music = no_speech(rng, band, len(sound) / RATE)
    music = np.pad(music, (0, max(0, len(sound) - len(music))))[: len(sound)]
    return sound + music * level(sound) / level(music) * 10 ** (-rng.uniform(4, 20) / 20)


def brighter_or_duller(sound: Floats, rng: Rng) -> Floats:
    """As a shout is against a murmur."""
    tilted = np.concatenate([[sound[0]], sound[1:] - rng.uniform(-0.9, 0.9) * sound[:-1]])
    return sosfilt(butter(1, rng.uniform(80, 500), "high", fs=RATE, output="sos"), tilted)


def sung(sound: Floats, rng: Rng) -> Floats:
    """Speech on one note, to a tune (slower), or whispered."""
    pitch, times_s = pyworld.dio(sound, RATE, frame_period=PITCH_FRAME_MS, f0_floor=65, f0_ceil=450)
    spectrum = pyworld.cheaptrick(sound, pitch, times_s, RATE)
    aperiodicity = pyworld.d4c(sound, pitch, times_s, RATE)
    middle = np.median(pitch[pitch > 0]) if pitch.any() else 150.0
    how, slower = rng.integers(3), rng.uniform(1, 2.2)
    if how == 0:
        wanted = np.where(pitch > 0, middle, 0)
    elif how == 1:
        rows = np.minimum(np.arange(round(len(pitch) * slower)) / slower, len(pitch) - 1).astype(int)
        notes = np.repeat(middle * 2 ** (rng.integers(-4, 8, 1 + len(rows) // 25) / 12), 25)[: len(rows)]
        trembling = 1 + 0.015 * np.sin(2 * np.pi * 5.5 * np.arange(len(rows)) * PITCH_FRAME_MS / 1000)
        wanted, spectrum, aperiodicity = np.where(pitch[rows] > 0, notes * trembling, 0), spectrum[rows], aperiodicity[rows]
    else:
        wanted = np.zeros(len(pitch))
    parts = (np.ascontiguousarray(values, np.float64) for values in (wanted, spectrum, aperiodicity))
    return pyworld.synthesize(*parts, RATE, PITCH_FRAME_MS)


def level(sound: Floats) -> float:
    """Root mean square of the louder 10 ms, four in ten."""
    power = np.square(sound[: len(sound) // 160 * 160]).reshape(-1, 160).mean(axis=1)
    return float(np.sqrt(np.sort(power)[-max(1, len(power) * 4 // 10) :].mean() + 1e-12))


def sounding(sound: Floats) -> NDArray[np.bool_]:
    """[S] where there is sound within 45 dB of the loudest, shorter pauses than 0.25 s among it."""
    frames = np.pad(sound, (0, -len(sound) % STEP)).reshape(-1, STEP)
    power = np.square(frames).mean(axis=1)
    loud = np.convolve(power > power.max() * 10**-4.5, np.ones(13), "same") > 0
    return np.repeat(loud, STEP)[: len(sound)]


if __name__ == "__main__":
    main()
