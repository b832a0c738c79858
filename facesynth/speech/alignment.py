"""When each phone of a known transcript is said."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.inference.spikes import Spike, segments_around
from facesynth.progress import track
from facesynth.speech.audio import require_sound
from facesynth.speech.fitting import Fitted, fit_phones, fit_words
from facesynth.speech.passages import Followed, Passage, follow
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.pieces import quietest_s
from facesynth.speech.pronunciation import is_known, pronounce, pronunciations
from facesynth.speech.segments import Segment, in_one, phone_track
from facesynth.speech.transcript import left_out, words_of

WORST_FIT = -85.0
"""Fit below which the transcript is taken to be another sound's. Of 87 real clips in eight emotions with their own
words 2 % (both shouted) were below it, of 190 with another sentence's words 97 %."""
PIECE_S = 15.0
"""Longer sounds are cut at pauses into pieces of about this length: fitting phones takes memory that grows with the
square of the length, following words only with the length."""
PAUSE_S = 0.1
QUICKEST_PHONE_S = 0.024
"""The model cannot say a phone in less."""
MOST_QUOTED = 8
"""Words."""


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


class _Piece(NamedTuple):
    """A stretch of sound, and its phones and words where they could be fitted."""

    passage: Passage
    fitted: Fitted | None

    @property
    def span_s(self) -> tuple[float, float]:
        """Start and length."""
        return self.passage.start_s, self.passage.end_s - self.passage.start_s


def align(audio: NDArray[np.float32], rate: int, text: str) -> Alignment:
    """Find when each phone of `text` is said in the sound [S], -1..1, at `rate` Hz.

    Sounds of many minutes are taken piece by piece, cut where the speaker pauses. Where the network that hears phones is
    installed, passages that only the text has are left out, and in those that only the sound has phones are heard; both are
    named. FacesynthError where the sound is too short or silent, the text holds no words, or the two do not belong together.
    """
    require_sound(audio, rate)
    words, duration_s = words_of(text), len(audio) / rate
    _require_sayable(words, text, duration_s)
    if duration_s < 1.5 * PIECE_S:
        whole = _fitted(audio, rate, Passage(0.0, duration_s, words))
        if whole.fitted is not None and whole.fitted.fit >= WORST_FIT:
            return _alignment(text, [whole], [], duration_s)
    heard = _heard(audio, rate)
    followed = follow(audio, rate, words, heard) if heard else _followed_by_words(audio, rate, words)
    if followed is None:
        raise _mismatch(text)
    pieces = [_fitted(audio, rate, piece) for piece in track(list(_pieces(audio, rate, followed)), "align")]
    _require_fit(pieces, text, fewest=0.5 if heard else 1.0)
    found = _alignment(text, pieces, segments_around(heard, duration_s), duration_s)
    return replace(found, warnings=(*found.warnings, *_unsaid(followed)))


def _heard(audio: NDArray[np.float32], rate: int) -> Sequence[Spike]:
    """What the network hears; nothing where it is not installed."""
    if not is_installed():
        return ()
    from facesynth.speech.phone_graph import phone_hearing

    return phone_hearing().spikes(audio, rate)


def _followed_by_words(audio: NDArray[np.float32], rate: int, words: tuple[str, ...]) -> Followed | None:
    """All words followed through the sound by pocketsphinx; None where it loses them."""
    timed = fit_words(audio, rate, words)
    if timed is None:
        return None
    pauses = tuple((end_s, next_s) for (_, _, end_s), (_, next_s, _) in pairwise(timed))
    return Followed((Passage(0.0, len(audio) / rate, words, pauses),), ())


def _pieces(audio: NDArray[np.float32], rate: int, followed: Followed) -> Iterator[Passage]:
    """The passages cut where it is quietest in pauses, into pieces of PIECE_S or somewhat more.

    Where no pause comes for another PIECE_S the cut falls between two words.
    """
    for passage in followed.passages:
        start_s, first = passage.start_s, 0
        for index, (end_s, next_s) in enumerate(passage.pauses_s, start=1):
            length_s = (end_s + next_s) / 2 - start_s
            rest_s = passage.end_s - next_s
            if length_s >= 2 * PIECE_S or (length_s >= PIECE_S and next_s - end_s >= PAUSE_S and rest_s > PAUSE_S):
                cut_s = quietest_s(audio, rate, end_s, next_s)
                yield Passage(start_s, cut_s, passage.words[first:index])
                start_s, first = cut_s, index
        yield Passage(start_s, passage.end_s, passage.words[first:])


def _fitted(audio: NDArray[np.float32], rate: int, passage: Passage) -> _Piece:
    sound = audio[round(passage.start_s * rate) : round(passage.end_s * rate)]
    return _Piece(passage, fit_phones(sound, rate, passage.words) if passage.words and len(sound) else None)


def _require_fit(pieces: Sequence[_Piece], text: str, fewest: float) -> None:
    """FacesynthError where fewer of the words could be fitted, or fit badly."""
    lost = [piece.passage for piece in pieces if piece.passage.words and piece.fitted is None]
    fitted = [piece.fitted for piece in pieces if piece.fitted is not None]
    said = sum(len(found.words) for found in fitted)
    if lost and (not said or said < fewest * (said + sum(len(passage.words) for passage in lost))):
        where = f"from {lost[0].start_s:.1f} to {lost[0].end_s:.1f} s its words are not heard to the end"
        raise _mismatch(text, where)
    if _fit(fitted) < WORST_FIT:
        raise _mismatch(text, f"fit {_fit(fitted):.0f}; speech with its own words is above {WORST_FIT:.0f}")


def _fit(fitted: Sequence[Fitted]) -> float:
    return float(np.average([found.fit for found in fitted], weights=[len(found.words) for found in fitted]))


def _alignment(text: str, pieces: Sequence[_Piece], heard: Sequence[Segment], duration_s: float) -> Alignment:
    """Pieces in one; where the words of one could not be fitted, or it has none, what is heard there."""
    fitted = [piece for piece in pieces if piece.fitted is not None]
    phones = in_one((*piece.span_s, piece.fitted.phones if piece.fitted else _inside(heard, piece.passage)) for piece in pieces)
    spoken = in_one((*piece.span_s, piece.fitted.words) for piece in fitted if piece.fitted)
    warnings = (*_not_said(text), *_guessed_words(words_of(text)), *_doubtful(pieces, heard))
    found = [piece.fitted for piece in fitted if piece.fitted]
    return Alignment(phone_track(phones, duration_s), tuple(spoken), warnings, _fit(found))


def _inside(heard: Sequence[Segment], passage: Passage) -> list[Segment]:
    """What is heard in a passage, in seconds of it."""
    inside = [one for one in heard if passage.start_s <= (one[1] + one[2]) / 2 < passage.end_s]
    return [(label, start_s - passage.start_s, end_s - passage.start_s) for label, start_s, end_s in inside]


def _require_sayable(words: Sequence[str], text: str, duration_s: float) -> None:
    if not words:
        raise FacesynthError(f"the transcript {_quoted(text.split())} holds no English word; write what is said, or leave it out")
    count = sum(min(map(len, pronunciations(word))) for word in words)
    if count * QUICKEST_PHONE_S > duration_s:
        raise FacesynthError(
            f"the transcript {_quoted(text.split())} does not match the sound: its {count} phones need at least"
            f" {count * QUICKEST_PHONE_S:.1f} s, the sound lasts {duration_s:.1f} s"
        )


def _mismatch(text: str, reason: str = "its words are not heard to the end") -> FacesynthError:
    return FacesynthError(
        f"the transcript {_quoted(text.split())} does not match the sound ({reason});"
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


def _doubtful(pieces: Sequence[_Piece], heard: Sequence[Segment]) -> Iterator[str]:
    """A warning for each stretch that nobody wrote down, and each whose words fit badly or not at all."""
    for passage, fitted in pieces:
        inside = _inside(heard, passage)
        if fitted is None and not inside:
            continue
        times_s = (fitted.words[0][1], fitted.words[-1][2]) if fitted else (inside[0][1], inside[-1][2])
        where = f"from {passage.start_s + times_s[0]:.1f} to {passage.start_s + times_s[1]:.1f} s"
        if not passage.words:
            yield f"{where} something is said that the transcript lacks; its phones were heard"
        elif fitted is None:
            yield f"{where} the transcript does not fit ({_quoted(passage.words)}); phones were heard in its place"
        elif fitted.fit < WORST_FIT:
            yield f"{where} the transcript does not fit well"


def _unsaid(followed: Followed) -> Iterator[str]:
    """A warning for each passage of the transcript that the sound lacks."""
    for missing in followed.unsaid:
        count = len(missing.words)
        yield f"at {missing.at_s:.1f} s {count} words of the transcript are not heard and left out: {_quoted(missing.words)}"


def _quoted(words: Sequence[str]) -> str:
    return repr(" ".join(words[:MOST_QUOTED]) + (" …" if len(words) > MOST_QUOTED else ""))
