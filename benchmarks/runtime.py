"""Sizes, start-up time, real-time factors and streaming latency of exported folders, without torch.

python benchmarks/runtime.py SPEECH.wav PHONES.txt FOLDER...      (phones: lines of `end label`)
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

RUNTIME = Path(__file__).parents[1] / "export" / "runtime"
sys.path.insert(0, str(RUNTIME))

from facesynth_runtime import EmotionTrack, Speech, load, resample  # noqa: E402
from facesynth_runtime.__main__ import read_phones, read_wav  # noqa: E402

REPEATS = 7
"""The best of them counts: other work on the machine only ever adds."""
START = "import sys, time; began = time.perf_counter(); sys.path.insert(0, sys.argv[1]); from facesynth_runtime import load; "
START += "load(sys.argv[2]); print(time.perf_counter() - began, time.process_time())"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("speech", type=Path)
    parser.add_argument("phones", type=Path)
    parser.add_argument("folders", nargs="+", type=Path)
    options = parser.parse_args()
    audio, rate = read_wav(options.speech)
    phones = read_phones(options.phones, len(audio) / rate)
    print(f"{phones.duration_s:.2f} s of speech, {len(phones)} phones")
    print(
        "| folder | method | MB | start, s | real-time factor, 1 thread | 2 threads | streaming |\n"
        "|---|---|---:|---:|---:|---:|---|"
    )
    for folder in options.folders:
        row(folder, audio, rate, phones)


def row(folder, audio, rate, phones) -> None:
    size = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    start_s = best([started(folder) for _ in range(REPEATS)], 1.0)
    factors = []
    for threads in (1, 2):
        model = load(folder, threads=threads)
        speech = Speech(audio, rate, phones, EmotionTrack.constant(model.emotions[0], phones.duration_s))
        factors.append(best([timed(model, speech) for _ in range(REPEATS)], phones.duration_s))
    method = model.manifest["method"]
    print(f"| {folder.name} | {method} | {size:.2f} | {start_s} | {factors[0]} | {factors[1]} | {streaming(model, speech)} |")


def best(times, unit_s) -> str:
    """Least time by the clock and, in brackets, least time of the processor."""
    wall, processor = np.min(times, axis=0) / unit_s
    return f"{wall:.3f} ({processor:.3f})"


def started(folder) -> tuple[float, float]:
    """Seconds from nothing imported to a model that is ready, by the clock and of the processor."""
    command = [sys.executable, "-c", START, str(RUNTIME), str(folder)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(said[0]), float(said[1])


def timed(model, speech) -> tuple[float, float]:
    began, worked = time.perf_counter(), time.process_time()
    if hasattr(model, "detect"):
        model.detect_track(speech.audio, speech.sample_rate)
    else:
        model.synthesize(speech)
    return time.perf_counter() - began, time.process_time() - worked


def streaming(model, speech) -> str:
    """How late a frame comes after its own time, in time of the sound, and the longest computation of one piece."""
    method = model.manifest["method"]
    sound = resample(speech.audio, speech.sample_rate, 16000)
    late, longest = [], 0.0
    if method in ("lds", "emotion"):
        stream, given, size = model.stream(), 0, 160
        for at in range(0, len(sound), size):
            began = time.perf_counter()
            out = stream.push(sound[at : at + size])
            longest = max(longest, time.perf_counter() - began)
            heard_s = min(at + size, len(sound)) / 16000
            if method == "emotion":
                late += [heard_s - end_s for end_s, _ in out]
            else:
                late += [heard_s - (given + k) / model.fps for k in range(len(out))]
                given += len(out)
        return told("10 ms of sound a piece", late, longest)
    stream, given, at = model.stream(look_ahead=4), 0, 0
    for label, end_s in zip(speech.phones.labels, speech.phones.ends_s.tolist(), strict=True):
        began = time.perf_counter()
        out = [stream.hear(sound[at : round((end_s + 0.02) * 16000)])] if method == "anime_graph" else []
        at = round((end_s + 0.02) * 16000)
        feeling = model.emotions[0]
        out.append(stream.push(label, end_s, feeling))
        longest = max(longest, time.perf_counter() - began)
        count = sum(map(len, out))
        late += [end_s - (given + k) / model.fps for k in range(count)]
        given += count
    return told("look-ahead 4 phones, a phone a piece", late, longest)


def told(how, late_s, longest_s) -> str:
    if not late_s:
        return f"{how}: nothing before the end"
    mean_ms, most_ms = np.mean(late_s) * 1000, max(late_s) * 1000
    return f"{how}: {mean_ms:.0f} ms late on average, {most_ms:.0f} at most; {longest_s * 1000:.0f} ms longest step"


if __name__ == "__main__":
    main()
