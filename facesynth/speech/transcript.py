"""What a person wrote, as the words that a person says."""

import re

from facesynth.speech.addresses import addresses_written_out, telephones_written_out
from facesynth.speech.directions import without_directions
from facesynth.speech.folding import cleaned, folded
from facesynth.speech.numbers_said import numbers_written_out
from facesynth.speech.pronunciation import is_known
from facesynth.speech.romans_said import romans_written_out
from facesynth.speech.written_forms import plainly_written

_ABBREVIATIONS = {
    **{"mr": "mister", "mrs": "missus", "ms": "miz", "dr": "doctor", "prof": "professor", "st": "saint", "jr": "junior"},
    **{"sr": "senior", "vs": "versus", "etc": "et cetera", "e.g": "for example", "i.e": "that is", "approx": "approximately"},
    **{"no": "number", "nos": "numbers", "vol": "volume", "fig": "figure", "dept": "department", "est": "established"},
    **{"ltd": "limited", "co": "company", "corp": "corporation", "inc": "incorporated", "gen": "general", "sgt": "sergeant"},
    **{"capt": "captain", "lt": "lieutenant", "col": "colonel", "rev": "reverend", "hon": "honorable", "gov": "governor"},
    **{"sen": "senator", "rep": "representative", "pres": "president", "mt": "mount", "ft": "fort", "ave": "avenue"},
    **{"blvd": "boulevard", "rd": "road", "ln": "lane", "hwy": "highway", "apt": "apartment", "min": "minutes", "max": "maximum"},
    **{"pp": "pages", "p": "page", "ch": "chapter", "al": "al", "ph.d": "p h d", "cf": "compare", "tel": "telephone"},
    **{"jan": "january", "feb": "february", "aug": "august", "sept": "september", "oct": "october", "nov": "november"},
    **{"dec": "december", "mon": "monday", "tue": "tuesday", "tues": "tuesday", "thu": "thursday", "thurs": "thursday"},
    **{"fri": "friday", "a.k.a": "also known as", "asst": "assistant", "bros": "brothers", "mme": "madame", "ca": "circa"},
    **{"c": "circa", "doz": "dozen", "messrs": "messers", "esp": "especially", "ext": "extension", "rt": "route"},
    **{"rte": "route", "bldg": "building", "feat": "featuring", "incl": "including", "sec": "section"},
}
_ONLY_BEFORE_A_NUMBER = frozenset({"no", "nos", "vol", "fig", "p", "pp", "ch", "sec", "ca", "c", "ext", "rt", "rte", "bldg"})
_ONLY_BEFORE_A_NAME = frozenset({"gen", "col", "rev", "hon", "gov", "sen", "rep", "pres", "mt", "ft", "lt", "st", "mon", "fri"})
_UNITS = frozenset({"ms", "ft", "min", "p", "sec"})
"""Measures, where they follow a number."""
_TITLES = re.compile(r"\b(Mr|Mrs|Ms|Dr|Prof|St|Jr|Sr|Sgt|Capt)(?=\s+[A-Z])")
_STREET = re.compile(r"(?<=[a-z]\s)(St|Dr)\b\.?(?=\s*(?:[,;.!?]|$|[a-z]|\d))")
_SIGNS = {"&": "and", "%": "percent", "@": "at", "+": "plus", "=": "equals", "°": "degrees", "#": "number", "№": "number"}
_SIGNS |= {"×": "times", "÷": "divided by", "±": "plus or minus", "~": "about", "≈": "about", "§": "section"}
_SIGNS |= {"≤": "at most", "≥": "at least"}
_SPELT = frozenset({"US"})
"""Short forms that are words as well."""


def words_of(text: str) -> tuple[str, ...]:
    """The words said in a text, lower case, only a to z and apostrophes inside; numbers, money, dates, times, measures and
    usual abbreviations are written out, hyphens part words, short unknown words in capitals are spelt, letters of other
    alphabets become the nearest of a to z, and directions such as `[music]` or `(laughs)` are left out.
    """
    plain = without_directions(cleaned(text))[0]
    shouted = plain.upper() == plain
    plain = plainly_written(telephones_written_out(addresses_written_out(plain)))
    plain = _abbreviations_written_out(plain)
    plain = numbers_written_out(romans_written_out(plain))
    for sign, word in _SIGNS.items():
        plain = plain.replace(sign, f" {word} ")
    plain = folded(plain)
    tokens = re.findall(r"[A-Za-z]+(?:'[A-Za-z]+)*(?:(?<=s)')?|'[A-Za-z]+", plain)
    return tuple(word for token in tokens for word in _spelt(token, shouted))


def left_out(text: str) -> tuple[str, ...]:
    """What of a text is not said: directions such as `[music]` or `(laughs)`."""
    return without_directions(cleaned(text))[1]


def _abbreviations_written_out(text: str) -> str:
    def full(match: re.Match[str]) -> str:
        short, following = match[1].casefold(), match.string[match.end() :]
        if short in _UNITS and re.search(r"\d\s?$", match.string[: match.start()]):
            return match[0].rstrip(".")
        if short in _ONLY_BEFORE_A_NUMBER and not re.match(r"\s*(?:\d|[IVX]{2,}\b|[VX]\b)", following):
            return match[0]
        if short in _ONLY_BEFORE_A_NAME and not re.match(r"\s*[A-Z]", following):
            return match[0]
        return _ABBREVIATIONS[short]

    text = _STREET.sub(lambda match: {"St": "street", "Dr": "drive"}[match[1]], text)
    text = _TITLES.sub(lambda match: _ABBREVIATIONS[match[1].lower()], text)
    text = re.sub(r"(?<!\w)w/(?=\s?\w)", "with ", re.sub(r"(?<!\w)w/o\b", "without", text))
    text = re.sub(r"(?<!\w)vs\b(?!\.)", "versus", text)
    text = re.sub(r"\bN[º°]\s?(?=\d)", "number ", text)
    text = re.sub(r"\b([ap])\.\s?m\.", r"\1m", text, flags=re.IGNORECASE)
    short_forms = "|".join(re.escape(short) for short in sorted(_ABBREVIATIONS, key=len, reverse=True))
    text = re.sub(rf"(?<![\w.])({short_forms})\.(?!\w)", full, text, flags=re.IGNORECASE)
    return re.sub(r"\b(?:[A-Za-z]\.){2,}", lambda match: " ".join(match[0].replace(".", " ").split()) + " ", text)


def _spelt(token: str, shouted: bool) -> list[str]:
    """A token as words: letter by letter when it is a short word in capitals that no dictionary knows."""
    word = token.lower()
    if not is_known(word):
        word = word.strip("'")
    capitals = re.fullmatch(r"([A-Z]{2,5})('?s)?", token)
    if capitals and not shouted and (not is_known(capitals[1].lower()) or capitals[1] in _SPELT):
        letters = list(capitals[1].lower())
        return [*letters[:-1], letters[-1] + "'s"] if capitals[2] else letters
    return [word] if word else []
