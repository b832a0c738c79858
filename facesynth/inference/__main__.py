"""`facesynth-runtime FOLDER SOUND.wav …`: motion, an emotion or phones, from the command line."""

import argparse
import json
import sys
import warnings
from pathlib import Path

import numpy as np

from .checks import checked_seed
from .errors import FacesynthError, unknown
from .loading import load
from .speech import EmotionTrack, PhoneTrack, Speech
from .version import __version__
from .wav import read_wav


def main(arguments: list[str] | None = None) -> None:
    """Speak, or say which emotion or which phones (lines of `end label`) are heard; wrong input is one line and exit code 2."""
    parser = argparse.ArgumentParser(prog="facesynth-runtime", description="Run a folder that `facesynth export` wrote.")
    parser.add_argument("--version", action="version", version=f"facesynth-runtime {__version__}")
    parser.add_argument("folder", type=Path)
    parser.add_argument("sound", type=Path, help="16-bit WAV")
    parser.add_argument("--phones", type=Path, help="lines of `end label`, seconds; without them the sound is one silence")
    parser.add_argument("--emotion", help="the first of the model's where none is given")
    parser.add_argument("--intensity", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="NPZ to write: frames, fps, names, and head where it moves")
    options = parser.parse_args(arguments)
    try:
        _run(options)
    except FacesynthError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def _run(options: argparse.Namespace) -> None:
    model = load(options.folder, threads=options.threads)
    if hasattr(model, "spikes"):
        heard = model.hear(*read_wav(options.sound))
        print("".join(f"{end_s:.3f} {label}\n" for label, end_s in zip(heard.labels, heard.ends_s, strict=True)), end="")
        return
    if not hasattr(model, "detect") and not hasattr(model, "synthesize"):
        raise FacesynthError(
            f"{options.folder} holds graphs ({', '.join(model.names)}) and no model that speaks or hears emotions"
        )
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        audio, rate = read_wav(options.sound)
    for warning in noticed:
        print(f"warning: {warning.message}", file=sys.stderr)
    if hasattr(model, "detect"):
        print(json.dumps(model.detect(audio, rate).probabilities))
        return
    if options.output is None:
        raise FacesynthError("no output was named; wanted -o motion.npz")
    if not options.output.parent.is_dir():
        raise FacesynthError(f"{options.output}: there is no folder {options.output.parent}; make it first")
    phones = read_phones(options.phones, len(audio) / rate)
    emotion = options.emotion or model.emotions[0]
    if emotion not in model.emotions:
        raise unknown("emotion", emotion, model.emotions)
    track = EmotionTrack.constant(emotion, phones.duration_s, options.intensity)
    motion = model.synthesize(Speech(audio, rate, phones, track), seed=checked_seed(options.seed))
    beside = {} if motion.head is None else {"head": motion.head}
    try:
        with options.output.open("wb") as file:  # a path would get another ending where it has none
            np.savez(file, frames=motion.frames, fps=motion.fps, names=np.array(motion.layout.names), **beside)
    except OSError as error:
        raise FacesynthError(f"{options.output}: {error.strerror or 'cannot be written'}") from None


def read_phones(path: Path | None, duration_s: float) -> PhoneTrack:
    """Lines of `end label`; one silence where there is no file."""
    if path is None:
        return PhoneTrack(("pau",), np.array([duration_s]))
    try:
        rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
        return PhoneTrack(tuple(label for _, label in rows), np.array([float(end) for end, _ in rows]))
    except (OSError, ValueError) as error:
        raise FacesynthError(f"{path}: wanted lines of `end label` ({error})") from None


if __name__ == "__main__":
    main()
