"""How often speech is taken for music, and music for speech.

python benchmarks/speech_or_music.py [--speech FOLDER ...] [--music FOLDER ...] [--soundfont FILE ...] [--longest 40]

Of folders of recordings of speech: how many of the phones that are heard are taken for something else, and in how many files.
Of folders of music, of instruments of a soundfont (each number of General MIDI but voices, a tune of 6 s) and of computed tunes:
in how many files something is said, before and after the decision, and in how many of those that is told as doubtful.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "train"))

from tunes import RATE, SUNG, Band, noise, tune

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech_or_music import is_speech
from facesynth.speech.audio import read_sound
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.recognition import speech_in, speech_or_music

SOUNDS = {".wav", ".flac", ".ogg", ".mp3", ".mpg", ".mp4", ".m4a"}
TUNE_S = 6.0
Sounds = Iterator[tuple[np.ndarray, int]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--speech", type=Path, nargs="*", default=[])
    parser.add_argument("--music", type=Path, nargs="*", default=[])
    parser.add_argument("--soundfont", type=Path, nargs="*", default=[])
    parser.add_argument("--longest", type=float, default=40.0, help="seconds of each file that are heard, from its middle")
    asked = parser.parse_args()
    print("| speech | files | phones heard | taken for something else | in files |")
    print("|---|---|---|---|---|")
    for folder in asked.speech:
        report_speech(folder.name, files(folder, asked.longest))
    print("\n| no speech | sounds | with phones, before | something said, after | told as doubtful |")
    print("|---|---|---|---|---|")
    for folder in asked.music:
        report_music(folder.name, files(folder, asked.longest))
    for font in asked.soundfont:
        report_music(f"instruments of {font.stem}", instruments(font))
    report_music("computed tunes", ((tune(np.random.default_rng([7, n]), TUNE_S), RATE) for n in range(100)))
    report_music("noise, hum, clicks, gusts", ((noise(np.random.default_rng([8, n]), TUNE_S), RATE) for n in range(60)))


def files(folder: Path, longest_s: float) -> Sounds:
    """The middle of every sound below a folder."""
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in SOUNDS):
        try:
            sound = read_sound(path)
        except FacesynthError as error:
            print(error, file=sys.stderr)
            continue
        first = max(0, round((len(sound.audio) / sound.sample_rate - longest_s) / 2 * sound.sample_rate))
        yield np.asarray(sound.audio[first : first + round(longest_s * sound.sample_rate)]), sound.sample_rate


def instruments(font: Path) -> Sounds:
    band = Band(font)
    for program in sorted(set(range(128)) - SUNG):
        yield band.play(np.random.default_rng([9, program]), TUNE_S, program), RATE


def report_speech(name: str, sounds: Sounds) -> None:
    taken, heard = [], 0
    for audio, rate in sounds:
        spikes, log_odds = phone_hearing().judged_spikes(audio, rate, speech_or_music())
        heard += len(spikes)
        taken.append(int((~is_speech(log_odds)).sum()))
    print(f"| {name} | {len(taken)} | {heard} | {sum(taken)} | {np.count_nonzero(taken)} |", flush=True)


def report_music(name: str, sounds: Sounds) -> None:
    count = before = said = doubted = 0
    for audio, rate in sounds:
        scaled = (0.5 * audio / (np.abs(audio).max() + 1e-9)).astype(np.float32)
        count += 1
        before += bool(phone_hearing().spikes(scaled, rate))
        try:
            _, remarks = speech_in(scaled, rate)
        except FacesynthError:
            continue
        said += 1
        doubted += any("in much doubt" in remark for remark in remarks)
    print(f"| {name} | {count} | {before} | {said} | {doubted} |", flush=True)


if __name__ == "__main__":
    main()
