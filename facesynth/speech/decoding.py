"""The pocketsphinx decoder as alignment and recognition use it: its sound, its settings, its clock."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.speech.audio import resample

DECODER_RATE = 16000
FRAME_S = 0.01
"""One step of the decoder's clock, seconds of the sound that it is given."""
PAD_S = 0.2
"""Silence put before and after the sound, without which the first and last phones are often missed."""
CENTRE_S = 0.008
"""Frame t is heard through a window from 10 t to 10 t + 25.6 ms, so a change of state between t - 1 and t
lies at 10 t + 7.8 ms. The two hand-labelled recordings at hand (Haskins) give 9.6 ms, median of 55 boundaries."""
_PEAK = 0.5
_NOISE_STEPS = 3.0


def decoder_sound(audio: NDArray[np.float32], rate: int, slowness: float) -> bytes:
    """16-bit samples for the decoder: peak at half scale, faint noise (a digital silence upsets it), padded.

    `slowness` plays the sound that many times slower, hence lower: the model was trained on adult talk, and voices
    raised in fear or joy lie nearer to it then.
    """
    sound = resample(audio, rate, round(DECODER_RATE * slowness)).astype(np.float64)
    pad = np.zeros(round(PAD_S * DECODER_RATE))
    sound = np.concatenate([pad, sound * (_PEAK / max(np.abs(sound).max(), 1e-9)), pad])
    noise = np.random.default_rng(0).normal(0, _NOISE_STEPS, len(sound))
    return np.clip(sound * 32767 + noise, -32768, 32767).astype("<i2").tobytes()


def heard_time(frame: int, slowness: float) -> float:
    """Seconds in the sound as it was before padding and slowing, of the start of one of the decoder's frames."""
    return (frame * FRAME_S + CENTRE_S - PAD_S) / slowness


def new_decoder(**settings: Any) -> Any:
    """A quiet decoder with no language model and no dictionary unless they are named in `settings`.

    A fresh one for each sound: what a decoder has heard changes how it hears the next.
    """
    from pocketsphinx import Decoder

    return Decoder(samprate=DECODER_RATE, cmn="batch", loglevel="FATAL", **{"lm": None, "dict": None, **settings})


def decode(decoder: Any, sound: bytes) -> None:
    """Let a decoder hear one whole sound."""
    decoder.start_utt()
    decoder.process_raw(sound, full_utt=True)
    decoder.end_utt()


def model_file(name: str) -> str:
    """Path of a file of the English model that comes with pocketsphinx."""
    from pocketsphinx import get_model_path

    return str(Path(get_model_path()) / "en-us" / name)
