"""The one way to phones: from a sound and what is known of it to a track with times, confidences and remarks."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.alignment import align
from facesynth.speech.phone_archive import DISTRIBUTION, is_installed
from facesynth.speech.segments import Segment, covering
from facesynth.speech.textgrid import SAME_LENGTH_S, is_textgrid, read_labelled

Source = Literal["textgrid", "labels", "transcript", "recognition"]

ENGLISH = "en"


@dataclass(frozen=True, eq=False)
class FoundPhones:
    """Phones of a sound, and how they were found."""

    phones: PhoneTrack
    """As long as the sound; with confidences where they were heard."""
    words: tuple[Segment, ...]
    """Word, start and end in seconds; empty where nobody knows the words."""
    remarks: tuple[str, ...]
    """What a person should know."""
    source: Source


def find_phones(
    audio: NDArray[np.float32],
    rate: int,
    *,
    given: str | Path | None = None,
    speaker: str | None = None,
    text: str | None = None,
    language: str | None = None,
) -> FoundPhones:
    """Phones of a sound [S], -1..1, at `rate` Hz: those that are given, else aligned with the words, else heard.

    given: a TextGrid, of which the phones of `speaker` are taken where it holds several, or lines of `end label`; text: what
    is said; language: of the text, English where nobody says. What is heard may be in any language. FacesynthError where none
    of it can be used.
    """
    if given is not None:
        return _read(given, len(audio) / rate, speaker)
    if text is None:
        return _heard(audio, rate)
    if language not in (None, ENGLISH):
        raise FacesynthError(
            f"texts in the language {language!r} cannot be pronounced here, {ENGLISH!r} alone can;"
            " leave the text out to have the phones heard, or give the phones"
        )
    found = align(audio, rate, text)
    return FoundPhones(found.phones, found.words, found.warnings, "transcript")


def _heard(audio: NDArray[np.float32], rate: int) -> FoundPhones:
    """By the network, in any language; where it is not installed by pocketsphinx, in English."""
    if is_installed():
        from facesynth.speech.recognition import recognise

        remark = "nobody gave the words: phones were heard by a network, about a quarter of them wrongly; a transcript helps"
        return FoundPhones(recognise(audio, rate), (), (remark,), "recognition")
    from facesynth.speech.decoder_recognition import recognise_by_decoder

    remark = (
        "nobody gave the words: phones were recognised by ear, up to half of them wrongly; a transcript helps,"
        f" and so does `pip install {DISTRIBUTION}`, the weights of the network that hears phones"
    )
    return FoundPhones(recognise_by_decoder(audio, rate), (), (remark,), "recognition")


def _read(path: str | Path, duration_s: float, speaker: str | None) -> FoundPhones:
    """The phones of a file, made as long as the sound."""
    found = read_labelled(path, duration_s, speaker)
    if found.phones.duration_s > duration_s + SAME_LENGTH_S:
        raise FacesynthError(
            f"{path} ends at {found.phones.duration_s:.2f} s, the sound at {duration_s:.2f} s; give the phones of this sound"
        )
    said = tuple((word, start_s, min(end_s, duration_s)) for word, start_s, end_s in found.words if start_s < duration_s)
    remarks = tuple(f"{Path(path).name}: {remark}" for remark in found.remarks)
    return FoundPhones(covering(found.phones, duration_s), said, remarks, "textgrid" if is_textgrid(path) else "labels")
