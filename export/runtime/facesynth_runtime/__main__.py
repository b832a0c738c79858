"""`facesynth-runtime FOLDER SOUND.wav …`: motion, or an emotion, from the command line."""

from __future__ import annotations

import argparse
import json
import sys
import wave
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth_runtime.errors import RuntimeInputError
from facesynth_runtime.load import load
from facesynth_runtime.tracks import EmotionTrack, PhoneTrack, Speech


def main(arguments: list[str] | None = None) -> None:
    """Speak, or say which emotion is heard; wrong input is one line and exit code 2."""
    parser = argparse.ArgumentParser(prog="facesynth-runtime", description="Run a folder that `facesynth export` wrote.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("sound", type=Path, help="16-bit WAV")
    parser.add_argument("--phones", type=Path, help="lines of `end label`, seconds; without them the sound is one silence")
    parser.add_argument("--emotion", help="the first of the model's where none is given")
    parser.add_argument("--intensity", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="NPZ to write: frames, fps, names")
    options = parser.parse_args(arguments)
    try:
        _run(options)
    except RuntimeInputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def _run(options: argparse.Namespace) -> None:
    model = load(options.folder, threads=options.threads)
    audio, rate = read_wav(options.sound)
    if hasattr(model, "detect"):
        print(json.dumps(model.detect(audio, rate).probabilities))
        return
    if options.output is None:
        raise RuntimeInputError("no output was named; wanted -o motion.npz")
    phones = read_phones(options.phones, len(audio) / rate)
    emotion = options.emotion or model.emotions[0]
    track = EmotionTrack.constant(emotion, phones.duration_s, options.intensity)
    motion = model.synthesize(Speech(audio, rate, phones, track), seed=options.seed)
    np.savez(options.output, frames=motion.frames, fps=motion.fps, names=np.array(motion.layout.names))


def read_wav(path: Path) -> tuple[NDArray[np.float32], int]:
    """Mono samples [S] (mean of the channels) and their rate."""
    try:
        with wave.open(str(path), "rb") as file:
            width, channels, rate = file.getsampwidth(), file.getnchannels(), file.getframerate()
            content = file.readframes(file.getnframes())
    except (OSError, EOFError, wave.Error) as error:
        raise RuntimeInputError(f"{path}: cannot be read as WAV ({error})") from None
    if width != 2:
        raise RuntimeInputError(f"{path} has {8 * width} bits a sample; wanted 16")
    return np.frombuffer(content, "<i2").reshape(-1, channels).mean(axis=1).astype(np.float32) / 32768, rate


def read_phones(path: Path | None, duration_s: float) -> PhoneTrack:
    """Lines of `end label`; one silence where there is no file."""
    if path is None:
        return PhoneTrack(("pau",), np.array([duration_s]))
    try:
        rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
        return PhoneTrack(tuple(label for _, label in rows), np.array([float(end) for end, _ in rows]))
    except (OSError, ValueError) as error:
        raise RuntimeInputError(f"{path}: wanted lines of `end label` ({error})") from None


if __name__ == "__main__":
    main()
