"""What is said in a sound, written down by Whisper: faster-whisper runs it, from a folder that was given or fetched."""

from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.cache import cache_dir
from facesynth.inference.errors import FacesynthError
from facesynth.inference.sound import resample

RATE = 16000
"""That Whisper hears at, Hz."""
MODEL_FILE = "model.bin"
EXTRA = "faster-whisper is not installed; run: pip install 'facesynth[transcribe]'"


@dataclass(frozen=True)
class Transcript:
    """What is said."""

    text: str
    """Empty where nothing was understood."""
    language: str
    """ISO 639-1."""


def transcribe(audio: NDArray[np.float32], rate: int, folder: Path, language: str | None = None) -> Transcript:
    """Write down a sound [S], -1..1, at `rate` Hz, by the model in `folder`; the language is detected where nobody says.

    FacesynthError where the package or the model is missing, or cannot be used.
    """
    parts, about = _model(folder).transcribe(
        resample(audio, rate, RATE), language=language, condition_on_previous_text=False, without_timestamps=True
    )
    return Transcript(" ".join(part.text.strip() for part in parts).strip(), about.language)


def require_transcriber(folder: Path) -> None:
    """FacesynthError, before anything is heard, where the package is not installed or the folder holds no model."""
    if find_spec("faster_whisper") is None:
        raise FacesynthError(EXTRA)
    if not (folder / MODEL_FILE).is_file():
        fetch = "fetch one with `facesynth fetch whisper`, or give a folder of faster-whisper with --transcriber"
        raise FacesynthError(f"{folder} holds no model that transcribes ({MODEL_FILE}); {fetch}")


def fetched_folder() -> Path:
    """Where the model lies that `facesynth fetch whisper` fetched."""
    return cache_dir("whisper")


def fetch_whisper(size: str) -> Path:
    """Let faster-whisper download a model from where it keeps them; returns the folder."""
    if find_spec("faster_whisper") is None:
        raise FacesynthError(EXTRA)
    from faster_whisper import download_model

    folder = fetched_folder()
    try:
        download_model(size, output_dir=str(folder))
    except Exception as error:  # whatever the hub's client raises: no network, no such model, a full disk
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise FacesynthError(f"the model {size!r} could not be fetched ({reason}); is there a network?") from None
    return folder


@cache
def _model(folder: Path) -> Any:
    require_transcriber(folder)
    from faster_whisper import WhisperModel

    try:
        return WhisperModel(str(folder), device="cpu", compute_type="int8", local_files_only=True)
    except Exception as error:  # of ctranslate2, tokenizers or json, by what is damaged
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise FacesynthError(f"the model in {folder} cannot be used ({reason}); fetch it again") from None
