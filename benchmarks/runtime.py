"""Sizes, start-up time, real-time factors over several sentences and streaming latency of exported folders, without torch.

python benchmarks/runtime.py SENTENCES FOLDER... [--count 30] [--unlike MODEL.safetensors]

SENTENCES is a corpus (audio/ID.wav and phones/ID.TextGrid). Of its sentences some are drawn; with --unlike, from those whose
text the model's database does not have.
"""

import argparse
import csv
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from facesynth.inference import EmotionTrack, FacesynthError, PhoneTrack, Speech, load, resample
from facesynth.inference.wav import read_wav
from facesynth.speech.textgrid import read_textgrid

STARTS, REPEATS = 7, 3
"""The best of them counts: other work on the machine only ever adds."""
START = "import sys, time; began = time.perf_counter(); from facesynth.inference import load; "
START += "load(sys.argv[1]); print(time.perf_counter() - began, time.process_time())"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sentences", type=Path)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--unlike", type=Path)
    options = parser.parse_args()
    chosen = sentences(options.sentences, options.count, texts_of(options.unlike) if options.unlike else set())
    total_s = sum(speech.phones.duration_s for speech in chosen)
    print(f"{len(chosen)} sentences, {total_s:.0f} s of speech, {sum(len(speech.phones) for speech in chosen)} phones")
    print("Seconds, and real-time factors by the clock: mean over sentences, and the worst one; of the processor in brackets.\n")
    print("| folder | method | MB | start, s | 1 thread | worst | 2 threads | worst | streaming |")
    print("|---|---|---:|---:|---:|---:|---:|---:|---|")
    for folder in options.folders:
        row(folder, chosen)


def texts_of(model: Path) -> set[str]:
    """Utterances in a trained database."""
    import json

    from safetensors import safe_open

    with safe_open(model, "np") as file:
        known = [json.loads(value) for value in file.metadata().values() if value.startswith("{")]
    names = next(facts["names"] for facts in known for facts in (facts, facts.get("facts", {})) if "names" in facts)
    return {name.rsplit(":", 1)[0] for name in names}


def sentences(corpus: Path, count: int, known: set[str]) -> list[Speech]:
    with (corpus / "utterances.csv").open(encoding="utf-8", newline="") as file:
        rows = [line for line in csv.DictReader(file) if line["usable"] == "yes"]
    said = {line["text"] for line in rows if line["id"] in known}
    rows = [line for line in rows if line["text"] not in said]
    if not rows:
        raise SystemExit(f"{corpus} has no usable sentence that the database does not have")
    chosen = []
    for place in np.random.default_rng(0).permutation(len(rows))[:count].tolist():
        audio, rate = read_wav(corpus / "audio" / f"{rows[place]['id']}.wav")
        track, _ = read_textgrid(corpus / "phones" / f"{rows[place]['id']}.TextGrid")
        phones = PhoneTrack(track.labels, track.ends_s)
        chosen.append(Speech(audio, rate, phones, EmotionTrack.constant(rows[place]["emotion"], phones.duration_s)))
    return chosen


def row(folder, chosen) -> None:
    size = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    start_s = best([started(folder) for _ in range(STARTS)])
    factors = []
    for threads in (1, 2):
        model = load(folder, threads=threads)
        timed(model, chosen[0])
        each = [np.min([timed(model, speech) for _ in range(REPEATS)], axis=0) / speech.phones.duration_s for speech in chosen]
        factors += [told_pair(np.mean(each, axis=0)), told_pair(np.max(each, axis=0))]
    method = model.manifest["method"]
    times = " | ".join(factors)
    print(f"| {folder.name} | {method} | {size:.2f} | {start_s} | {times} | {streaming(model, chosen[0])} |", flush=True)


def best(times) -> str:
    """Least time by the clock and, in brackets, least time of the processor."""
    return told_pair(np.min(times, axis=0))


def told_pair(pair) -> str:
    return f"{pair[0]:.3f} ({pair[1]:.3f})"


def started(folder) -> tuple[float, float]:
    """Seconds from nothing imported to a model that is ready, by the clock and of the processor."""
    command = [sys.executable, "-c", START, str(folder)]
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
    if method == "network":
        return "by benchmarks/streams.py"
    try:
        stream, given, at = model.stream(look_ahead=4), 0, 0
    except FacesynthError:
        return "whole utterances"
    for label, end_s in zip(speech.phones.labels, speech.phones.ends_s.tolist(), strict=True):
        began = time.perf_counter()
        out = [stream.hear(sound[at : round((end_s + 0.02) * 16000)])] if method == "anime_graph" else []
        at = round((end_s + 0.02) * 16000)
        feeling = speech.emotions.labels[0]
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
