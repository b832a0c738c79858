"""Phones of a sound of which nobody knows the words, in any language: heard by a network, placed by pocketsphinx."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from importlib import resources
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.inference.speech_or_music import SpeechOrMusic, is_speech
from facesynth.inference.spikes import Spike, segments_around
from facesynth.progress import track
from facesynth.speech.audio import SILENT_DB, no_speech, require_sound
from facesynth.speech.fitting import fit_phones
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.pieces import quiet_pieces
from facesynth.speech.pronunciation import Pronunciation
from facesynth.speech.segments import Segment, in_one, phone_track

FURTHEST_S, NEARER = 0.05, 80
"""A fit of which not so many percent of the phones lie so near to their spikes is not believed: pocketsphinx knows English alone,
and places phones of other languages worse than the network does. 80 % lie within 10 to 128 ms in 80 pieces of English, within 38
to 137 ms in 37 pieces of Mandarin, of which 7 are believed (benchmarks/phone_thresholds.py)."""
APART_S, FEWEST = 0.5, 4
"""A pause that parts two stretches, and how many phones make one that can be judged."""
HARDLY, UNSURE = 0.4, 0.5
"""Mean confidence of a stretch below which it is not taken for speech, and below which it is doubted."""
DOUBTFUL = 1.0
"""Mean log odds of speech against music below which a stretch is doubted."""
RESTING = "what is heard is no speech: music, noise, laughter or breath? The lips rest there"
LEVEL_S, NOTED_S, LOUD_DB = 0.05, 0.5, 25.0
"""Sound that is no speech is told where it is so loud, beside the 95th percentile of all levels, for so long."""
NAMED = 6
"""Stretches that are named."""
BESIDE_S = 0.15
"""Beside a phone's spike the sound is the phone's."""
BLOCK = 4096
"""Levels computed at once."""
_IN_THE_MODEL = {"ax": "ah", "el": "l", "em": "m", "en": "n"}
"""Phones that pocketsphinx's English model lacks, and those that stand in for them."""


def recognise(audio: NDArray[np.float32], rate: int, *, fit: bool = True) -> PhoneTrack:
    """Phones heard in a sound [S], -1..1, at `rate` Hz, of any length and language, with confidences.

    fit: place them by fitting the heard phones to the sound, which takes ten times as long as hearing them; else they lie
    around the network's spikes. FacesynthError where the sound is too short, silent, or holds no speech.
    """
    return placed(audio, rate, speech_in(audio, rate)[0], fit=fit)


@cache
def speech_or_music() -> SpeechOrMusic:
    """What tells speech from music, with the weights that come with facesynth."""
    with resources.files("facesynth.speech").joinpath("speech_or_music.npz").open("rb") as file, np.load(file) as stored:
        return SpeechOrMusic(stored["weights"], float(stored["bias"]))


# What is no speech is heard as phones, too. Instruments are told by the network's layers, phone by phone, so that a tune between
# two sentences is found, however sure the network is of its onsets. Breath, drums and the like leave the network unsure: mean
# confidences of stretches of speech are 0.50 and more, 0.78 at the median; in noise of 5 dB, in babble and over a telephone 0.34
# and more, with up to 8 % of the stretches below UNSURE.
def speech_in(audio: NDArray[np.float32], rate: int) -> tuple[list[Spike], tuple[str, ...]]:
    """Phones heard in a sound, without what is hardly speech; and a remark on each stretch of that, and on doubtful ones.

    FacesynthError as from `recognise`.
    """
    require_sound(audio, rate)
    heard, log_odds = phone_hearing().judged_spikes(audio, rate, speech_or_music())
    spoken = is_speech(log_odds)
    likely = dict(zip(heard, log_odds, strict=True))
    dropped = [spike for spike, said in zip(heard, spoken, strict=True) if not said]
    found = stretches([spike for spike, said in zip(heard, spoken, strict=True) if said])
    kept: list[Spike] = []
    doubts: list[str] = []
    for stretch, hardly in zip(found, _hardly(found), strict=True):
        if hardly:
            dropped += stretch
            continue
        kept += stretch
        if len(stretch) >= FEWEST and (_sure(stretch) < UNSURE or np.mean([likely[spike] for spike in stretch]) < DOUBTFUL):
            span = _span(stretch[0].first_s, stretch[-1].last_s)
            doubts.append(f"from {span} phones were heard in much doubt: is it speech?")
    if not kept:
        raise no_speech()
    return kept, (*_rests(list(unspoken(audio, rate, kept, dropped))), *doubts)


def _rests(found: Sequence[tuple[float, float]]) -> Iterator[str]:
    """What a person should know of stretches that are no speech."""
    if found:
        named = ", ".join(_span(*one) for one in found[:NAMED]) + (
            f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
        )
        yield f"from {named} {RESTING}"


def _span(start_s: float, stop_s: float) -> str:
    return f"{start_s:.1f} to {stop_s:.1f} s"


def unspoken(
    audio: NDArray[np.float32], rate: int, kept: Sequence[Spike], dropped: Sequence[Spike]
) -> Iterator[tuple[float, float]]:
    """Start and end in seconds of what sounds between the phones [S] that were kept, and is no speech.

    A stretch counts where phones were dropped in it, or where it is loud, within LOUD_DB of the loud parts, for NOTED_S.
    """
    loud = np.flatnonzero(_loud(audio, rate)) * LEVEL_S
    ends_s = [-np.inf, *(spike.last_s for spike in kept)]
    starts_s = [*(spike.first_s for spike in kept), np.inf]
    for before_s, after_s in zip(ends_s, starts_s, strict=True):
        heard_s = loud[(loud > before_s + BESIDE_S) & (loud < after_s - BESIDE_S - LEVEL_S)]
        taken_s = [time_s for spike in dropped if before_s < spike.first_s < after_s for time_s in (spike.first_s, spike.last_s)]
        if taken_s or len(heard_s) * LEVEL_S >= NOTED_S:
            both_s = [*taken_s, *heard_s, *(heard_s[-1:] + LEVEL_S)]
            yield max(0.0, min(both_s)), max(both_s)


def _loud(audio: NDArray[np.float32], rate: int) -> NDArray[np.bool_]:
    """[N] of each LEVEL_S whether it is within LOUD_DB of the loud parts, and no silence."""
    size = max(1, round(LEVEL_S * rate))
    level_db = np.concatenate(
        [_level_db(audio[first : first + size * BLOCK], size) for first in range(0, len(audio) - size + 1, size * BLOCK)]
    )
    return level_db > max(SILENT_DB, float(np.percentile(level_db, 95)) - LOUD_DB)


def _level_db(audio: NDArray[np.float32], size: int) -> NDArray[np.float64]:
    """[N] of each `size` samples, the last incomplete ones left out."""
    pieces = np.asarray(audio[: len(audio) // size * size], np.float64).reshape(-1, size)
    return 10 * np.log10(np.square(pieces).mean(axis=1) + 1e-12)


def _sure(stretch: Sequence[Spike]) -> float:
    return float(np.mean([spike.confidence for spike in stretch]))


def _hardly(found: Sequence[Sequence[Spike]]) -> list[bool]:
    """Whether each stretch is hardly speech; one in doubt that is too short to be judged goes with the nearest that is not."""
    judged = [(stretch[0].first_s, _sure(stretch) < HARDLY) for stretch in found if len(stretch) >= FEWEST]

    def nearest(stretch: Sequence[Spike]) -> bool:
        return min(judged, key=lambda other: abs(other[0] - stretch[0].first_s), default=(0.0, True))[1]

    return [_sure(stretch) < HARDLY and (len(stretch) >= FEWEST or nearest(stretch)) for stretch in found]


def stretches(heard: Sequence[Spike]) -> list[list[Spike]]:
    """Phones between which there is no longer pause than APART_S."""
    found: list[list[Spike]] = []
    for spike in heard:
        if not found or spike.first_s - found[-1][-1].last_s > APART_S:
            found.append([])
        found[-1].append(spike)
    return found


def placed(audio: NDArray[np.float32], rate: int, heard: Sequence[Spike], *, fit: bool = True) -> PhoneTrack:
    """The track of spikes in order of time, as long as the sound [S] at `rate` Hz; `fit` as in `recognise`."""
    duration_s = len(audio) / rate
    around = segments_around(heard, duration_s)
    segments = in_one(_fitted_pieces(audio, rate, heard, around)) if fit else around
    return _with_confidences(phone_track(segments, duration_s), heard)


def _fitted_pieces(
    audio: NDArray[np.float32], rate: int, heard: Sequence[Spike], around: Sequence[Segment]
) -> Iterator[tuple[float, float, Sequence[Segment]]]:
    """Start and length of each piece of the sound, and its phones, counted from its start; none is lost at an edge."""
    pieces = quiet_pieces(audio, rate)
    edges = np.searchsorted([spike.first_s for spike in heard], [stop / rate for _, stop in pieces[:-1]])
    bounds = [0, *map(int, edges), len(heard)]
    for (start, stop), (first, last) in track(list(zip(pieces, pairwise(bounds), strict=True)), "listen"):
        near = [(label, begin_s - start / rate, end_s - start / rate) for label, begin_s, end_s in around[first:last]]
        yield start / rate, (stop - start) / rate, _fitted(audio[start:stop], rate, heard[first:last], near)


def _fitted(audio: NDArray[np.float32], rate: int, heard: Sequence[Spike], near: Sequence[Segment]) -> Sequence[Segment]:
    """Phones and pauses where pocketsphinx finds them, `near` where it finds something else."""
    words = _words(heard)
    found = fit_phones(audio, rate, tuple(words), lambda name: (words[name],)) if words else None
    if found is None:
        return near
    places = [segment for segment in found.phones if segment[0] != SILENCE]
    if len(places) != len(near) or np.percentile(np.abs(_middles(places) - _middles(near)), NEARER) > FURTHEST_S:
        return near
    labels = iter(spike.phone for spike in heard)
    return [(label if label == SILENCE else next(labels), start_s, end_s) for label, start_s, end_s in found.phones]


def _words(heard: Sequence[Spike]) -> dict[str, Pronunciation]:
    """Names for what was heard between two word boundaries, and how each is pronounced."""
    numbers = np.cumsum([spike.begins_word for spike in heard])
    words = [
        tuple(_IN_THE_MODEL.get(spike.phone, spike.phone) for spike, number in zip(heard, numbers, strict=True) if number == word)
        for word in np.unique(numbers)
    ]
    return {f"heard{place}": phones for place, phones in enumerate(words)}


def _middles(segments: Sequence[Segment]) -> NDArray[np.float64]:
    return np.array([(start_s + end_s) / 2 for _, start_s, end_s in segments])


def _with_confidences(phones: PhoneTrack, heard: Sequence[Spike]) -> PhoneTrack:
    """The same track with how sure each phone is; of silence one is."""
    spoken = iter(spike.confidence for spike in heard)
    return replace(phones, confidences=np.array([1.0 if label == SILENCE else next(spoken) for label in phones.labels]))
