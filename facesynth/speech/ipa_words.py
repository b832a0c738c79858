"""Words written in the International Phonetic Alphabet, as grapheme-to-phoneme packages give them, as facesynth's phones."""

import re
import unicodedata
from functools import cache

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.phone_labels import normalise_phone

_TIES = "\u0361\u035c"
_NO_SYLLABLE = "\u032f"
_GLIDES = "iɪuʊyʏ"
"""Vowels that end a diphthong when they are marked as no syllable of their own."""
_NASAL = "\u0303"


def phones_of_ipa(word: str) -> tuple[str, ...]:
    """The phones of a word in IPA: affricates and marked diphthongs are one phone, everything else one letter with its marks.

    A letter that means no sound is left out; nothing is left of a word without any.
    """
    return tuple(phone for sound in _sounds(unicodedata.normalize("NFD", word)) if (phone := _phone(sound)) is not None)


def _sounds(word: str) -> list[str]:
    """Letters with their marks; tied letters are one, and so are a vowel and a vowel behind it that is no syllable."""
    sounds: list[str] = []
    for letter in word:
        is_mark = unicodedata.category(letter) in ("Mn", "Lm", "Sk", "Me") and letter not in "ʰʱ"
        tied = bool(sounds) and sounds[-1][-1] in _TIES
        if letter == _NO_SYLLABLE and len(sounds) > 1 and sounds[-1][0] in _GLIDES and _is_vowel(sounds[-2]):
            glide = sounds.pop()
            sounds[-1] += glide + letter
        elif sounds and (is_mark or tied):
            sounds[-1] += letter
        else:
            sounds.append(letter)
    return sounds


def _is_vowel(sound: str) -> bool:
    return bool(re.match(r"[aeiouyøœɐɑɒɔɘəɛɜɞɤɨɪɯɵɶʉʊʌʏæ]", sound)) and _NO_SYLLABLE not in sound


@cache
def _phone(sound: str) -> str | None:
    try:
        phone = normalise_phone(sound, "ipa")
    except FacesynthError:
        return None
    return None if phone == SILENCE else phone
