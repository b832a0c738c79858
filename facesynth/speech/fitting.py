"""Known words fitted to a sound by pocketsphinx: when each is said, when each of its phones, and how well it all fits."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.phones import SILENCE
from facesynth.speech.decoding import FRAME_S, decode, decoder_sound, heard_time, new_decoder
from facesynth.speech.pronunciation import Pronunciation, pronunciations
from facesynth.speech.segments import Segment

SLOWNESS = (1.06, 1.25)
"""How much slower the sound is played to the decoder, in the order in which it is tried. 1.06 gave the least spread
of boundaries on hand labels (6.8 ms against 8.5 ms at 1.0); 1.25 finds raised voices, which 1.0 loses."""
GOOD_FIT = -60.0
"""A fit that needs no second try; nine clear recordings in ten are above it."""
STOPS = frozenset(["p", "b", "t", "d", "k", "g"])
LONGEST_ONSET_S = 0.14
"""Of the stops inside speech 95 % are shorter (79 clips of seven speakers)."""
_BEAM = 1e-100

Pronounced = Callable[[str], Sequence[Pronunciation]]


@dataclass(frozen=True)
class Fitted:
    """Where words and phones lie in a sound."""

    phones: tuple[Segment, ...]
    """Phones and pauses, in order; they may reach beyond the sound by a little."""
    words: tuple[Segment, ...]
    fit: float
    """Mean over phones of the acoustic score per 10 ms, relative to the best sound of all at that moment, less a
    penalty for loud sound that no word accounts for. 0 is perfect, -45 usual, under -85 the words are not in it."""


class _Phone(NamedTuple):
    name: str
    start: int
    frames: int
    score: int


class _Entry(NamedTuple):
    is_word: bool
    phones: tuple[_Phone, ...]


def fit_phones(
    audio: NDArray[np.float32], rate: int, words: Sequence[str], pronounced: Pronounced = pronunciations
) -> Fitted | None:
    """Phones of `words` in a sound [S] of some seconds, the best of a few tries; None where none comes to its end.

    pronounced: from a word to its pronunciations, in the phones that the English model knows.
    """
    best: Fitted | None = None
    for slowness in SLOWNESS:
        tried = _fit_once(audio, rate, words, slowness, pronounced)
        if tried is not None and (best is None or tried.fit > best.fit):
            best = tried
        if best is not None and best.fit > GOOD_FIT:
            break
    return best


def fit_words(audio: NDArray[np.float32], rate: int, words: Sequence[str]) -> tuple[Segment, ...] | None:
    """Words with their times in a sound [S] of any length, without phones; None where they cannot be followed to the end."""
    for slowness in SLOWNESS:
        decoder = _decoder_of(words, pronunciations, compallsen=False)
        decode(decoder, decoder_sound(audio, rate, slowness))
        if decoder.hyp() is not None:
            spoken = [entry for entry in decoder.seg() if _number(entry.word) is not None]
            times = [(heard_time(e.start_frame, slowness), heard_time(e.end_frame + 1, slowness)) for e in spoken]
            return tuple((word, *time) for word, time in zip(words, times, strict=True))
    return None


def _fit_once(
    audio: NDArray[np.float32], rate: int, words: Sequence[str], slowness: float, pronounced: Pronounced
) -> Fitted | None:
    """Two passes: the first finds words, pauses and which pronunciation, the second the phones inside them."""
    sound = decoder_sound(audio, rate, slowness)
    decoder = _decoder_of(words, pronounced, compallsen=True)
    try:
        decode(decoder, sound)
        if decoder.hyp() is None:
            return None
        decoder.set_alignment()
        decode(decoder, sound)
        entries = _entries(decoder)
    except RuntimeError:
        return None
    spoken = [entry for entry in entries if entry.is_word]
    if len(spoken) != len(words):
        return None
    scores = [phone.score / phone.frames for entry in spoken for phone in entry.phones]
    entries = _with_short_onsets(entries, slowness)
    spoken = [entry for entry in entries if entry.is_word]
    times = tuple((word, *_span(entry.phones, slowness)) for word, entry in zip(words, spoken, strict=True))
    fit = float(np.mean(scores)) - 40 * max(0.0, _loud_share_outside(audio, rate, times) - 0.1)
    return Fitted(tuple(_phones(entries, slowness)), times, fit)


def _decoder_of(words: Sequence[str], pronounced: Pronounced, compallsen: bool) -> Any:
    """A decoder that can hear only these words in this order, with pauses and noises between them.

    `compallsen` scores all sounds of the model, not only those of the words, so that scores have one scale.
    """
    decoder = new_decoder(bestpath=False, beam=_BEAM, pbeam=_BEAM, wbeam=_BEAM, compallsen=compallsen)
    names = {word: f"w{number}" for number, word in enumerate(dict.fromkeys(words))}
    for word, name in names.items():
        for variant, phones in enumerate(pronounced(word), start=1):
            decoder.add_word(name if variant == 1 else f"{name}({variant})", " ".join(phones).upper(), False)
    decoder.set_align_text(" ".join(names[word] for word in words))
    return decoder


def _number(name: str) -> str | None:
    """Which word an entry of the decoder is; None for its pauses and noises."""
    match = re.match(r"w(\d+)(\(\d+\))?$", name)
    return match and match[1]


def _entries(decoder: Any) -> list[_Entry]:
    """The decoder's words, pauses and noises with their phones, copied: its own entries change under one's hands."""
    return [
        _Entry(
            _number(entry.name) is not None,
            tuple(_Phone(phone.name.lower(), phone.start, max(phone.duration, 1), phone.score) for phone in entry),
        )
        for entry in decoder.get_alignment()
    ]


# The closure of a stop after a pause is as silent as the pause, and the decoder may give the stop all of it: lips would be
# shut for half a second before a word that begins with p.
def _with_short_onsets(entries: Sequence[_Entry], slowness: float) -> list[_Entry]:
    """The same, stops that begin a word after a pause, or the whole, no longer than LONGEST_ONSET_S."""
    longest = round(LONGEST_ONSET_S * slowness / FRAME_S)

    def shortened(entry: _Entry) -> _Entry:
        first, *others = entry.phones
        if first.name not in STOPS or first.frames <= longest:
            return entry
        return entry._replace(phones=(first._replace(start=first.start + first.frames - longest, frames=longest), *others))

    after_pause = [True, *(not entry.is_word for entry in entries[:-1])]
    return [shortened(entry) if entry.is_word and late else entry for entry, late in zip(entries, after_pause, strict=True)]


def _span(phones: Sequence[_Phone], slowness: float) -> tuple[float, float]:
    return heard_time(phones[0].start, slowness), heard_time(phones[-1].start + phones[-1].frames, slowness)


def _phones(entries: Iterable[_Entry], slowness: float) -> Iterable[Segment]:
    for entry in entries:
        if entry.is_word:
            yield from ((phone.name, *_span([phone], slowness)) for phone in entry.phones)
        else:
            yield (SILENCE, *_span(entry.phones, slowness))


def _loud_share_outside(audio: NDArray[np.float32], rate: int, words: Sequence[Segment]) -> float:
    """Share of the loud 10 ms blocks (within 25 dB of the 95th percentile) that lie in no word."""
    block = round(FRAME_S * rate)
    count = len(audio) // block
    level_db = 20 * np.log10(np.asarray(audio[: count * block], np.float64).reshape(count, block).std(axis=1) + 1e-9)
    loud = level_db > np.percentile(level_db, 95) - 25
    middles_s = (np.arange(count) + 0.5) * FRAME_S
    inside = np.zeros(count, bool)
    for _, start_s, end_s in words:
        inside |= (middles_s >= start_s) & (middles_s < end_s)
    return float((loud & ~inside).sum() / max(loud.sum(), 1))
