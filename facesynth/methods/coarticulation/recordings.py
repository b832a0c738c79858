"""What is learned from of each recording: the middle of every phone, and the frames between neighbouring ones."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from facesynth.corpus import Utterance
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.coarticulation.model import CLASS_OF
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.coarticulation.decomposition import decompose, linear_weights
from facesynth.methods.coarticulation.keys import PhoneSamples
from facesynth.methods.coarticulation.transitions import Transitions


@dataclass(frozen=True, eq=False)
class Track:
    """One recording as displacements from rest."""

    frames: Floats
    """[T, D] NaN where something is missing."""
    numbers: Ints
    """[P] phones."""
    lengths_s: Floats
    """[P]"""
    middles: Ints
    """[P] the frame in the middle of each phone."""

    @property
    def classes(self) -> Ints:
        """[P] viseme classes."""
        return CLASS_OF[self.numbers]


def track_of(frames: Floats, phones: PhoneTrack, fps: float) -> Track:
    """Frames [T, D] with the phones that were said."""
    numbers = np.array([PHONES.index(label) for label in phones.labels])
    middles = np.round((phones.starts_s + phones.ends_s) / 2 * fps).astype(np.int64)
    return Track(frames, numbers, phones.ends_s - phones.starts_s, np.clip(middles, 0, len(frames) - 1))


def samples_of(tracks: Iterable[Track]) -> PhoneSamples:
    """The middle frames of all phones that have one."""
    shapes, numbers, around, lengths_s = [], [], [], []
    for track in tracks:
        middle = track.frames[track.middles]
        there = np.isfinite(middle).all(axis=1)
        padded = np.pad(track.classes, 2, constant_values=-1)
        shapes.append(middle[there])
        numbers.append(track.numbers[there])
        around.append(np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]], axis=1)[there])
        lengths_s.append(track.lengths_s[there])
    return PhoneSamples(np.concatenate(shapes), np.concatenate(numbers), np.concatenate(around), np.concatenate(lengths_s))


def transitions_of(tracks: Iterable[Track], over: int, stiffness: float) -> Transitions:
    """Weights of all frames between the middles of `over` phones in a row (2: diphones, 3: triphones).

    stiffness: share of the mean square of a transition's samples with which weights are drawn to straight lines, so that
    samples near rest, or near each other, give no arbitrary ones.
    """
    classes, times, weights, numbers = [], [], [], []
    for number, (samples, between, key) in enumerate(_pieces(tracks, over)):
        t = np.linspace(0, 1, len(between))
        prior = linear_weights(t, over)
        strength = stiffness * float(np.square(samples).sum(axis=1).mean()) + 1e-12
        found = decompose(between, np.broadcast_to(samples, (len(t), *samples.shape)), prior, strength)
        classes.append(np.tile(key, (len(t), 1)))
        times.append(t)
        weights.append(found)
        numbers.append(np.full(len(t), number))
    if not times:
        return Transitions(np.zeros((0, over), np.int64), np.zeros(0), np.zeros((0, over)), np.zeros(0, np.int64))
    return Transitions(np.concatenate(classes), np.concatenate(times), np.concatenate(weights), np.concatenate(numbers))


def _pieces(tracks: Iterable[Track], over: int) -> Iterator[tuple[Floats, Floats, Ints]]:
    """Samples [over, D], frames [n, D] and classes [over] of each transition without gaps, of two frames at least."""
    for track in tracks:
        for i in range(len(track.numbers) - over + 1):
            places = track.middles[i : i + over]
            between = track.frames[places[0] : places[-1] + 1]
            if len(between) > 2 and (np.diff(places) > 0).all() and np.isfinite(between).all():
                yield track.frames[places], between, track.classes[i : i + over]


def usable(utterances: Iterable[Utterance], emotion: str | None) -> list[Utterance]:
    """Recordings in one emotion alone; all where none is wanted."""
    return [u for u in utterances if emotion is None or set(u.speech.emotions.labels) == {emotion}]
