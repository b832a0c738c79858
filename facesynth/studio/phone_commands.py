"""Changes of a take's phones and of what must be said where. Who changes a phone vouches for it: its confidence is 1."""

from dataclasses import replace

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.segments import SHORTEST_PHONE_S
from facesynth.studio.document import Phone, Pin, Take, Word, check_phone, settled


def move_boundary(old: Take, phone: int, end_s: float) -> Take:
    """Let a phone end elsewhere, as far as it and the next one keep a length; words that ended there follow."""
    _require(old, phone, last=len(old.phones) - 2, what="boundary")
    low, high = old.start_s(phone) + SHORTEST_PHONE_S, old.phones[phone + 1].end_s - SHORTEST_PHONE_S
    if not low <= end_s <= high:
        raise FacesynthError(f"phone {phone} can end from {low:.3f} to {high:.3f} s; got {end_s:.3f} s")
    before_s = old.phones[phone].end_s
    words = tuple(
        Word(w.label, end_s if w.start_s == before_s else w.start_s, end_s if w.end_s == before_s else w.end_s) for w in old.words
    )
    before, after = (vouched._replace(confidence=1.0) for vouched in old.phones[phone : phone + 2])
    phones = (*old.phones[:phone], before._replace(end_s=end_s), after, *old.phones[phone + 2 :])
    return replace(old, phones=phones, words=words)


def relabel(old: Take, phone: int, label: str) -> Take:
    """Call a phone otherwise; silence has no node, so that a pin there goes."""
    _require(old, phone)
    pins = tuple(pin for pin in old.pins if pin.phone != phone or label != SILENCE)
    named = Phone(check_phone(label), old.phones[phone].end_s)
    return settled(replace(old, phones=(*old.phones[:phone], named, *old.phones[phone + 1 :]), pins=pins))


def split_phone(old: Take, phone: int, at_s: float, label: str) -> Take:
    """Make two of a phone; the second is called `label`."""
    _require(old, phone)
    low, high = old.start_s(phone) + SHORTEST_PHONE_S, old.phones[phone].end_s - SHORTEST_PHONE_S
    if not low <= at_s <= high:
        raise FacesynthError(f"phone {phone} can be split from {low:.3f} to {high:.3f} s; got {at_s:.3f} s")
    if label == old.phones[phone].label == SILENCE:
        raise FacesynthError("two silences in a row are one; split a silence with a phone")
    first, second = Phone(old.phones[phone].label, at_s), Phone(check_phone(label), old.phones[phone].end_s)
    pins = tuple(Pin(pin.phone + (pin.phone > phone), pin.node) for pin in old.pins)
    phones = (*old.phones[:phone], first, second, *old.phones[phone + 1 :])
    return settled(replace(old, phones=phones, pins=pins))


def join_phones(old: Take, phone: int) -> Take:
    """Make one of a phone and the next; it keeps the first one's name."""
    _require(old, phone, last=len(old.phones) - 2, what="phone with another after it")
    joined = Phone(old.phones[phone].label, old.phones[phone + 1].end_s)
    pins = tuple(Pin(pin.phone - (pin.phone > phone), pin.node) for pin in old.pins if pin.phone != phone + 1)
    return settled(replace(old, phones=(*old.phones[:phone], joined, *old.phones[phone + 2 :]), pins=pins))


def pin(old: Take, phone: int, node: str) -> Take:
    """A node must be used at a phone."""
    _require(old, phone)
    if old.phones[phone].label == SILENCE:
        raise FacesynthError(f"phone {phone} is silence, which has no node; constrain a phone that is spoken")
    others = (other for other in old.pins if other.phone != phone)
    return replace(old, pins=tuple(sorted([*others, Pin(phone, node)])))


def unpin(old: Take, phone: int) -> Take:
    """The search may choose at a phone again."""
    if all(pin.phone != phone for pin in old.pins):
        raise FacesynthError(f"no node is constrained at phone {phone}")
    return replace(old, pins=tuple(pin for pin in old.pins if pin.phone != phone))


def _require(take: Take, phone: int, last: int | None = None, what: str = "phone") -> None:
    last = len(take.phones) - 1 if last is None else last
    if not 0 <= phone <= last:
        raise FacesynthError(f"there is no {what} {phone}; the take has 0 to {last}")
