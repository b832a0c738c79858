"""Peak memory and processor time for files of several lengths: `speak` to csv and mp4, and `corpus add`, with a transcript.

python benchmarks/long_files.py CORPUS MODEL [--minutes 1,5,15] [--keep FOLDER]

The recordings of CORPUS are strung together until a file is long enough; MODEL says it, with the transcript. Each command runs
in a process of its own, whose peak of resident memory the system tells. Pictures are small and few: their number changes no peak.
"""

import argparse
import os
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
FPS, SIZE = "10", "160x120"


class Long(NamedTuple):
    sound: Path
    motion: Path
    text: Path
    layout: Path


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("corpus")
    parser.add_argument("model")
    parser.add_argument("--minutes", default="1,5,15")
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    minutes = [float(part) for part in asked.minutes.split(",")]
    print("| command | " + " | ".join(f"{m:g} min" for m in minutes) + " | a minute more |")
    print("|---|" + "---|" * (len(minutes) + 1))
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.keep or Path(temporary)
        files = [long_file(Corpus.open(asked.corpus), 60 * m, folder / f"minutes_{m:g}") for m in minutes]
        for name in COMMANDS:
            measured = []
            for m, file in zip(minutes, files, strict=True):
                measured.append(peak(command(name, Path(asked.model), file)))
                print(f"{name}, {m:g} min: {measured[-1][0]:.0f} MB, {measured[-1][1]:.0f} s", file=sys.stderr, flush=True)
            cells = [f"{megabytes:.0f} MB, {processor_s:.0f} s" for megabytes, processor_s in measured]
            slope = (measured[-1][0] - measured[0][0]) / max(minutes[-1] - minutes[0], 1e-9)
            print(f"| {name} | " + " | ".join(cells) + f" | {slope:.1f} MB |", flush=True)


def long_file(corpus: Corpus, duration_s: float, folder: Path) -> Long:
    """Recordings of a corpus one after the other, with pauses: sound, motion of the same length and words."""
    folder.mkdir(parents=True, exist_ok=True)
    sounds, frames, texts, now_s, rate = [], [], [], 0.0, 0
    for name in cycle(corpus.ids):
        speech, motion = corpus[name].speech, corpus[name].motion
        rate, length_s = speech.sample_rate, round(speech.duration_s + PAUSE_S, 1)
        if now_s + length_s > duration_s:
            break
        sounds.append(fitted(speech.audio[:, None], round(length_s * rate)))
        frames.append(fitted(motion.frames, round(length_s * motion.fps)))
        texts.append(speech.text)
        now_s += length_s
    made = Long(*(folder / name for name in ("long.wav", "long.npz", "long.txt", "layout.yaml")))
    soundfile.write(made.sound, np.concatenate(sounds)[:, 0], rate)
    np.savez(made.motion, frames=np.concatenate(frames), fps=corpus.fps)
    made.text.write_text(" ".join(texts), encoding="utf-8")
    made.layout.write_text((corpus.path / "corpus.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    return made


def fitted(values: np.ndarray, length: int) -> np.ndarray:
    """[length, C] values cut or held."""
    return np.pad(values[:length], ((0, max(0, length - len(values))), (0, 0)), mode="edge").astype(np.float32)


def command(name: str, model: Path, file: Long) -> list[str]:
    if name == "corpus add":
        corpus = file.sound.parent / "corpus"
        shutil.rmtree(corpus, ignore_errors=True)
        corpus.mkdir()
        (corpus / "corpus.yaml").write_text(file.layout.read_text(encoding="utf-8"), encoding="utf-8")
        return ["corpus", "add", str(corpus), str(file.sound), str(file.motion), "--text-file", str(file.text), "--jobs", "1"]
    suffix = name.rsplit(maxsplit=1)[-1]
    grid = file.sound.with_name("spoken.TextGrid")
    said = ["--text-file", str(file.text)] if suffix == "csv" else ["--phones", str(grid)]
    asked = ["--fps", FPS, "--size", SIZE, "-o", str(grid.with_suffix(f".{suffix}"))]
    return ["speak", str(model), str(file.sound), *said, *asked]


def peak(arguments: list[str]) -> tuple[float, float]:
    """Megabytes of the largest resident memory of `facesynth ARGUMENTS`, and its seconds of processor time."""
    log = Path(tempfile.gettempdir()) / f"long_files_{os.getpid()}.log"
    with open(log, "w", encoding="utf-8") as said:
        process = subprocess.Popen([sys.executable, "-m", "facesynth", *arguments], stdout=said, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"facesynth {' '.join(arguments)} ended with {process.returncode}:\n{log.read_text(encoding='utf-8')}")
    return used.ru_maxrss / 1024, used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
