"""What a project says: lines in several takes, and nodes that were removed or drawn. Never changed in place."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.speech.intensity import IntensityCurve

TIME_DECIMALS = 6
"""Of a second, as files of emotions keep them."""
CONFIDENCE_DECIMALS = 2
"""As TextGrids keep them."""


class Phone(NamedTuple):
    """A phone, where it ends, and how sure it is (0 to 1) that it was said."""

    label: str
    end_s: float
    confidence: float = 1.0


class Word(NamedTuple):
    """A word and where it lies."""

    label: str
    start_s: float
    end_s: float


class Region(NamedTuple):
    """An emotion, where it ends, and how strong it is (0 to 1)."""

    emotion: str
    end_s: float
    intensity: float


class CurvePoint(NamedTuple):
    """A moment of the intensity curve, whose value every region's intensity is multiplied by."""

    time_s: float
    value: float


class Pin(NamedTuple):
    """A phone, by its number, and the node that must be used there."""

    phone: int
    node: str


class Drawn(NamedTuple):
    """A node that was drawn."""

    title: str
    phone: str
    emotion: str
    frames: tuple[tuple[float, ...], ...]
    """[L, C] at the rate of the recordings, in the layout's unit."""


@dataclass(frozen=True)
class Take:
    """One way of saying a line."""

    name: str
    phones: tuple[Phone, ...]
    words: tuple[Word, ...]
    emotions: tuple[Region, ...]
    curve: tuple[CurvePoint, ...] = ()
    """Of intensity; empty: 1 throughout."""
    pins: tuple[Pin, ...] = ()
    options: tuple[tuple[str, Any], ...] = ()
    """Other things that are asked of `speak`, by name; see `Request` and the method's own options."""

    @property
    def duration_s(self) -> float:
        """Length of the sound, seconds."""
        return self.phones[-1].end_s

    def start_s(self, phone: int) -> float:
        """Where a phone starts, seconds."""
        return self.phones[phone - 1].end_s if phone else 0.0

    def phone_track(self) -> PhoneTrack:
        """As methods take it; without confidences where nothing is doubted."""
        labels, ends_s, confidences = zip(*self.phones, strict=True)
        return PhoneTrack(labels, np.array(ends_s), np.array(confidences) if min(confidences) < 1 else None)

    def emotion_track(self) -> EmotionTrack:
        """As methods take it, the curve multiplied in."""
        labels, ends_s, intensities = zip(*self.emotions, strict=True)
        track = EmotionTrack(labels, np.array(ends_s), np.array(intensities))
        return IntensityCurve(*np.array(self.curve).T).over(track) if self.curve else track


@dataclass(frozen=True)
class Line:
    """A sound with what is said in it."""

    name: str
    """Of its folder and of its sound."""
    text: str
    takes: tuple[Take, ...]
    utterance: str = ""
    """Of the corpus, where it was taken from there: then there is a recording to compare with."""

    def take(self, name: str) -> Take:
        """A take by its name."""
        return _named("take", name, self.takes)

    def with_take(self, take: Take) -> Self:
        """With a take in place of the one of its name."""
        return replace(self, takes=tuple(take if old.name == take.name else old for old in self.takes))


@dataclass(frozen=True)
class Document:
    """Everything that can be undone."""

    lines: tuple[Line, ...] = ()
    removed: tuple[str, ...] = ()
    """Nodes that must not be used, in the order in which they were removed."""
    drawn: tuple[Drawn, ...] = ()

    def line(self, name: str) -> Line:
        """A line by its name."""
        return _named("line", name, self.lines)

    def with_line(self, line: Line) -> Self:
        """With a line in place of the one of its name."""
        return replace(self, lines=tuple(line if old.name == line.name else old for old in self.lines))

    def changing(self, line: str, take: str, change: Callable[[Take], Take]) -> Self:
        """With one take changed."""
        found = self.line(line)
        return self.with_line(found.with_take(change(found.take(take))))


def first_take(phones: PhoneTrack, words: Iterable[tuple[str, float, float]], emotions: EmotionTrack) -> Take:
    """A take of what was heard; times that files of emotions round are rounded here, so that both say the same."""
    regions = zip(emotions.labels, emotions.ends_s.tolist(), emotions.intensities.tolist(), strict=True)
    settled = [Region(label, in_file(end_s), value) for label, end_s, value in regions]
    end_s = float(phones.ends_s[-1])
    said = [Word(label, start_s, min(stop_s, end_s)) for label, start_s, stop_s in words]
    sure = np.ones(len(phones)) if phones.confidences is None else phones.confidences.round(CONFIDENCE_DECIMALS)
    rows = zip(phones.labels, phones.ends_s.tolist(), sure.tolist(), strict=True)
    return Take("1", tuple(Phone(*row) for row in rows), tuple(said), (*settled[:-1], settled[-1]._replace(end_s=end_s)))


def in_file(time_s: float) -> float:
    """A time as a file of emotions keeps it."""
    return round(float(time_s), TIME_DECIMALS)


def settled(take: Take) -> Take:
    """The take with neighbouring silences joined, as every reader of phones does, and pins following their phones."""
    phones: list[Phone] = []
    place: list[int] = []
    for phone in take.phones:
        if phones and phone.label == phones[-1].label == SILENCE:
            phones[-1] = phone
        else:
            phones.append(phone)
        place.append(len(phones) - 1)
    pins = (Pin(place[pin.phone], pin.node) for pin in take.pins)
    return replace(take, phones=tuple(phones), pins=tuple(pin for pin in pins if phones[pin.phone].label != SILENCE))


def check_phone(label: str) -> str:
    """A phone that there is; FacesynthError otherwise."""
    if label not in PHONES:
        raise unknown("phone", label, PHONES)
    return label


def take_facts(take: Take) -> Mapping[str, Any]:
    """A take as JSON can hold it."""
    return {
        "name": take.name,
        "phones": take.phones,
        "words": take.words,
        "emotions": take.emotions,
        "curve": take.curve,
        "pins": take.pins,
        "options": dict(take.options),
        "duration_s": take.duration_s,
    }


def take_of(facts: Mapping[str, Any]) -> Take:
    """The inverse of `take_facts`."""
    try:
        return Take(
            str(facts["name"]),
            tuple(map(phone_of, facts["phones"])),
            tuple(Word(str(label), float(start_s), float(end_s)) for label, start_s, end_s in facts["words"]),
            tuple(Region(str(label), float(end_s), float(value)) for label, end_s, value in facts["emotions"]),
            tuple(CurvePoint(float(time_s), float(value)) for time_s, value in facts.get("curve", ())),
            tuple(Pin(int(phone), str(node)) for phone, node in facts.get("pins", ())),
            tuple(sorted(dict(facts.get("options", {})).items())),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FacesynthError(f"this is no take of a line: {error!r}; wanted name, phones, words and emotions") from None


def phone_of(row: Sequence[Any]) -> Phone:
    """A phone of JSON: label, end and, of those that were heard, a confidence; FacesynthError where that is none."""
    label, end_s, *confidence = row
    phone = Phone(str(label), float(end_s), *map(float, confidence))
    if not 0 <= phone.confidence <= 1:
        raise FacesynthError(f"how sure a phone is goes from 0 to 1; got {phone.confidence:g} of {phone.label!r:.40}")
    return phone


def _named(kind: str, name: str, things: tuple[Any, ...]) -> Any:
    found = next((thing for thing in things if thing.name == name), None)
    if found is None:
        raise unknown(kind, name, [thing.name for thing in things])
    return found
