"""How well phones are heard without a transcript: `python benchmarks/phones.py FOLDER [--clips N] [--few N]`.

FOLDER holds any of `grid_s1`, `ravdess_speech` (words known: the reference is their alignment) and `haskins_ema` (phones
labelled by hand). Phone error is Levenshtein distance over phones of the reference, viseme error the same over viseme classes
with repeats merged; closures are p, b, m whose middles lie within 60 ms of each other, one to one: recall / precision, and how
many that were heard meet none (false). The real-time factor is processor time over the sound's length, on one thread.
Of the phones that people placed by hand it tells which a mark at each confidence would catch: a heard phone is right where one
of the same label lies over its middle.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import cycle, groupby
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from alignment import STATEMENTS, edits, spoken
from scipy.io import loadmat
from scipy.linalg import solve_toeplitz
from scipy.optimize import linear_sum_assignment
from scipy.signal import lfilter
from torchaudio.functional import bandpass_biquad, phase_vocoder

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, SILENCE, viseme_of
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.alignment import align
from facesynth.speech.audio import load_audio, resample
from facesynth.speech.decoder_recognition import recognise_by_decoder
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.recognition import recognise
from facesynth.speech.segments import phone_track, segments_of

NEAR_S = 0.06
SLACK_S = 0.03
RATE = 16000
TEN_MINUTES_S = 600
T = TypeVar("T")
Hear = Callable[[np.ndarray, int], PhoneTrack]


@dataclass
class Clip:
    audio: np.ndarray
    rate: int
    truth: PhoneTrack


@dataclass
class Score:
    """Sums over clips."""

    phones: int = 0
    wrong: int = 0
    visemes: int = 0
    wrong_visemes: int = 0
    closures: int = 0
    heard_closures: int = 0
    met: int = 0
    refused: int = 0
    processor_s: float = 0.0
    sound_s: float = 0.0

    def add(self, clip: Clip, hear: Hear) -> None:
        begun = time.process_time()
        try:
            heard = hear(clip.audio, clip.rate)
        except FacesynthError:
            self.refused += 1
            return
        self.processor_s += time.process_time() - begun
        self.sound_s += len(clip.audio) / clip.rate
        self.phones += len(spoken(clip.truth))
        self.wrong += edits(spoken(heard), spoken(clip.truth))
        self.visemes += len(visemes(clip.truth))
        self.wrong_visemes += edits(visemes(heard), visemes(clip.truth))
        wanted, got = closures(clip.truth), closures(heard)
        self.closures, self.heard_closures = self.closures + len(wanted), self.heard_closures + len(got)
        self.met += met(wanted, got)

    def __str__(self) -> str:
        per, ver = self.wrong / max(self.phones, 1), self.wrong_visemes / max(self.visemes, 1)
        recall, precision = self.met / max(self.closures, 1), self.met / max(self.heard_closures, 1)
        factor = self.processor_s / max(self.sound_s, 1e-9)
        lips = f"closures {recall:.3f} / {precision:.3f} of {self.closures}, {self.heard_closures - self.met} false"
        told = f"PER {per:.3f}  VER {ver:.3f}  {lips}  RTF {factor:.3f}"
        return told + (f"  refused {self.refused}" if self.refused else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=40, help="of each large set, taken evenly")
    parser.add_argument("--few", type=int, default=10, help="of each large set: heard as streams, in noise and worse")
    options = parser.parse_args()
    torch.set_num_threads(1)
    sets = {name: list(found(options.folder / name, options.clips)) for name, found in SETS.items()}
    ways: dict[str, Hear] = {
        "pocketsphinx": recognise_by_decoder,
        "network": partial(recognise, fit=False),
        "network, fitted": recognise,
    }
    scores = {name: report(name, clips, ways) for name, clips in sets.items()}
    for way in ways:
        both = [scores[name][way] for name in ("grid_s1", "ravdess_speech")]
        print(f"\n{way}, mean of GRID and RAVDESS: {means(both)}")
    report_marks(sets["haskins_ema"])
    few = [clip for name in ("grid_s1", "ravdess_speech") for clip in evenly(sets[name], options.few)]
    report("streams", few, {f"look-ahead {ahead_s} s": partial(streamed, ahead_s=ahead_s) for ahead_s in (0.1, 0.2, 0.4, 0.8)})
    for condition, change in conditions(few).items():
        report(condition, list(map(change, few)), {"network": ways["network"]})
    report("ten minutes in one", [strung(few, TEN_MINUTES_S)], {"network": ways["network"]})
    for name, audio in WITHOUT_SPEECH.items():
        print(f"\n{name}: {told(audio)}", flush=True)


def report_marks(clips: list[Clip]) -> None:
    """How many of the wrong phones a mark under each confidence catches, how many of the right ones it marks too."""
    heard = [(sure, right) for clip in clips for sure, right in judged(clip)]
    sure, right = np.array([s for s, _ in heard]), np.array([r for _, r in heard], bool)
    print(f"\nmarked where less sure, of {(~right).sum()} wrong and {right.sum()} right phones with hand labels")
    for level in (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98):
        caught, alarms = (sure[~right] < level).mean(), (sure[right] < level).mean()
        print(f"  {level:.2f}  wrong {caught:.2f}  right {alarms:.2f}  difference {caught - alarms:.2f}")


def judged(clip: Clip) -> Iterator[tuple[float, bool]]:
    """Confidence of each phone that is heard, and whether the same phone was placed over its middle by hand."""
    heard = recognise(clip.audio, clip.rate)
    said = segments_of(clip.truth)
    for (label, start_s, end_s), sure in zip(segments_of(heard), heard.confidences, strict=True):
        if label != SILENCE:
            middle_s = (start_s + end_s) / 2
            over = {one for one, begins_s, ends_s in said if begins_s - SLACK_S <= middle_s <= ends_s + SLACK_S}
            yield float(sure), label in over


def report(name: str, clips: list[Clip], ways: dict[str, Hear]) -> dict[str, Score]:
    print(f"\n{name}: {len(clips)} clips")
    scores = {way: Score() for way in ways}
    for way, hear in ways.items():
        for clip in clips:
            scores[way].add(clip, hear)
        print(f"  {way:20s} {scores[way]}", flush=True)
    return scores


def means(scores: list[Score]) -> str:
    """Errors as the mean of the sets, closures of all sets together."""
    per = np.mean([score.wrong / max(score.phones, 1) for score in scores])
    ver = np.mean([score.wrong_visemes / max(score.visemes, 1) for score in scores])
    right, wanted, got = (sum(getattr(score, part) for score in scores) for part in ("met", "closures", "heard_closures"))
    return f"PER {per:.3f}  VER {ver:.3f}  closures {right / max(wanted, 1):.3f} / {right / max(got, 1):.3f} of {wanted}"


def streamed(audio: np.ndarray, rate: int, ahead_s: float) -> PhoneTrack:
    stream = phone_hearing().stream(look_ahead_s=ahead_s)
    placed = [*stream.push(resample(audio, rate, RATE)), *stream.finish()]
    labels, ends_s, confidences = zip(*placed, strict=True)
    return PhoneTrack(labels, np.array(ends_s), np.array(confidences))


def grid(folder: Path, count: int) -> Iterator[Clip]:
    for film in evenly(sorted(folder.glob("*.mpg")), count):
        words = [line.split()[2] for line in film.with_suffix(".align").read_text().splitlines()]
        yield from aligned(film, " ".join(word for word in words if word not in ("sil", "sp")))


def ravdess(folder: Path, count: int) -> Iterator[Clip]:
    for path in evenly(sorted(folder.rglob("*.flac")), count):
        yield from aligned(path, STATEMENTS[path.stem.split("-")[4]])


def haskins(folder: Path, _count: int) -> Iterator[Clip]:
    for path in sorted(folder.glob("*.mat")):
        sound = next(v for k, v in loadmat(path, squeeze_me=True, struct_as_record=False).items() if not k.startswith("__"))[0]
        audio = (sound.SIGNAL / np.abs(sound.SIGNAL).max() / 2).astype(np.float32)
        yield Clip(audio, sound.SRATE, phone_track([(str(p.LABEL), *map(float, p.OFFS)) for p in sound.PHONES]))


SETS = {"grid_s1": grid, "ravdess_speech": ravdess, "haskins_ema": haskins}


def aligned(path: Path, text: str) -> Iterator[Clip]:
    audio, rate = load_audio(path)
    try:
        yield Clip(audio, rate, align(audio, rate, text).phones)
    except FacesynthError as error:
        print(f"{path.name} is left out: {error}")


def evenly(whole: list[T], count: int) -> list[T]:
    return [whole[i * len(whole) // count] for i in range(min(count, len(whole)))]


def conditions(clips: list[Clip]) -> dict[str, Callable[[Clip], Clip]]:
    rng = np.random.default_rng(0)

    def noisy(clip: Clip, decibel: float, noise: Callable[[Clip], np.ndarray]) -> Clip:
        added = noise(clip)
        gain = np.sqrt(np.mean(clip.audio**2) / np.mean(added**2)) * 10 ** (-decibel / 20)
        return Clip((clip.audio + gain * added).astype(np.float32), clip.rate, clip.truth)

    def white(clip: Clip) -> np.ndarray:
        return rng.standard_normal(len(clip.audio))

    def babble(clip: Clip) -> np.ndarray:
        others = [other.audio for other in clips if other is not clip]
        six = [others[i] for i in rng.choice(len(others), 6)]
        return np.sum([np.resize(audio / audio.std(), len(clip.audio)) for audio in six], axis=0)

    def telephone(clip: Clip) -> Clip:
        heard = bandpass_biquad(torch.from_numpy(clip.audio), clip.rate, 1010.0, 1010 / 3100)
        return Clip(resample(heard.numpy(), clip.rate, 8000), 8000, clip.truth)

    return {
        "clean": lambda clip: clip,
        **{f"white noise, {level} dB": partial(noisy, decibel=level, noise=white) for level in (20, 10, 5)},
        **{f"babble of six, {level} dB": partial(noisy, decibel=level, noise=babble) for level in (20, 10, 5)},
        "telephone band": telephone,
        "a quarter faster": partial(paced, factor=1.25),
        "a quarter slower": partial(paced, factor=0.8),
        "pitch and formants a quarter higher": lambda clip: moved(paced(clip, 0.8), 1.25),
        "whispered": whispered,
    }


def whispered(clip: Clip) -> Clip:
    """The vocal tract of the voice (linear prediction of 25 ms, order 18, at 16 kHz), driven by noise in place of its pulses."""
    audio = resample(clip.audio, clip.rate, RATE)
    window, hop, rng = np.hanning(400), 200, np.random.default_rng(0)
    out = np.zeros(len(audio) + 400)
    for start in range(0, len(audio) - 400, hop):
        piece = audio[start : start + 400] * window
        r = np.correlate(piece, piece, "full")[399:418]
        if r[0] < 1e-8:
            continue
        r[0] *= 1.0001
        a = np.concatenate([[1.0], -solve_toeplitz(r[:-1], r[1:])])
        breath = lfilter([1.0], a, rng.standard_normal(800))[400:] * window
        out[start : start + 400] += breath * np.sqrt(np.sum(piece**2) / np.sum(breath**2))
    return Clip(out[: len(audio)].astype(np.float32), RATE, clip.truth)


def strung(clips: list[Clip], least_s: float) -> Clip:
    """Clips one after the other, again and again, until they last so long."""
    sounds, said, now_s = [], [], 0.0
    for clip in cycle(clips):
        sounds.append(resample(clip.audio, clip.rate, RATE))
        said += [(label, now_s + a, now_s + min(b, len(sounds[-1]) / RATE)) for label, a, b in segments_of(clip.truth)]
        now_s += len(sounds[-1]) / RATE
        if now_s >= least_s:
            return Clip(np.concatenate(sounds), RATE, phone_track(said, now_s))


def told(audio: np.ndarray) -> str:
    """What is said of a sound in which nobody speaks."""
    try:
        heard = recognise(audio, RATE, fit=False)
    except FacesynthError as error:
        return str(error)
    sure = np.array([s for label, s in zip(heard.labels, heard.confidences, strict=True) if label != SILENCE])
    return f"{len(sure)} phones in {len(audio) / RATE:.0f} s, mean confidence {sure.mean():.2f}, {len(closures(heard))} closures"


def music(seconds: float, drums: bool) -> np.ndarray:
    """A tune of plucked strings over chords, with or without drums."""
    rng, t = np.random.default_rng(0), np.arange(round(0.25 * RATE)) / RATE
    notes = 220 * 2 ** (np.array([0, 3, 7, 10, 12, 10, 7, 3]) / 12)
    bars = []
    for beat in range(round(seconds / 0.25)):
        tones = [notes[beat % 8], 110.0, 110 * 2 ** (7 / 12)]
        sound = sum(np.sin(2 * np.pi * f * k * t) * np.exp(-3 * k * t) / k for f in tones for k in range(1, 9))
        bars.append(sound + drums * (beat % 2 == 0) * 2 * rng.standard_normal(len(t)) * np.exp(-40 * t))
    whole = np.concatenate(bars)
    return (0.3 * whole / np.abs(whole).max()).astype(np.float32)


NOISE = np.random.default_rng(1).standard_normal(10 * RATE).astype(np.float32)
WITHOUT_SPEECH = {
    "music, strings alone": music(20, drums=False),
    "music with drums": music(20, drums=True),
    "noise at -30 dB": 0.0316 * NOISE,
    "noise at -70 dB": 0.000316 * NOISE,
    "digital silence": np.zeros(10 * RATE, np.float32),
}
"""Sounds in which nobody speaks."""


def paced(clip: Clip, factor: float) -> Clip:
    """Said faster, pitch kept."""
    window = torch.hann_window(1024)
    spectrum = torch.stft(torch.from_numpy(clip.audio), 1024, 256, window=window, return_complex=True)
    advance = torch.linspace(0, np.pi * 256, 513)[:, None]
    sound = torch.istft(phase_vocoder(spectrum, factor, advance), 1024, 256, window=window).numpy()
    return Clip(sound, clip.rate, PhoneTrack(clip.truth.labels, clip.truth.ends_s / factor))


def moved(clip: Clip, factor: float) -> Clip:
    """Played faster: everything higher."""
    return Clip(clip.audio, round(clip.rate * factor), PhoneTrack(clip.truth.labels, clip.truth.ends_s / factor))


def visemes(track: PhoneTrack) -> list[int]:
    return [viseme for viseme, _ in groupby(map(viseme_of, spoken(track)))]


def closures(track: PhoneTrack) -> np.ndarray:
    return np.array([(start_s + end_s) / 2 for label, start_s, end_s in segments_of(track) if label in BILABIALS])


def met(wanted: np.ndarray, got: np.ndarray) -> int:
    """How many pairs lie near each other, at most."""
    near = np.abs(wanted[:, None] - got) <= NEAR_S
    return int(near[linear_sum_assignment(near, maximize=True)].sum())


if __name__ == "__main__":
    main()
