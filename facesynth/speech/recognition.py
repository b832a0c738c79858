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
_IN_THE_MODEL = {"ax": "ah", "el": "l", "em": "m", "en": "n"}
"""Phones that pocketsphinx's English model lacks, and those that stand in for them."""


def recognise(audio: NDArray[np.float32], rate: int, *, fit: bool = True) -> PhoneTrack:
    """Phones heard in a sound [S], -1..1, at `rate` Hz, of any length and language, with confidences.

    fit: place them by fitting the heard phones to the sound, which takes ten times as long as hearing them; else they lie
    around the network's spikes. FacesynthError where the sound is too short, silent, or holds no speech.
    """
    require_sound(audio, rate)
    heard = phone_hearing().spikes(audio, rate)
    if not heard:
        raise no_speech()
    return placed(audio, rate, heard, fit=fit)


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
