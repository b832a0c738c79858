"""When each phone of a known transcript is said."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.progress import track
from facesynth.speech.audio import require_sound
from facesynth.speech.fitting import Fitted, fit_phones, fit_words
from facesynth.speech.pronunciation import is_known, pronounce, pronunciations
from facesynth.speech.segments import Segment, in_one, phone_track
from facesynth.speech.transcript import left_out, words_of

WORST_FIT = -85.0
"""Fit below which the transcript is taken to be another sound's. Of 87 real clips in eight emotions with their own
words 2 % (both shouted) were below it, of 190 with another sentence's words 97 %."""
PIECE_S = 15.0
"""Longer sounds are cut at pauses into pieces of about this length: fitting phones takes memory that grows with the
square of the length, fitting words only with the length."""
PAUSE_S = 0.1
QUICKEST_PHONE_S = 0.024
"""The model cannot say a phone in less."""

Piece = tuple[int, int, tuple[str, ...]]
"""First sample, sample after the last, words said between them."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Phones and words of a sound, each with its time."""

    phones: PhoneTrack
    """As long as the sound."""
    words: tuple[Segment, ...]
    """Word, start and end in seconds."""
    warnings: tuple[str, ...]
    """What a person should know: words that were sounded out by rule, stretches that fit badly."""
    fit: float
    """How well sound and words fit: about -45 for clear speech, under -85 they do not belong together."""


def align(audio: NDArray[np.float32], rate: int, text: str) -> Alignment:
    """Find when each phone of `text` is said in the sound [S], -1..1, at `rate` Hz.

    Sounds of many minutes are taken piece by piece, cut where the speaker pauses. FacesynthError where the sound
    is too short or silent, the text holds no words, or the two do not belong together.
    """
    require_sound(audio, rate)
    words = words_of(text)
    _require_sayable(words, text, len(audio) / rate)
    pieces = _pieces(audio, rate, words)
    if pieces is None:
        raise _mismatch(text)
    whole = []
    for start, stop, some in track(pieces, "align"):
        found = fit_phones(audio[start:stop], rate, some)
        if found is None:
            raise _mismatch(text, f"from {start / rate:.1f} to {stop / rate:.1f} s its words are not heard to the end")
        whole.append(found)
    fit = float(np.average([found.fit for found in whole], weights=[len(found.words) for found in whole]))
    if fit < WORST_FIT:
        raise _mismatch(text, f"fit {fit:.0f}; speech with its own words is above {WORST_FIT:.0f}")
    spans = [(start / rate, (stop - start) / rate) for start, stop, _ in pieces]
    phones = in_one((*span, found.phones) for span, found in zip(spans, whole, strict=True))
    spoken = in_one((*span, found.words) for span, found in zip(spans, whole, strict=True))
    starts_s = [start_s for start_s, _ in spans]
    warnings = (*_not_said(text), *_guessed_words(words), *_doubtful(whole, starts_s))
    return Alignment(phone_track(phones, len(audio) / rate), tuple(spoken), warnings, fit)


def _require_sayable(words: Sequence[str], text: str, duration_s: float) -> None:
    if not words:
        raise FacesynthError(f"the transcript {_quoted(text)} holds no English word; write what is said, or leave it out")
    count = sum(min(map(len, pronunciations(word))) for word in words)
    if count * QUICKEST_PHONE_S > duration_s:
        raise FacesynthError(
            f"the transcript {_quoted(text)} does not match the sound: its {count} phones need at least"
            f" {count * QUICKEST_PHONE_S:.1f} s, the sound lasts {duration_s:.1f} s"
        )


def _pieces(audio: NDArray[np.float32], rate: int, words: tuple[str, ...]) -> list[Piece] | None:
    """The sound and its words, cut in the middle of pauses into pieces of PIECE_S or somewhat more.

    Where no pause comes for another PIECE_S the cut falls between two words. None where the words cannot be followed
    through the sound.
    """
    if len(audio) / rate < 1.5 * PIECE_S:
        return [(0, len(audio), words)]
    timed = fit_words(audio, rate, words)
    if timed is None:
        return None
    pieces: list[Piece] = []
    start, first = 0, 0
    for index, ((_, _, end_s), (_, next_s, _)) in enumerate(pairwise(timed), start=1):
        middle = round((end_s + next_s) / 2 * rate)
        length_s = (middle - start) / rate
        if length_s >= 2 * PIECE_S or (length_s >= PIECE_S and next_s - end_s >= PAUSE_S):
            pieces.append((start, middle, words[first:index]))
            start, first = middle, index
    return [*pieces, (start, len(audio), words[first:])]


def _mismatch(text: str, reason: str = "its words are not heard to the end") -> FacesynthError:
    return FacesynthError(
        f"the transcript {_quoted(text)} does not match the sound ({reason});"
        " correct the transcript, or leave it out to have the phones recognised"
    )


def _not_said(text: str) -> list[str]:
    directions = left_out(text)
    return [f"left out of the transcript as directions: {', '.join(directions)}"] if directions else []


def _guessed_words(words: Sequence[str]) -> list[str]:
    return [
        f"no dictionary knows {word!r}; it was sounded out as {' '.join(pronounce(word))}"
        for word in dict.fromkeys(words)
        if not is_known(word)
    ]


def _doubtful(fitted: Sequence[Fitted], starts_s: Sequence[float]) -> list[str]:
    """A warning for each piece of a longer sound that alone would have been refused."""
    return [
        f"from {start_s + found.words[0][1]:.1f} to {start_s + found.words[-1][2]:.1f} s the transcript does not fit well"
        for found, start_s in zip(fitted, starts_s, strict=True)
        if found.fit < WORST_FIT
    ]


def _quoted(text: str) -> str:
    words = text.split()
    return repr(" ".join(words[:8]) + (" …" if len(words) > 8 else ""))
