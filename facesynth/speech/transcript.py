"""What a person wrote, as the words that a person says."""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from typing import Any

from facesynth.speech.pronunciation import is_known

_ABBREVIATIONS = {
    **{"mr": "mister", "mrs": "missus", "ms": "miz", "dr": "doctor", "prof": "professor", "st": "saint", "jr": "junior"},
    **{"sr": "senior", "vs": "versus", "etc": "et cetera", "e.g": "for example", "i.e": "that is", "approx": "approximately"},
    **{"no": "number", "vol": "volume", "fig": "figure", "dept": "department", "est": "established", "inc": "incorporated"},
    **{"ltd": "limited", "co": "company", "gen": "general", "sgt": "sergeant", "capt": "captain", "hon": "honorable"},
}
_ONLY_BEFORE_A_NUMBER = {"no", "vol", "fig"}
_SIGNS = {"&": "and", "%": "percent", "@": "at", "+": "plus", "=": "equals", "°": "degrees", "#": "number"}
_CURRENCIES = {"$": ("dollar", "cent"), "£": ("pound", "penny"), "€": ("euro", "cent"), "¥": ("yen", "sen")}
_NUMBER = r"\d+(?:,\d{3})+(?:\.\d+)?|\d+(?:\.\d+)?"


def words_of(text: str) -> tuple[str, ...]:
    """The words said in a text, lower case, only a to z and apostrophes inside; numbers, sums of money, times and
    usual abbreviations are written out, hyphens part words, short unknown words in capitals are spelt.
    """
    plain = unicodedata.normalize("NFKC", text).replace("\u2019", "'").replace("\u2018", "'").replace("\u02bc", "'")
    plain = "".join(letter for letter in unicodedata.normalize("NFKD", plain) if not unicodedata.combining(letter))
    plain = _numbers_written_out(_abbreviations_written_out(plain))
    for sign, word in _SIGNS.items():
        plain = plain.replace(sign, f" {word} ")
    shouted = plain.upper() == plain
    tokens = re.findall(r"[A-Za-z]+(?:'[A-Za-z]+)*'?|'[A-Za-z]+", plain)
    return tuple(word for token in tokens for word in _spelt(token, shouted))


def _abbreviations_written_out(text: str) -> str:
    def full(match: re.Match[str]) -> str:
        short = match[1].lower()
        if short in _ONLY_BEFORE_A_NUMBER and not re.match(r"\s*\d", match.string[match.end() :]):
            return match[0]
        return _ABBREVIATIONS[short]

    short_forms = "|".join(re.escape(short) for short in sorted(_ABBREVIATIONS, key=len, reverse=True))
    text = re.sub(rf"(?<![\w.])({short_forms})\.(?!\w)", full, text, flags=re.IGNORECASE)
    return re.sub(r"\b(?:[A-Za-z]\.){2,}", lambda match: " ".join(match[0].replace(".", " ").split()) + " ", text)


def _numbers_written_out(text: str) -> str:
    text = re.sub(rf"([{''.join(_CURRENCIES)}])({_NUMBER})(\s+(?:thousand|million|billion|trillion)\b)?", _money, text)
    text = re.sub(r"\b(\d{1,2}):(\d\d)\b", lambda m: f"{_cardinal(m[1])} {_minutes(m[2])}", text)
    text = re.sub(r"\b(\d+(?:st|nd|rd|th))\b", lambda m: _inflect().number_to_words(m[1].lower()), text, flags=re.IGNORECASE)
    text = re.sub(r"\b(1[1-9]\d0|20[1-9]0|[2-9]0)s\b", lambda m: _decade(m[1]), text)
    text = re.sub(r"\b(1[1-9]\d\d|20[1-9]\d)\b(?![.,]\d)", lambda m: _year(m[1]), text)
    text = re.sub(r"(?<![\w)])-(?=\d)", " minus ", text)
    return re.sub(_NUMBER, lambda m: f" {_cardinal(m[0])} ", text)


def _money(match: re.Match[str]) -> str:
    unit, small = _CURRENCIES[match[1]]
    whole, _, part = match[2].replace(",", "").partition(".")
    if match[3]:
        return f"{_cardinal(match[2])}{match[3]} {_plural(unit, 2)}"
    said = f"{_cardinal(whole)} {_plural(unit, int(whole))}"
    cents = int(part[:2].ljust(2, "0")) if part else 0
    return f"{said} and {_cardinal(str(cents))} {_plural(small, cents)}" if cents else said


def _plural(unit: str, count: int) -> str:
    return unit if count == 1 or unit in ("yen", "sen") else {"penny": "pence"}.get(unit, f"{unit}s")


def _cardinal(digits: str) -> str:
    digits = digits.replace(",", "")
    if len(digits) > 1 and digits.startswith("0") and "." not in digits:
        return " ".join(_inflect().number_to_words(digit) for digit in digits)
    return str(_inflect().number_to_words(digits, andword="", comma=""))


def _minutes(digits: str) -> str:
    if digits == "00":
        return "o'clock"
    return f"oh {_cardinal(digits[1])}" if digits[0] == "0" else _cardinal(digits)


def _year(digits: str) -> str:
    century, rest = _cardinal(digits[:2]), digits[2:]
    if rest == "00":
        return f"{century} hundred"
    return f"{century} oh {_cardinal(rest[1])}" if rest[0] == "0" else f"{century} {_cardinal(rest)}"


def _decade(digits: str) -> str:
    said = _year(digits) if len(digits) == 4 else _cardinal(digits)
    return re.sub("y$", "ies", said) if said.endswith("y") else f"{said}s"


def _spelt(token: str, shouted: bool) -> list[str]:
    """A token as words: letter by letter when it is a short word in capitals that no dictionary knows."""
    word = token.lower()
    if not is_known(word):
        word = word.strip("'")
    if token.isupper() and not shouted and 1 < len(word) <= 5 and not is_known(word):
        return list(word)
    return [word] if word else []


@cache
def _inflect() -> Any:
    import inflect

    return inflect.engine()
