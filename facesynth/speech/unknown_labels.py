"""Labels of phones that mean nothing here, among others that do: what stands for them, and what is said of it."""

from collections import Counter
from collections.abc import Sequence

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.phone_labels import Notation, normalise_phone
from facesynth.speech.segments import Segment

MOST_UNKNOWN = 0.5
"""Where a larger share of the different labels means nothing, they are no phones."""
MOST_NAMED = 4
LONGEST_LABEL = 24
"""Letters; what is longer is a sentence, or damaged, and no part of it is looked at."""


def with_stand_ins(segments: Sequence[Segment], notation: Notation) -> tuple[list[Segment], tuple[str, ...]]:
    """Segments whose unknown labels became known ones, and what a person should know of it.

    What is left of a label without its first letters stands for it as soon as that is a phone (the `an` of `ian4`: a glide
    passes sooner than the vowel after it), else silence does. FacesynthError where most labels are unknown.
    """
    counted = Counter(label for label, _, _ in segments)
    phones = {label: _phone(label, notation) for label in counted}
    unread = [label for label, phone in phones.items() if phone is None]
    spoken = [label for label, phone in phones.items() if phone != SILENCE]
    if len(unread) > MOST_UNKNOWN * len(spoken):
        normalise_phone(unread[0], notation)
    stand_in = {label: _stand_in(label, notation) for label in unread}
    known = [(stand_in.get(label, label), start_s, end_s) for label, start_s, end_s in segments]
    return known, _remarks(stand_in, counted, notation)


def _phone(label: str, notation: Notation) -> str | None:
    try:
        return normalise_phone(label, notation)
    except FacesynthError:
        return None


def _stand_in(label: str, notation: Notation) -> str:
    """A label that means something here; empty, which is silence, where nothing is like it."""
    letters = "".join(letter for letter in label if letter.isalpha())
    readable = 0.5 * len(label.strip()) <= len(letters) <= LONGEST_LABEL
    tails = (letters[k:] for k in range(len(letters))) if readable else ()
    return next((tail for tail in tails if _phone(tail, notation) not in (None, SILENCE)), "")


def _remarks(stand_in: dict[str, str], counted: Counter[str], notation: Notation) -> tuple[str, ...]:
    if not stand_in:
        return ()
    named = list(stand_in.items())[:MOST_NAMED]
    said = ", ".join(
        f"{label!r:.40} ({counted[label]}) as {_phone(tail, notation) if tail else 'a rest of the lips'}" for label, tail in named
    )
    more = f" and {len(stand_in) - MOST_NAMED} more" if len(stand_in) > MOST_NAMED else ""
    return (f"labels that are no phones known here are taken as what is nearest: {said}{more}",)
