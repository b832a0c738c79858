"""The one way to phones: from a sound and what is known of it to a track with times, confidences and remarks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.alignment import align
from facesynth.speech.audio import require_sound
from facesynth.speech.languages import ENGLISH, code_of, language_of, pronounced
from facesynth.speech.phone_archive import DISTRIBUTION, is_installed
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.segments import Segment, covering
from facesynth.speech.textgrid import SAME_LENGTH_S, is_textgrid, read_labelled
from facesynth.speech.transcript import words_of
from facesynth.speech.transcription import Transcript, transcribe

Source = Literal["textgrid", "labels", "transcript", "transcription", "recognition", "listening", "none"]
Sought = Literal["placed", "heard", "none"]
PLACED: tuple[Source, ...] = ("transcript", "transcription", "recognition")
"""By a program: nobody gave the phones."""
UNSOUGHT: Source = "none"
"""Nobody gave phones, and none were looked for."""
QUOTED = 60
"""Letters of a transcript that are told."""


@dataclass(frozen=True, eq=False)
class FoundPhones:
    """Phones of a sound, and how they were found."""

    phones: PhoneTrack
    """As long as the sound; with confidences where they were heard, or a file states them."""
    words: tuple[Segment, ...]
    """Word, start and end in seconds; empty where nobody knows the words."""
    remarks: tuple[str, ...]
    """What a person should know."""
    source: Source
    text: str = ""
    """What a program wrote down; empty where nobody asked for that."""


def find_phones(
    audio: NDArray[np.float32],
    rate: int,
    *,
    given: str | Path | None = None,
    speaker: str | None = None,
    text: str | None = None,
    language: str | None = None,
    transcriber: Path | None = None,
    sought: Sought = "placed",
) -> FoundPhones:
    """Phones of a sound [S], -1..1, at `rate` Hz: those that are given, else aligned with the words, else heard.

    given: a TextGrid, of which the phones of `speaker` are taken where it holds several, or lines of `end label`; text: what
    is said; language: of the text (ISO 639-1), found out where nobody says. What is heard without a text may be in any language.
    transcriber: a folder with a model that writes down what is said, where no text is given. sought: what is done where neither
    phones nor words are given. "placed" as exactly as can be; "heard" by the network alone, for models that need to be told
    nothing, which rest where nobody speaks and shut lips at p, b and m; "none" leaves them unknown. FacesynthError where none
    of it can be used.
    """
    if given is not None:
        return _read(given, len(audio) / rate, speaker)
    if text is None and transcriber is None and sought != "placed":
        return _listened(audio, rate) if sought == "heard" and is_installed() else _unknown(audio, rate)
    if text is None:
        return _heard(audio, rate) if transcriber is None else _transcribed(audio, rate, transcriber, language)
    spoken = code_of(language) if language is not None else language_of(text)
    return _in_english(audio, rate, text) if spoken == ENGLISH else _in_another(audio, rate, text, spoken, given=language)


def _in_english(audio: NDArray[np.float32], rate: int, text: str) -> FoundPhones:
    """By pocketsphinx; where it cannot follow the words, by the phone network, which also tells the words that do not fit."""
    try:
        found = align(audio, rate, text)
    except FacesynthError:
        instead = _followed_by_network(audio, rate, text)
        if instead is None:
            raise
        return instead
    return FoundPhones(found.phones, found.words, (*found.warnings, *_cross_check(audio, rate, found.words)), "transcript")


def _followed_by_network(audio: NDArray[np.float32], rate: int, text: str) -> FoundPhones | None:
    words = tuple((word, pronounce(word)) for word in words_of(text)) if is_installed() else ()
    if not words:
        return None
    from facesynth.speech.text_alignment import align_words, doubts

    try:
        found = align_words(audio, rate, words)
    except FacesynthError:
        return None
    remark = "the aligner of English could not follow the words; the network that hears phones placed them"
    return FoundPhones(found.phones, found.words, (remark, *doubts(found.doubtful)), "transcript")


def _in_another(audio: NDArray[np.float32], rate: int, text: str, code: str, given: str | None) -> FoundPhones:
    words = pronounced(text, code)
    if not is_installed():
        raise FacesynthError(f"texts in {code!r} are aligned by the phone network, which is missing: pip install {DISTRIBUTION}")
    from facesynth.speech.text_alignment import align_words, doubts

    found = align_words(audio, rate, words)
    remarks = () if given else (f"the transcript is taken to be in the language {code!r}; --language says otherwise",)
    return FoundPhones(found.phones, found.words, (*remarks, *doubts(found.doubtful)), "transcript")


# Whisper writes fluent sentences whether they were said or not: what it wrote is believed where its phones lie in what the phone
# network heard by itself.
def _transcribed(audio: NDArray[np.float32], rate: int, folder: Path, language: str | None) -> FoundPhones:
    """By what a program wrote down, where the words fit what is heard; else as without words."""
    require_sound(audio, rate)
    written = transcribe(audio, rate, folder, None if language is None else code_of(language))
    quoted = written.text if len(written.text) <= QUOTED else written.text[:QUOTED] + " …"
    try:
        found = find_phones(audio, rate, text=written.text, language=written.language)
        _require_heard(audio, rate, written)
    except FacesynthError as error:
        found = _heard(audio, rate)
        reason = f"the transcription {quoted!r} ({written.language}) is not used: {error}" if quoted else "nothing was understood"
        return replace(found, remarks=(reason, *found.remarks))
    remark = f"transcribed, {written.language}: {quoted!r}; correct the text where it is wrong, and give it"
    return replace(found, remarks=(remark, *found.remarks), source="transcription", text=written.text)


def _require_heard(audio: NDArray[np.float32], rate: int, written: Transcript) -> None:
    """FacesynthError where English words do not fit what the network hears; those of other languages were placed by it."""
    if code_of(written.language) != ENGLISH or not is_installed():
        return
    from facesynth.speech.text_alignment import align_words

    align_words(audio, rate, [(word, pronounce(word)) for word in words_of(written.text)])


def _cross_check(audio: NDArray[np.float32], rate: int, words: Sequence[Segment]) -> tuple[str, ...]:
    """A remark on words of a transcript that the phone network does not hear where they were found."""
    if not is_installed():
        return ()
    from facesynth.speech.text_alignment import doubtful, doubts, heard_classes, told

    pronunciations = [(word, pronounce(word)) for word, _, _ in words]
    spikes = told(heard_classes(audio, rate), [phones for _, phones in pronunciations])
    return () if spikes is None else doubts([words[number] for number in doubtful(spikes, pronunciations)])


def _unknown(audio: NDArray[np.float32], rate: int) -> FoundPhones:
    return FoundPhones(PhoneTrack.unknown(len(audio) / rate), (), (), UNSOUGHT)


def _listened(audio: NDArray[np.float32], rate: int) -> FoundPhones:
    """Around the network's spikes, for models that the sound moves."""
    from facesynth.speech.recognition import placed, speech_in

    heard, doubts = speech_in(audio, rate)
    remark = "nobody gave the words, and none are needed: the sound moves the face; what is heard says where lips shut and rest"
    return FoundPhones(placed(audio, rate, heard, fit=False), (), (remark, *doubts), "listening")


def _heard(audio: NDArray[np.float32], rate: int) -> FoundPhones:
    """By the network, in any language; where it is not installed by pocketsphinx, in English."""
    if is_installed():
        from facesynth.speech.recognition import placed, speech_in

        heard, doubts = speech_in(audio, rate)
        remark = "nobody gave the words: phones were heard by a network, about a quarter of them wrongly; a transcript helps"
        return FoundPhones(placed(audio, rate, heard), (), (remark, *doubts), "recognition")
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
