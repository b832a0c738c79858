"""When the phones of a known text are said, in any language: found in what the phone network hears, by viseme class."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.ear import FRAMES_PER_S, Ear
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, SILENCE, VISEME_CLASSES
from facesynth.inference.sound import resample
from facesynth.inference.speech import PhoneTrack
from facesynth.inference.spikes import Spike
from facesynth.speech.audio import require_sound
from facesynth.speech.ctc_alignment import NOTHING, Classes, align_phones, class_log_probabilities, fit_of
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.phone_matching import match
from facesynth.speech.pronunciation import Pronunciation
from facesynth.speech.recognition import placed
from facesynth.speech.segments import Segment

Word = tuple[str, Pronunciation]
"""As it is written, and its phones."""

WORST_FIT = -2.25
"""Mean logarithm of the phones' probabilities below which a text is another sound's. Of 80 real clips with their own words the
least is -1.4, with a sentence of another language the best -2.7; sentences that share half of their words may pass
(benchmarks/phone_thresholds.py). Of 18 sentences in as many languages by a synthetic voice the least was -2.1."""
BEYOND_CHANCE = 0.5
"""By how much the fit must exceed that of the same phones in random order: by 1.36 and more in the real clips, by 0.58 and more
with the synthetic voice, by less than 0.43 in 95 of 100 trials of its sentences with each other's words."""
SHUFFLES, SHUFFLED = 8, (10, 400)
"""How often, and from how many phones on; more than the second are not needed to tell."""
DOUBTFUL, SHORTEST_WORD = -3.0, 3
"""A word of so many phones or more with a fit below this is told as one that does not fit: 1.9 % of the words of the 80 clips,
79 % of those that were put in place of one."""
INSIDE_S = 0.4
"""Silence inside a word is a long sound, not a pause, up to this length."""
PIECE_FRAMES = 3000
"""Longer sounds are cut into pieces of about this length, a minute, where sound and text are surely together."""
SURELY = 2
"""Phones on either side of a cut that are heard one after the other where the text has them so."""
_MOST_NAMED = 6


@dataclass(frozen=True, eq=False)
class TextAlignment:
    """Phones and words of a sound, each with its time."""

    phones: PhoneTrack
    """As long as the sound, with confidences."""
    words: tuple[Segment, ...]
    """Word, start and end in seconds."""
    doubtful: tuple[Segment, ...]
    """Those of the words that do not fit what is heard there."""
    fit: float
    """Mean logarithm of the phones' probabilities: about -0.8 for real speech, under WORST_FIT they do not belong together."""


def align_words(audio: NDArray[np.float32], rate: int, words: Sequence[Word]) -> TextAlignment:
    """Find when words with known phones are said in a sound [S], -1..1, at `rate` Hz.

    FacesynthError where the sound is too short or silent, or where the words do not belong to it.
    """
    require_sound(audio, rate)
    classes = heard_classes(audio, rate)
    spikes = told(classes, [phones for _, phones in words])
    if spikes is None:
        count = sum(len(phones) for _, phones in words)
        raise _mismatch(words, f"its {count} phones are too many for {len(audio) / rate:.1f} s")
    if not belongs(classes, spikes):
        raise _mismatch(words, "what is heard is something else")
    track = _through_words(placed(audio, rate, spikes, fit=False), spikes)
    spans = _spans(track, words)
    return TextAlignment(track, spans, tuple(spans[number] for number in doubtful(spikes, words)), fit_of(spikes))


# Around spikes a long vowel is too short, and the mouth would rest in the middle of a word. Lips stay shut no longer for it.
def _through_words(track: PhoneTrack, spikes: Sequence[Spike]) -> PhoneTrack:
    """The track without silences of INSIDE_S or less inside words: the phone before takes them, the one after if that is shut."""
    begins = [spike.begins_word for spike in spikes]
    labels, ends_s, sure = list(track.labels), track.ends_s.tolist(), _confidences(track).tolist()
    spoken = len(spikes)
    for place in range(len(labels) - 1, -1, -1):
        if labels[place] != SILENCE:
            spoken -= 1
            continue
        start_s = ends_s[place - 1] if place else 0.0
        inside = 0 < spoken < len(spikes) and not begins[spoken]
        if not inside or ends_s[place] - start_s > INSIDE_S:
            continue
        if labels[place - 1] not in BILABIALS:
            ends_s[place - 1] = ends_s[place]
        for row in (labels, ends_s, sure):
            del row[place]
    return PhoneTrack(tuple(labels), np.array(ends_s), np.array(sure))


def _confidences(track: PhoneTrack) -> NDArray[np.float64]:
    return np.ones(len(track.labels)) if track.confidences is None else track.confidences


def told(classes: Classes, words: Sequence[Pronunciation]) -> list[Spike] | None:
    """Where the phones of words are told in class probabilities [T, 15] of any length; None where they are too many for it."""
    found: list[Spike] = []
    for start, stop, first, last in _pieces(classes, words):
        part = align_phones(classes[start:stop], words[first:last], start / FRAMES_PER_S)
        if part is None:
            return None
        found += part
    return found


def belongs(classes: Classes, spikes: Sequence[Spike]) -> bool:
    """Whether a text whose phones are told in class probabilities [T, 15] is that of the sound."""
    fewest, most = SHUFFLED
    if fit_of(spikes) < WORST_FIT or len(spikes) < fewest:
        return fit_of(spikes) >= WORST_FIT
    some = spikes[:most]
    stop = len(classes) if len(some) == len(spikes) else round(spikes[most].first_s * FRAMES_PER_S)
    return fit_of(some) - fit_by_chance(classes[:stop], some) >= BEYOND_CHANCE


def doubtful(spikes: Sequence[Spike], words: Sequence[Word]) -> list[int]:
    """Numbers of the words that do not fit what is heard where they should be said."""
    ends = np.cumsum([0, *(len(phones) for _, phones in words)])
    fits = [fit_of(spikes[first:stop]) if stop - first >= SHORTEST_WORD else 0.0 for first, stop in pairwise(ends)]
    return [number for number, fit in enumerate(fits) if fit < DOUBTFUL]


def heard_classes(audio: NDArray[np.float32], rate: int) -> Classes:
    """[T, 15] logarithms of the probabilities of viseme classes in a sound [S], 50 frames a second."""
    hearing = phone_hearing()
    heard = Ear(hearing.network).read(resample(audio, rate, hearing.rate))
    return np.concatenate([class_log_probabilities(block, hearing.alphabet) for block in heard])


def fit_by_chance(classes: Classes, spikes: Sequence[Spike]) -> float:
    """Mean fit of the same phones in SHUFFLES random orders, always the same ones."""
    rng = np.random.default_rng(0)
    phones = np.array([spike.phone for spike in spikes])
    shuffled = [align_phones(classes, [rng.permutation(phones).tolist()]) for _ in range(SHUFFLES)]
    return float(np.mean([fit_of(found or ()) for found in shuffled]))


def doubts(words: Sequence[Segment]) -> tuple[str, ...]:
    """A remark that names words that do not fit, none where there are none."""
    if not words:
        return ()
    named = ", ".join(f"{word!r} at {start_s:.2f} s" for word, start_s, _ in words[:_MOST_NAMED])
    more = f" and {len(words) - _MOST_NAMED} more" if len(words) > _MOST_NAMED else ""
    return (f"these words do not fit what is heard: {named}{more}",)


def _pieces(classes: Classes, words: Sequence[Pronunciation]) -> list[tuple[int, int, int, int]]:
    """First frame and frame after the last, first word and word after the last, of pieces of PIECE_FRAMES or more.

    They are cut before words whose first phones are heard as the text has them: the best path through an hour would take as
    many cells as it has frames times phones.
    """
    if len(classes) <= 2 * PIECE_FRAMES:
        return [(0, len(classes), 0, len(words))]
    frames, kinds = _heard_runs(classes)
    found = match([phone for word in words for phone in word], [VISEME_CLASSES[kind][0] for kind in kinds])
    ends = np.cumsum([len(word) for word in words])
    pieces, start, first = [], 0, 0
    for word, stop in enumerate(ends[:-1], start=1):
        around = found.partners[max(0, stop - SURELY) : stop + SURELY]
        if len(around) < 2 * SURELY or around[0] < 0 or (np.diff(around) != 1).any():
            continue
        middle = int(frames[around[SURELY - 1 : SURELY + 1]].mean())
        if middle - start >= PIECE_FRAMES and len(classes) - middle >= PIECE_FRAMES:
            pieces.append((start, middle, first, word))
            start, first = middle, word
    return [*pieces, (start, len(classes), first, len(words))]


def _heard_runs(classes: Classes) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First frame and class of each run of a class that is heard."""
    best = classes.argmax(axis=1)
    frames = np.flatnonzero((np.diff(best, prepend=NOTHING) != 0) & (best != NOTHING))
    return frames, best[frames]


def _spans(track: PhoneTrack, words: Sequence[Word]) -> tuple[Segment, ...]:
    """Words with the times of their first and last phone."""
    spoken = np.flatnonzero(np.array(track.labels) != SILENCE)
    ends = np.cumsum([len(phones) for _, phones in words])
    starts = ends - [len(phones) for _, phones in words]
    return tuple(
        (word, float(track.starts_s[spoken[first]]), float(track.ends_s[spoken[stop - 1]]))
        for (word, _), first, stop in zip(words, starts, ends, strict=True)
    )


def _mismatch(words: Sequence[Word], reason: str) -> FacesynthError:
    said = " ".join(word for word, _ in words[:8]) + (" …" if len(words) > 8 else "")
    return FacesynthError(
        f"the transcript {said!r} does not match the sound ({reason});"
        " correct the transcript or its language, or leave it out to have the phones heard"
    )
