"""Phones and viseme classes: which labels exist, which look alike on the face, what other aligners call them."""

from __future__ import annotations

import re
import unicodedata
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

CLOSURES = {"bcl": "b", "dcl": "d", "gcl": "g", "pcl": "p", "tcl": "t", "kcl": "k"}
"""TIMIT's closures before the release of a stop."""

_OTHER_NAMES: dict[str, str] = {
    **CLOSURES,
    # silences, noises and pauses
    **dict.fromkeys(
        ["", "sil", "sp", "spn", "nsn", "pause", "silence", "h#", "#h", "epi", "#", "_", "-", "<eps>", "noise"], "pau"
    ),
    **dict.fromkeys(
        ["breath", "cough", "smack", "uh_noise", "um_noise", "lau", "brth", "<p:>", "<usb>", "p:", "ssil", "q"], "pau"
    ),
    # the fuller ARPAbet of TIMIT and of other dictionaries
    **{"ix": "ih", "ax-h": "ax", "axr": "er", "ux": "uw", "dx": "t", "nx": "n", "hv": "hh", "eng": "ng", "h": "hh"},
    **{"wh": "w", "j": "y", "oh": "aa", "ia": "ih", "ea": "eh", "ua": "uh", "lx": "l", "rx": "r", "sch": "sh"},
    # International Phonetic Alphabet, English
    **{"ɑ": "aa", "ɒ": "aa", "a": "aa", "ɐ": "ah", "ʌ": "ah", "ə": "ax", "æ": "ae", "ɔ": "ao", "ɛ": "eh", "e": "ey"},
    **{"ɜ": "er", "ɝ": "er", "ɚ": "er", "ɪ": "ih", "ɨ": "ih", "i": "iy", "ʊ": "uh", "u": "uw", "ʉ": "uw", "o": "ow"},
    **{"aɪ": "ay", "aj": "ay", "aʊ": "aw", "eɪ": "ey", "ej": "ey", "oʊ": "ow", "əʊ": "ow", "əw": "ow", "ɔɪ": "oy", "ɔj": "oy"},
    **{"ɪə": "ih", "eə": "eh", "ɛə": "eh", "ʊə": "uh"},
    **{"θ": "th", "ð": "dh", "ʃ": "sh", "ʒ": "zh", "tʃ": "ch", "ʧ": "ch", "dʒ": "jh", "ʤ": "jh", "ŋ": "ng", "ɲ": "n"},
    **{"ɹ": "r", "ɻ": "r", "ɾ": "t", "ʔ": "pau", "ɫ": "l", "ʎ": "l", "ɡ": "g", "c": "k", "ɟ": "g", "x": "k", "ç": "hh", "ʍ": "w"},
    **{"l̩": "el", "m̩": "em", "n̩": "en", "ɫ̩": "el"},
}
"""What other dictionaries, aligners and transcribers call these phones."""

_IPA_MARKS = "ːˑʰʲʷˈˌ͡‿˞ⁿˠˤ̪̥̬̃"


def viseme_of(phone: str) -> int:
    """Index into VISEME_CLASSES of a phone, 0 (silence) to 14."""
    if phone not in _VISEME_OF:
        raise unknown("phone", phone, PHONES)
    return _VISEME_OF[phone]


def normalise_phone(label: str) -> str:
    """The phone that a label of any usual aligner means.

    Stress digits, Kaldi's positions (`_B`), noise marks (`+SPN+`, `<sil>`) and IPA's length and aspiration go;
    an empty label is silence. FacesynthError, naming the nearest phones, for a label that means nothing here.
    """
    plain = unicodedata.normalize("NFC", label).strip().lower()
    plain = re.sub(r"_[bies]$", "", plain)
    if plain.startswith(("+", "[", "{")) and plain.endswith(("+", "]", "}")):
        return SILENCE
    plain = re.sub(r"(?<=[a-z])[0-3]$", "", plain)
    for candidate in (plain, plain.strip("<>()*"), plain.translate(dict.fromkeys(map(ord, _IPA_MARKS)))):
        if candidate in _VISEME_OF:
            return candidate
        if candidate in _OTHER_NAMES:
            return _OTHER_NAMES[candidate]
    raise unknown("phone", label, PHONES)
