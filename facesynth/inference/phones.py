"""Phones and viseme classes: which labels exist, which look alike on the face."""

from collections.abc import Mapping

from .errors import unknown

SILENCE = "pau"

VISEME_CLASSES: tuple[tuple[str, ...], ...] = (
    ("pau",),
    ("ae", "ax", "ah", "aa"),
    ("ao", "y", "iy", "ih", "ay", "aw"),
    ("ey", "eh", "el", "em", "en", "er"),
    ("b", "p", "m"),
    ("r",),
    ("k", "g", "ng"),
    ("f", "v"),
    ("ow", "oy"),
    ("th", "dh"),
    ("hh",),
    ("ch", "sh", "jh"),
    ("n", "d", "t", "l"),
    ("s", "z", "zh"),
    ("w", "uw", "uh"),
)
"""Phones that look alike (Deng, Chiang, Fox and Neumann 2006, table A1)."""

PHONES: tuple[str, ...] = tuple(phone for group in VISEME_CLASSES for phone in group)
"""Every phone that facesynth knows: ARPAbet, lower case, no stress, and `pau` for silence."""

PHONE_INDEX: Mapping[str, int] = {phone: index for index, phone in enumerate(PHONES)}
"""The place of each phone in PHONES."""
VISEMES: tuple[int, ...] = tuple(index for index, group in enumerate(VISEME_CLASSES) for _ in group)
"""The viseme class, 0 to 14, of each of PHONES."""

VOWELS = frozenset(["aa", "ae", "ah", "ao", "aw", "ax", "ay", "eh", "er", "ey", "ih", "iy", "ow", "oy", "uh", "uw"])
OPEN_VOWELS = frozenset(["aa", "ae", "ah", "ao", "aw", "ay"])
"""Vowels at which the mouth cannot be shut."""
BILABIALS = frozenset(["p", "b", "m"])
"""The lips close."""
LABIODENTALS = frozenset(["f", "v"])
"""The lower lip meets the upper teeth."""

_VISEME_OF = {phone: index for index, group in enumerate(VISEME_CLASSES) for phone in group}


def viseme_of(phone: str) -> int:
    """Index into VISEME_CLASSES of a phone, 0 (silence) to 14."""
    if phone not in _VISEME_OF:
        raise unknown("phone", phone, PHONES)
    return _VISEME_OF[phone]
