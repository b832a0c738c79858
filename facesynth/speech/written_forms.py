"""Short ways of writing as the longer ones that the rules of numbers and abbreviations read.

`9am-5pm` becomes `9am to 5pm`, `Mon-Fri` monday to friday, `10^6` `10⁶`, `1h30` 1 hr 30,
a Greek letter that stands alone its name.
"""

import re
import unicodedata
from collections.abc import Callable

_DAYS = {
    **{"Sun": "sunday", "Mon": "monday", "Tue": "tuesday", "Tues": "tuesday", "Wed": "wednesday", "Thu": "thursday"},
    **{"Thur": "thursday", "Thurs": "thursday", "Fri": "friday", "Sat": "saturday"},
}
_DAY = f"({'|'.join(sorted(_DAYS, key=len, reverse=True))})\\b"
_HALF = r"[aApP]\.?\s?[mM]\b\.?"
_CLOCK = r"\d{1,2}(?:[:.]\d\d)?"
_ZONES = "EST|EDT|CST|CDT|MST|MDT|PST|PDT|GMT|UTC|CET|CEST|BST|IST|JST|ET|PT"
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_GREEK = {
    **{"α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "epsilon", "ζ": "zeta", "η": "eta", "θ": "theta"},
    **{"ι": "iota", "κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "ο": "omicron", "π": "pi", "ρ": "rho"},
    **{"σ": "sigma", "τ": "tau", "υ": "upsilon", "φ": "phi", "χ": "chi", "ψ": "psi", "ω": "omega"},
}
_LOOKALIKES = dict(zip("аеорсхуіјѕԁһΑΒΕΖΗΙΚΜΝΟΡΤΥΧονАВЕКМНОРСТХІЈЅУ", "aeopcxyijsdhABEZHIKMNOPTYXovABEKMHOPCTXIJSY", strict=True))
_FOREIGN = r"[\u0370-\u03ff\u0400-\u052f]"
_POINTS = {"N": "north", "S": "south", "E": "east", "W": "west"}
_EMOTICON = re.compile(r"(?<!\S)(?:[:;=8][-'^o]?[)(\[\]DPpOo|/\\*]+|<3+|[xX]D+)(?=[\s.,!?]|$)")
Replacement = str | Callable[[re.Match[str]], str]

_LIKE_AN_INCH = re.compile(r"""(?<=[\d½¼¾⅛⅜⅝⅞])(?<!'\d)(?<!'\d\d)\s?("|”)|"|“|”""")
_FORMS: tuple[tuple[str, Replacement], ...] = (
    ("[™®℠©]", " "),
    (r"(?m)^\s*#+\s+(?=[A-Za-z])", ""),
    (r"\b([Nn]os?|[Vv]ol|[Ff]ig|[Pp]p?|[Cc]h|[Ss]ec)\.(?=\d)", r"\1. "),
    (r"([⁰¹²³⁴-⁹]*)⁺", lambda charge: f" {unicodedata.normalize('NFKC', charge[1])} plus "),
    (r"(?<!\w)([⁰¹²³⁴-⁹]+)(?=[A-Z])", lambda count: f"{unicodedata.normalize('NFKC', count[1])} "),
    (r"(?<=[A-Za-z]{3})(?<!sin)(?<!cos)(?<!tan)(?<!log)[⁰¹²³⁴-⁹]+(?!\w)|(?<=[.,;!?])[⁰¹²³⁴-⁹]+", " "),
    (r"(?<=[\w)])ⁿ", " to the n "),
    (rf"\b({_CLOCK}\s?(?:{_HALF})?)\s?[-–]\s?(?={_CLOCK}\s?{_HALF})", r"\1 to "),
    (r"\b(\d{1,2}:\d\d)\s?[-–]\s?(?=\d{1,2}:\d\d)", r"\1 to "),
    (rf"(\d\s?|\d\s?[aApP]\.?\s?[mM]\.?\s)({_ZONES})\b", lambda zone: f"{zone[1]} {' '.join(zone[2])} "),
    (rf"\b{_DAY}\.?\s?[-–]\s?{_DAY}\.?", lambda days: f"{_DAYS[days[1]]} to {_DAYS[days[2]]}"),
    (rf"(?<![tT]he )\b{_DAY}(?:\.(?=,? ?[\w&])|(?=,? \d))", lambda day: _DAYS[day[1]]),
    (rf"(?<=day and ){_DAY}\.?", lambda day: _DAYS[day[1]]),
    (r"\b(Tues?|Wed|Thur?s?|Fri)\.", lambda day: f"{_DAYS[day[1]]}."),
    (r"\bSat\.? ?& ?Sun\b\.?", "saturday and sunday"),
    (r"\b(\d+)\s?h(?:rs?)?\s?(\d+)\s?m(?:ins?)?(?:\s?(\d+)\s?s(?:ecs?)?)?\b", lambda m: _lasting(m[1], m[2], m[3])),
    (r"\b(\d+)h([0-5]\d)\b", r"\1 hr \2"),
    (r"\b(\d+)\s?m(?:ins?)?\s([0-5]?\d)\s?s(?:ecs?)?\b", r"\1 min \2 sec"),
    (r"\b(AD|CE|BCE|BC)(?=\s?\d)|(?<=\d)(\s?)(AD|CE|BCE|BC)\b", lambda era: f"{era[2] or ''}{' '.join(era[1] or era[3])} "),
    (r"\b((?:by|on|next|last|this|every|until|from|since) )" + _DAY + r"\.?(?=\W|$)", lambda day: f"{day[1]}{_DAYS[day[2]]}"),
    (r"\bWW\s?(?:II|2)\b", "World War 2"),
    (r"\bWW\s?[I1]\b", "World War 1"),
    (r"\bFY\s?(?=\d)", "F Y "),
    (r"(?<![\d/])9/11\b(?!/)", "nine eleven"),
    (r"(?<![\d/])([1-9]|10)/\1\b(?!/)", r"\1 out of \1"),
    (r"(?<![\d/])0/10\b", "zero out of ten"),
    (r"(?<![\d/])\b((?:19|20)\d\d)/(\d\d)\b(?!/)", r"\1 \2"),
    (r"(?<=\d)-(?=(?:thousand|million|billion|trillion)\b)", " "),
    (r"(?<![\d/-])(\d+)-(?=\d+/\d+)", r"\1 "),
    (r"\b50[-–]50\b", "fifty fifty"),
    (r"(?<![\d,. ])(\d{1,3}) (?=000\b|\d{3},\d{1,2}\b|\d{3} [a-z])", r"\1"),
    (r"\b([Aa]n?|[Tt]he|[Aa]nother|[Pp]er|[Ee]very) (?:1/2|½)(?= [a-z])", r"\1 half"),
    (r"(?<![\d/])(?:1/2|½)-(?=[a-z])|(?<![\d/])(?:1/2|½) (?=(?:price|size|time|term|full|empty|marathon|off)\b)", "half "),
    (r"(?<![\w.,$€£¥])(\d[\d.,]*)\s?(°\s?[CF]|[a-zA-Zµ]{1,3}|[%€£])\s?[-–]\s?(?=\d[\d.,]*\s?\2(?!\w))", r"\1 \2 to "),
    (r"\b(\d)m(\d\d)\b", r"\1 meter \2"),
    (r"°\s?(\d{1,2})'\s?(?:(\d{1,2}(?:\.\d+)?)(?:″|''|\"))?", lambda m: f"° {m[1]} min" + (f" {m[2]} sec" if m[2] else "")),
    (r"(°|min|sec)\s?([NSEW])\b", lambda m: f"{m[1]} {_POINTS[m[2]]}"),
    (r"(?<=[\d½¼¾⅛⅜⅝⅞])(?<!'\d)(?<!'\d\d)\s?(?:″|'')", " inches"),
    (r"(?<![\w'])(\d{1,3})'(?=\s|[.,;)]|x|$)", r"\1 ft"),
    (r"(?<=inches|....ft)\s?[x×]\s?(?=\d)", " by "),
    (r"(?<=\d)(\s?)in\.(?=[\s,;)]|$)|(?<=\d)in\b|((?:ft|foot|feet)\.?\s?\d{1,2}\s)in\b", r"\1\2inches"),
    (r"(?<=\d)(\s?)m\.p\.h\b\.?", r"\1mph"),
    (r"(?<![\d/])(?<!\d\s)\bkm/h\b", "kilometers per hour"),
    (r"\b(sq|cu)\.\s?(?=ft|in|mi|yd|k?m\b)", r"\1 "),
    (r"(?<=\d)\s?μ(?=[a-z])", "µ"),
    (r"(?<![\d,])(\d+),(\d{1,2})(?=\s?(?:[cmk]?m|k?g|k?W|m?l|L|Liter|litres?|liters?|meters?|metres?|kilos?)\b)", r"\1.\2"),
    (r"(?<=[\w)])\s?\^\s?\(?(-?\d+)\)?", lambda power: power[1].translate(_RAISED)),
    (r"\b([A-G])#(?!\w)", r"\1 sharp "),
    (r"\b(AT|B|P|R|Q|M|A|H|S|J|C)&([A-Z])", lambda m: f"{' '.join(m[1])} and {m[2]}"),
    (r"(?<=\d)\s?[lL]/100\s?km\b", " L per 100 km"),
    (r"\b401\(k\)", "four oh one k"),
    (r"\b([1-9]\d?)([02468]0)p\b", r"\1 \2 p"),
    (r"\b(\d{3,4})\s?[x×]\s?(\d\d)(\d\d)\b", r"\1 by \2 \3"),
    (r"\bb/c\b", "because"),
    (r"(?<=[\w)])\s*≠\s*(?=[\w(-])", " is not equal to "),
    (r"(?<=[\w)])\s+<\s+(?=[\w(-])", " is less than "),
    (r"(?<=[\w)])\s+>\s+(?=[\w(-])", " is greater than "),
    (r"(?<![\w<>=-])>\s?(?=\d)", "more than "),
    (r"(?<![\w<>=-])<\s?(?=\d)", "less than "),
    (r"\b([A-F])-(?=\s|$)", r"\1 minus "),
    (r"(?<=\d) / (?=\d[\d.,]*\s?=)", " divided by "),
    (r"(?<=\d)\s?\*\s?(?=\d)", " times "),
    (r"(?<=\d)\s[-–]\s(?=\d[\d.,]*\s?=)", " minus "),
    (r"√\s?(?=[\w(])", " square root of "),
    ("∞", " infinity "),
    (r"(?<=\d)_(?=\d{3})", ""),
    (r"[Ⅰ-Ⅻ]", lambda number: unicodedata.normalize("NFKC", number[0])),
)


def plainly_written(text: str) -> str:
    """Text in which times, spans, powers, signs and single letters are written so that the rules of numbers read them."""
    text = _GREEK_ALONE.sub(lambda letter: _GREEK[letter[0].lower()], text) if not _GREEK_WORD.search(text) else text
    text = _inches(_EMOTICON.sub(" ", text))
    for pattern, replacement in _FORMS:
        text = re.sub(pattern, replacement, text)
    return text


_GREEK_ALONE = re.compile(r"(?<![\w])(?<!\d\s)[α-ρσ-ωΑ-ΡΣ-Ω](?!\w)")
_GREEK_WORD = re.compile(r"[\u0370-\u03ff]{2}")


def _inches(text: str) -> str:
    """Marks of inches behind numbers, where no quotation is open that they would close."""
    opened = False

    def said(mark: re.Match[str]) -> str:
        nonlocal opened
        if mark[1] and not opened:
            return " inches"
        opened = mark[0] == "“" or (mark[0].strip() == '"' and not opened)
        return mark[0]

    return _LIKE_AN_INCH.sub(said, text)


def _lasting(hours: str, minutes: str, seconds: str | None) -> str:
    return f"{hours} hr {minutes} min" + (f" {seconds} sec" if seconds else "")


def one_alphabet(text: str) -> str:
    """Words that mix Latin letters with Cyrillic or Greek ones of the same looks, all in Latin letters; full-width signs and
    signs that stand for several letters plainly.
    """
    text = "".join(_plain(sign) if "\u2100" <= sign <= "\uff5e" else sign for sign in text)
    return re.sub(r"[^\W\d_]+", _latin, text)


def _latin(word: re.Match[str]) -> str:
    foreign = re.findall(_FOREIGN, word[0])
    if 0 < len(foreign) < len(word[0]) and all(letter in _LOOKALIKES for letter in foreign):
        return "".join(_LOOKALIKES.get(letter, letter) for letter in word[0])
    return word[0]


def _plain(sign: str) -> str:
    """℃ as °C, ％ as %, ㎡ as m² and ① as 1: what is raised stays raised."""
    kind, *letters = unicodedata.decomposition(sign).split() or [""]
    if kind in ("<square>", "<wide>", "<circle>") or letters[:1] == ["00B0"]:
        return "".join(chr(int(letter, 16)) for letter in letters) + " " * (kind == "<circle>")
    return sign
