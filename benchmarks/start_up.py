"""What it takes to start: python benchmarks/start_up.py [MODEL] [--times 5]

`facesynth speak MODEL` writes 3 s of speech with phones given as a table of curves, in a process of its own. Printed are the
least and the middle processor time of so many, which depend less on who else is at work than the time on the clock does.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import wave
from pathlib import Path
from statistics import median

import numpy as np

from facesynth.zoo.shelf import DEFAULT

RATE, DURATION_S = 16000, 3.0
PHONES = "0.3 pau\n0.45 m\n0.7 ay\n0.85 n\n1.1 ey\n1.3 m\n1.5 ih\n1.7 z\n1.9 p\n2.2 ow\n2.5 l\n3.0 pau\n"


def main(model: str, times: int) -> None:
    with tempfile.TemporaryDirectory() as place:
        sound, phones = Path(place) / "line.wav", Path(place) / "line.lab"
        phones.write_text(PHONES, encoding="utf-8")
        write_hum(sound)
        command = [sys.executable, "-m", "facesynth", "speak", model, str(sound), "--phones", str(phones)]
        each = [processor_s([*command, "-o", str(Path(place) / f"line_{k}.csv")]) for k in range(times)]
    print(f"{model}: 3 s to csv, phones given: {min(each):.2f} s of processor time at least, {median(each):.2f} s in the middle")


def processor_s(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def write_hum(path: Path) -> None:
    """A voice-like sound of 120 Hz."""
    time_s = np.arange(round(DURATION_S * RATE)) / RATE
    hum = sum(np.sin(2 * np.pi * 120 * k * time_s) / k for k in range(1, 20)) * np.sin(np.pi * time_s / DURATION_S)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes((4000 * hum).astype("<i2").tobytes())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", default=DEFAULT)
    parser.add_argument("--times", type=int, default=5)
    options = parser.parse_args()
    main(options.model, options.times)
