"""Letters as English has them: marks that nobody hears go, letters of other alphabets become the nearest of a to z."""

import re
import unicodedata
from collections.abc import Mapping

from facesynth.speech.written_forms import one_alphabet

_LATIN = {
    **{"ß": "ss", "ẞ": "SS", "æ": "ae", "Æ": "AE", "œ": "oe", "Œ": "OE", "ø": "o", "Ø": "O", "ł": "l", "Ł": "L", "đ": "d"},
    **{"Đ": "D", "ð": "th", "Ð": "Th", "þ": "th", "Þ": "Th", "ħ": "h", "Ħ": "H", "ı": "i", "ŋ": "ng", "Ŋ": "NG", "ə": "e"},
    **{"Ə": "E", "ƒ": "f", "ŧ": "t", "ĸ": "k", "ſ": "s"},
}
_CYRILLIC = {
    **{"а": "a", "б": "b", "в": "v", "г": "g", "д": "d", "е": "e", "ж": "zh", "з": "z", "и": "i", "й": "y", "к": "k"},
    **{"л": "l", "м": "m", "н": "n", "о": "o", "п": "p", "р": "r", "с": "s", "т": "t", "у": "u", "ф": "f", "х": "kh"},
    **{"ц": "ts", "ч": "ch", "ш": "sh", "щ": "shch", "ъ": "", "ы": "y", "ь": "", "э": "e", "ю": "yu", "я": "ya", "ё": "yo"},
    **{"і": "i", "ї": "yi", "є": "ye", "ґ": "g", "ђ": "dj", "ј": "j", "љ": "lj", "њ": "nj", "ћ": "c", "џ": "dz", "ў": "u"},
}
_GREEK = {
    **{"α": "a", "β": "v", "γ": "g", "δ": "d", "ε": "e", "ζ": "z", "η": "i", "θ": "th", "ι": "i", "κ": "k", "λ": "l"},
    **{"μ": "m", "ν": "n", "ξ": "x", "ο": "o", "π": "p", "ρ": "r", "σ": "s", "ς": "s", "τ": "t", "υ": "y", "φ": "f"},
    **{"χ": "ch", "ψ": "ps", "ω": "o"},
}


def _both_cases(letters: Mapping[str, str]) -> dict[str, str]:
    return {**letters, **{letter.upper(): said.capitalize() for letter, said in letters.items() if len(letter.upper()) == 1}}


_LETTERS = str.maketrans({**_both_cases(_CYRILLIC), **_both_cases(_GREEK), **_LATIN})
_APOSTROPHES = str.maketrans(dict.fromkeys("\u2019\u2018\u02bc\u00b4`\u2032\u201b\uff07\u02b9", "'"))
_DASHES = str.maketrans({**dict.fromkeys("\u2010\u2011\u2212", "-"), **dict.fromkeys("\u2012\u2013\u2014\u2015", "–")})
_SPACES_IN_NUMBERS = re.compile(r"(?<=\d)[\u00a0\u2009\u202f](?=\d{3}(?!\d))")


def cleaned(text: str) -> str:
    """Text without marks of no width and emoji, with one alphabet in each word, one kind of apostrophe and of dash."""
    text = _SPACES_IN_NUMBERS.sub("", text)
    text = re.sub(r"(?<![\d,.])\d{1,3}(?: \d{3}){2,}(?![\d,.])", lambda match: match[0].replace(" ", ""), text)
    kept = "".join(letter for letter in text if unicodedata.category(letter) not in ("Cf", "Cs", "Co") and letter != "\ufe0f")
    return one_alphabet(kept).translate(_APOSTROPHES).translate(_DASHES)


def folded(text: str) -> str:
    """Text with the letters of Latin, Cyrillic and Greek alphabets as a to z; other signs stay."""
    plain = unicodedata.normalize("NFKC", text).translate(_LETTERS)
    bare = (letter for letter in unicodedata.normalize("NFKD", plain) if not unicodedata.combining(letter))
    return "".join(bare).translate(_LETTERS)
