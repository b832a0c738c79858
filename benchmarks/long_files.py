"""Peak memory and processor time for files of several lengths: `speak` to csv and mp4, and `corpus add`, with a transcript.

python benchmarks/long_files.py CORPUS MODEL [--minutes 1,5,15] [--phones] [--fps 10] [--keep FOLDER]

The recordings of CORPUS are strung together until a file is long enough; MODEL says it, with the transcript. Each command runs
in a process of its own, which tells its peak of resident memory. Pictures are small and few: their number changes no peak.
With --phones the corpus' own phones are given in place of the transcript, which spares the time of finding them.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile

from facesynth.corpus import Corpus

COMMANDS = ("speak to csv", "speak to mp4", "corpus add")
"""The second takes the phones that the first has written, to spare the time."""
PAUSE_S = 0.3
SIZE = "160x120"


TELLING = """
import atexit, re, runpy, sys, time
told = sys.argv.pop(1)

def tell():
    peak = re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]
    open(told, "w").write(f"{peak} {time.process_time()}")

atexit.register(tell)
sys.argv[0] = "facesynth"
runpy.run_module("facesynth", run_name="__main__")
"""
"""Runs facesynth, and says at its end how much memory it had (Linux)."""


class Long(NamedTuple):
    sound: Path
    motion: Path
    text: Path
    phones: Path
    layout: Path


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("corpus")
    parser.add_argument("model")
    parser.add_argument("--minutes", default="1,5,15")
    parser.add_argument("--phones", action="store_true")
    parser.add_argument("--commands", default=",".join(COMMANDS), help="some of them")
    parser.add_argument("--fps", default="10")
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    minutes = [float(part) for part in asked.minutes.split(",")]
    print("| command | " + " | ".join(f"{m:g} min" for m in minutes) + " | a minute more |")
    print("|---|" + "---|" * (len(minutes) + 1))
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.keep or Path(temporary)
        files = [long_file(Corpus.open(asked.corpus), 60 * m, folder / f"minutes_{m:g}") for m in minutes]
        for name in asked.commands.split(","):
            measured = []
            for m, file in zip(minutes, files, strict=True):
                measured.append(peak(command(name, asked.model, file, asked.fps, given=asked.phones)))
                print(f"{name}, {m:g} min: {measured[-1][0]:.0f} MB, {measured[-1][1]:.0f} s", file=sys.stderr, flush=True)
            cells = [f"{megabytes:.0f} MB, {processor_s:.0f} s" for megabytes, processor_s in measured]
            slope = (measured[-1][0] - measured[0][0]) / max(minutes[-1] - minutes[0], 1e-9)
            print(f"| {name} | " + " | ".join(cells) + f" | {slope:.1f} MB |", flush=True)


def long_file(corpus: Corpus, duration_s: float, folder: Path) -> Long:
    """Recordings of a corpus one after the other, with pauses: sound, motion of the same length and words."""
    folder.mkdir(parents=True, exist_ok=True)
    sounds, frames, texts, phones, now_s, rate = [], [], [], [], 0.0, 0
    for name in cycle(corpus.ids):
        speech, motion = corpus[name].speech, corpus[name].motion
        rate, length_s = speech.sample_rate, round(speech.duration_s + PAUSE_S, 1)
        if now_s + length_s > duration_s:
            break
        sounds.append(fitted(speech.audio[:, None], round(length_s * rate)))
        frames.append(fitted(motion.frames, round(length_s * motion.fps)))
        texts.append(speech.text)
        phones += [
            f"{now_s + end_s:.6f} {label}" for label, end_s in zip(speech.phones.labels, speech.phones.ends_s, strict=True)
        ]
        now_s += length_s
        phones.append(f"{now_s:.6f} pau")
    made = Long(*(folder / name for name in ("long.wav", "long.npz", "long.txt", "long.labels", "layout.yaml")))
    soundfile.write(made.sound, np.concatenate(sounds)[:, 0], rate)
    np.savez(made.motion, frames=np.concatenate(frames), fps=corpus.fps)
    made.text.write_text(" ".join(texts), encoding="utf-8")
    made.phones.write_text("\n".join(phones) + "\n", encoding="utf-8")
    made.layout.write_text((corpus.path / "corpus.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    return made


def fitted(values: np.ndarray, length: int) -> np.ndarray:
    """[length, C] values cut or held."""
    return np.pad(values[:length], ((0, max(0, length - len(values))), (0, 0)), mode="edge").astype(np.float32)


def command(name: str, model: str, file: Long, fps: str, *, given: bool) -> list[str]:
    said = ["--phones", str(file.phones)] if given else ["--text-file", str(file.text)]
    if name == "corpus add":
        corpus = file.sound.parent / "corpus"
        shutil.rmtree(corpus, ignore_errors=True)
        corpus.mkdir()
        (corpus / "corpus.yaml").write_text(file.layout.read_text(encoding="utf-8"), encoding="utf-8")
        return ["corpus", "add", str(corpus), str(file.sound), str(file.motion), *said, "--jobs", "1"]
    suffix = name.rsplit(maxsplit=1)[-1]
    grid = file.sound.with_name("spoken.TextGrid")
    if not given and suffix != "csv":
        said = ["--phones", str(grid)]
    asked = ["--fps", fps, "--size", SIZE, "-o", str(grid.with_suffix(f".{suffix}"))]
    return ["speak", model, str(file.sound), *said, *asked]


def peak(arguments: list[str]) -> tuple[float, float]:
    """Megabytes of the largest resident memory of `facesynth ARGUMENTS`, and its seconds of processor time.

    The process tells it of itself: what the system tells of an ended one counts the memory of whoever started it.
    """
    with tempfile.TemporaryDirectory() as folder:
        told, log = Path(folder) / "told", Path(folder) / "log"
        with open(log, "w", encoding="utf-8") as said:
            command = [sys.executable, "-c", TELLING, str(told), *arguments]
            done = subprocess.run(command, stdout=said, stderr=said, check=False)
        if done.returncode:
            raise SystemExit(f"facesynth {' '.join(arguments)} ended with {done.returncode}:\n{log.read_text(encoding='utf-8')}")
        kilobytes, processor_s = told.read_text(encoding="utf-8").split()
    return int(kilobytes) / 1024, float(processor_s)


if __name__ == "__main__":
    main()
