"""Phones of a sound of which nobody knows the words, in any language: heard by a network, placed by pocketsphinx."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.inference.spikes import Spike, segments_around
from facesynth.progress import track
from facesynth.speech.audio import no_speech, require_sound
from facesynth.speech.fitting import fit_phones
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.pieces import quiet_pieces
from facesynth.speech.pronunciation import Pronunciation
from facesynth.speech.segments import Segment, in_one, phone_track

FURTHEST_S = 0.1
"""A fit whose phones lie further from their spikes than this, at the median, is of something else."""
APART_S, FEWEST = 0.5, 4
"""A pause that parts two stretches, and how many phones make one that can be judged."""
HARDLY, UNSURE = 0.4, 0.5
"""Mean confidence of a stretch below which it is not taken for speech, and below which it is doubted."""
_IN_THE_MODEL = {"ax": "ah", "el": "l", "em": "m", "en": "n"}
"""Phones that pocketsphinx's English model lacks, and those that stand in for them."""


def recognise(audio: NDArray[np.float32], rate: int, *, fit: bool = True) -> PhoneTrack:
    """Phones heard in a sound [S], -1..1, at `rate` Hz, of any length and language, with confidences.

    fit: place them by fitting the heard phones to the sound, which takes ten times as long as hearing them; else they lie
    around the network's spikes. FacesynthError where the sound is too short, silent, or holds no speech.
    """
    return placed(audio, rate, speech_in(audio, rate)[0], fit=fit)


# Music, laughter and breath are heard as phones too, but the network is not sure of them. Mean confidences of stretches: a tune
# of strings 0.34 to 0.35; speech 0.50 and more, 0.78 at the median; in noise of 5 dB, in babble and over a telephone 0.34 and
# more, with up to 8 % of the stretches below UNSURE.
def speech_in(audio: NDArray[np.float32], rate: int) -> tuple[list[Spike], tuple[str, ...]]:
    """Phones heard in a sound, without stretches that are hardly speech; and a remark on each of those, and on doubtful ones.

    FacesynthError as from `recognise`.
    """
    require_sound(audio, rate)
    kept: list[Spike] = []
    remarks: list[str] = []
    found = stretches(phone_hearing().spikes(audio, rate))
    for stretch, hardly in zip(found, _hardly(found), strict=True):
        sure = _sure(stretch)
        where = f"from {stretch[0].first_s:.1f} to {stretch[-1].last_s:.1f} s"
        if hardly:
            remarks.append(
                f"{where} what is heard is hardly speech ({sure:.0%} sure): music, laughter or breath? The lips rest there"
            )
            continue
        if len(stretch) >= FEWEST and sure < UNSURE:
            remarks.append(f"{where} phones were heard in much doubt ({sure:.0%} sure): is it speech?")
        kept += stretch
    if not kept:
        raise no_speech()
    return kept, tuple(remarks)


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
    if len(places) != len(near) or np.median(np.abs(_middles(places) - _middles(near))) > FURTHEST_S:
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
