"""Numbers as people say them: money, dates, times, measures, fractions, powers, ranges, telephone numbers.

Three libraries were compared: num2words (LGPL, numbers alone), nemo-text-processing (Apache, needs OpenFst, which has no
wheels for most computers) and inflect (MIT, pure Python). inflect writes out plain numbers and ordinals here; what stands
around them is read by the rules below.
"""

import csv
import re
from collections.abc import Callable
from functools import cache
from importlib import resources
from typing import Any

_N = r"\d+(?:,\d{3})+(?:\.\d+)?|\d+(?:\.\d+)?|\.\d+"
_SCALES = {"k": "thousand", "m": "million", "mn": "million", "mio": "million", "b": "billion", "bn": "billion", "tn": "trillion"}
_SCALE = r"\s?(thousand|million|billion|trillion)\b|\s?(k|mn|m|mio|bn|b|tn)\b"
_COUNTRY = {
    **{"us": "u s", "ca": "canadian", "c": "canadian", "a": "australian", "au": "australian"},
    **{"hk": "hong kong", "nz": "new zealand", "s": "singapore", "sg": "singapore", "nt": "taiwan", "mx": "mexican"},
}
_PLURALS = {
    **{"foot": "feet", "inch": "inches"},
    **{"krona": "kronor", "krone": "kroner", "real": "reais", "penny": "pence", "koruna": "korunas"},
    **{
        same: same
        for same in (
            "yuan",
            "baht",
            "rand",
            "ore",
            "fen",
            "xu",
            "satang",
            "yen",
            "sen",
            "won",
            "jeon",
            "lira",
            "hertz",
            "kilohertz",
            "megahertz",
            "gigahertz",
        )
    },
}
_MONTHS = (
    *("january", "february", "march", "april", "may", "june"),
    *("july", "august", "september", "october", "november", "december"),
)
_VERBS = {"march": "(?-i:March|MARCH)", "may": "(?-i:May|MAY)"}
"""Months that are something else in small letters."""
_MONTH = "|".join([*(_VERBS.get(month, month) for month in _MONTHS), r"sept\.?", r"(?-i:Mar|MAR)\.?",
                   *(f"{month[:3]}\\.?" for month in _MONTHS if month not in _VERBS)])  # fmt: skip
_SIGNS = {"½": "1/2", "⅓": "1/3", "⅔": "2/3", "¼": "1/4", "¾": "3/4", "⅕": "1/5", "⅖": "2/5", "⅗": "3/5", "⅘": "4/5", "⅙": "1/6",
          "⅚": "5/6", "⅐": "1/7", "⅛": "1/8", "⅜": "3/8", "⅝": "5/8", "⅞": "7/8", "⅑": "1/9", "⅒": "1/10"}  # fmt: skip
_LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_MEASURES = (
    "cup|teaspoon|tablespoon|pint|quart|gallon|liter|litre|inch|foot|yard|mile|meter|metre|kilometer|kilometre|pound|ounce|gram|"
    "kilo|kilogram|dozen|second|minute|hour|day|week|month|year|century|bottle|glass|teaspoonful|spoon|acre|stick|page"
)
"""What halves and quarters are taken of."""


def _read_table(name: str) -> dict[str, tuple[str, ...]]:
    """The rest of each row of a table beside this module, by its first cell."""
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return {first: tuple(rest) for first, *rest in list(csv.reader(text.splitlines()))[1:]}


_MONEY = _read_table("currencies.csv")
"""Unit and its hundredth, by sign and by code."""
_UNITS = {sign.casefold(): unit for sign, (unit,) in _read_table("units.csv").items()}
_RATES = {"yr": "year", "mo": "month", "wk": "week", "hr": "hour", "sq": "square"}
"""Short forms that stand behind a stroke alone, beside those of `_UNITS`."""
_WHOLE = [*_UNITS.values(), *(unit for unit, _ in _MONEY.values())]
_SINGULAR = {_PLURALS.get(unit, f"{unit}s"): unit for unit in _WHOLE if " " not in unit}
"""Units by their plural."""

Rule = tuple[str, Callable[[re.Match[str]], str]]


def numbers_written_out(text: str) -> str:
    """Text with everything that has digits in words; letters that follow digits part from them."""
    text = _signs_plain(_grouped_as_in_english(re.sub(r"\bR\$", "BRL", text)))
    for pattern, said in _rules():
        text = re.sub(pattern, lambda match, said=said: f" {said(match)} ", text, flags=re.IGNORECASE)  # type: ignore[misc]
        text = re.sub(" {2,}", " ", text)
    text = re.sub(r"(?<=[a-z]) +(?='s\b)", "", text)
    return re.sub(_attributes(), lambda match: f"{match[1]}{_SINGULAR[match[2].casefold()]} ", text)


def _signs_plain(text: str) -> str:
    """Fractions as two numbers and a stroke, and numbers below the line beside what they count."""
    for sign, digits in _SIGNS.items():
        text = re.sub(rf"(?<=\d)\s?{sign}", f" {digits}", text).replace(sign, digits)
    text = re.sub(r"\bCO(?=2\b)", "C O ", text.replace("⁄", "/"))
    text = re.sub(r"(\d/\d+)(?=[^\W\d_])", r"\1 ", text)
    element = r"(?:[A-Z][a-z]?[₀-₉]*)"
    text = re.sub(
        rf"(?<!\w)(?=\w*[₀-₉]){element}+(?!\w)", lambda formula: " ".join(re.findall(r"[A-Za-z]|[₀-₉]+", formula[0])), text
    )
    return re.sub(r"[₀-₉]+", lambda number: f" {number[0].translate(_LOWERED)} ", text)


def _grouped_as_in_english(text: str) -> str:
    """Numbers with points or apostrophes between thousands and a comma before decimals, as in much of Europe."""
    symbols = "".join(re.escape(sign) for sign in _MONEY if not sign.isalpha())
    text = re.sub(r"(?<![\w'.,])\d{1,3}(?:'\d{3})+(?![\d'])", lambda number: number[0].replace("'", ""), text)
    text = re.sub(
        r"(?<![\d.,])(\d{1,3}(?:\.\d{3})+),(\d{1,2})(?!\d)", lambda number: f"{number[1].replace('.', '')}.{number[2]}", text
    )
    text = re.sub(r"(?<=€)(\s?\d{1,3})\.(\d{3})(?![\d.,/])|(?<![\d.,])(\d{1,3})\.(\d{3})(?=\s?€)", r"\1\2\3\4", text)
    text = re.sub(rf"([{symbols}]\s?\d+),(\d{{1,2}})(?![\d,])", r"\1.\2", text)
    text = re.sub(r"(?<=\d),(?=\d{1,2}\s?[€%])", ".", text)
    return re.sub(r"\b\d{1,3}(?:\.\d{3}){2,}\b", lambda number: number[0].replace(".", ""), text)


@cache
def _attributes() -> str:
    """Measures before what they measure, such as `a five dollars bill`, where one says dollar."""
    numbers = "|".join({word for count in (*range(100), 1000, 10**6, 10**9) for word in re.split(r"\W", cardinal(str(count)))})
    return rf"(?i)(\ban?\s+(?:(?:{numbers}|hundred|point)[\s-]+)+)({'|'.join(_SINGULAR)})\s+(?!to\b)(?=[a-z])"


def _moments(year: str) -> tuple[Rule, ...]:
    """Dates and times of day; `year` matches one."""
    return (
        (r"\b(\d{4})-(\d\d)-(\d\d)\b", lambda m: _date(m[3], m[2], m[1])),
        (r"\b(\d{4})/(\d{1,2})/(\d{1,2})\b", lambda m: _date(m[3], m[2], m[1])),
        (r"\b(\d{1,2})-(\d{1,2})-(\d{4})\b", lambda m: _slashed(m[1], m[2], m[3])),
        (r"(?<![\d/])(0?[1-9]|1[0-2])/((?:19|20)\d\d)\b(?!/)", lambda m: f"{_MONTHS[int(m[1]) - 1]} {_year(m[2])}"),
        (r"\b(\d{1,2})/(\d{1,2})/(\d{4}|\d\d)\b", lambda m: _slashed(m[1], m[2], m[3])),
        (r"\b(\d{1,2})\.(\d{1,2})\.(\d{4})\b", lambda m: _date(m[1], m[2], m[3])),
        (
            rf"\b({_MONTH})\s+(\d{{1,2}})\s?[-–]\s?(\d{{1,2}})\b(?![:.]\d|\s?[ap]\.?m)",
            lambda m: f"{_named(m[1], m[2], None)} to {ordinal(m[3])}",
        ),
        (rf"\b({_MONTH})\s+(\d{{1,2}})(?:st|nd|rd|th)?(?:,?\s+{year})?\b(?![:.]\d)", lambda m: _named(m[1], m[2], m[3])),
        (rf"\b(?:the\s+)?(\d{{1,2}})\s?[-–]\s?(?=\d{{1,2}}\s+(?:of\s+)?(?:{_MONTH})\b)", lambda m: f"the {ordinal(m[1])} to"),
        (
            rf"\b(?:the\s+)?(\d{{1,2}})(?:st|nd|rd|th)?\s+(?:of\s+)?({_MONTH})(?:,?\s+{year})?(?![\w:])",
            lambda m: _named(m[2], m[1], m[3], day_first=True),
        ),
        (r"\b(\d{1,2}):(\d\d)(?::(\d\d))?(?:\s?([ap])\.?m\b\.?)?", lambda m: _time(m[1], m[2], m[3], m[4])),
        (r"\b(\d{1,2})\s?([ap])\.?m\b\.?", lambda m: f"{cardinal(m[1])} {m[2].lower()} m"),
    )  # fmt: skip


@cache
def _rules() -> tuple[Rule, ...]:
    """In order: what is more special comes first, plain numbers last."""
    symbols = "".join(re.escape(sign) for sign in _MONEY if not sign.isalpha())
    codes = "|".join(code for code in _MONEY if code.isalpha())
    units = "|".join(re.escape(unit) for unit in sorted(_UNITS, key=len, reverse=True))
    spatial = "|".join(unit for unit in _UNITS if unit[-1] in "²³")
    scale = _SCALE.replace("(", "(?:")
    money = rf"[{symbols}]\s?(?:{_N})(?:{scale})?|(?:{_N})(?:{scale})?\s?(?:[{symbols}]|(?:{codes})\b)"
    year = r"(1\d{3}|2\d{3})"
    return (
        *_moments(year),
        (r"\b(\d+):(\d+)\b", lambda m: f"{cardinal(m[1])} to {cardinal(m[2])}"),
        (
            rf"((?:{money})|(?:{_N})\s?(?:{units}))\s?/\s?({units}|[a-z]+)\b",
            lambda m: _rate(m[1], m[2]) if _is_rate(m[0]) else m[0],
        ),
        (rf"((?:{_N})(?:{_SCALE})?)\s?[-–]\s?(?=[{symbols}]\.?\d)", lambda m: f"{m[1]} to"),
        (
            rf"([{symbols}])\s?({_N})(?:{_SCALE})?\s?[-–]\s?({_N})(?:{_SCALE})?",
            lambda m: f"{_scaled(m[2], m[3] or m[4])} to {_money(m[1], m[5], m[6] or m[7], None)}",
        ),
        (rf"([{symbols}])\s?(\d+)\s(\d+)/(\d+)(?:{_SCALE})?", lambda m: _part_money(m[1], m[2], m[3], m[4], m[5] or m[6])),
        (rf"(?<![\w)])-(?=[{symbols}]?\.?\d)", lambda m: "minus"),
        (rf"(?:\b([a-z]{{1,2}}))?([{symbols}])\s?({_N})(?:{_SCALE})?", lambda m: _money(m[2], m[3], m[4] or m[5], m[1])),
        (rf"({_N})(?:{_SCALE})?\s?([{symbols}]|(?:{codes})\b)", lambda m: _money(m[4].casefold(), m[1], m[2] or m[3], None)),
        (rf"\b({codes})\.?\s?({_N})(?:{_SCALE})?", lambda m: _money(m[1].casefold(), m[2], m[3] or m[4], None)),
        (r"\b([1-9])\s?'\s?(\d{1,2})(?:\"|''|”)?(?!\w)", lambda m: f"{cardinal(m[1])} foot {cardinal(m[2])}"),
        (r"(?<!\w)'(\d)0s\b", lambda m: _decade(f"{m[1]}0")),
        (r"(?<=\bin )(10[1-9]\d)\b", lambda m: _year(m[1])),
        (r"\b(1[1-9]\d0|20\d0|[2-9]0)'?s\b", lambda m: _decade(m[1])),
        (rf"({_N})\s?({spatial})", lambda m: _counted(m[1], _UNITS[m[2].casefold()])),
        (r"(\d+|[a-z])(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda m: f"{m[1]} {_power(m[2].translate(_RAISED))}"),
        (rf"({_N})\s?[-–]\s?(?=\d+\s+\d+/\d|(?:{_N})\s?[%‰°])", lambda m: f"{m[1]} to"),
        (rf"\b(\d+)\s+(\d+)/(\d+)\b(?:\s?({units})(?![\w']))?", lambda m: _mixed(m[1], m[2], m[3], _unit(m[4]))),
        (rf"\b(\d+)/(\d+)\s?(%|(?:{units})(?![\w']))", lambda m: _part_of(m[1], m[2], _unit(m[3]) or m[3])),
        (rf"(?<!\ba )(?<!\b\d )\b(\d+)/(\d+)\s({_MEASURES})\b", lambda m: _part_of(m[1], m[2], m[3])),
        (rf"({_N})\s?°\s?([cf])?\b", lambda m: _degrees(m[1], m[2])),
        (rf"({_N})\s?°", lambda m: _counted(m[1], "degree")),
        (rf"({_N})\s?%", lambda m: f"{cardinal(m[1])} percent"),
        (rf"({_N})\s?‰", lambda m: f"{cardinal(m[1])} per mille"),
        (r"\+?\d{0,2}[ -]?\(?\b(\d{3})\)?[ -](\d{3})-(\d{4})\b", lambda m: " ".join(map(_digits, m.groups()))),
        (r"\b(\d{3})-(\d{4})\b", lambda m: f"{_digits(m[1])} {_digits(m[2])}"),
        (rf"\b{year}\s?[-–]\s?{year}\b", lambda m: f"{_year(m[1])} to {_year(m[2])}"),
        (rf"({_N})\s?[-–]\s?({_N})(?![\w-])", lambda m: f"{m[1]} to {m[2]}"),
        (r"\b24/7\b", lambda m: "twenty four seven"),
        (r"\b(\d+)/(\d+)\b", lambda m: _fraction(m[1], m[2])),
        (r"\b(\d[\d,]*)(?:st|nd|rd|th)\b", lambda m: ordinal(m[1])),
        (r"(?<=[a-z])(\d+)s\b", lambda m: _decade(m[1]) if m[1][0] != "0" else m[0]),
        (rf"({_N})\s?({units})(?![\w'])", lambda m: _counted(m[1], _UNITS[m[2].casefold()]) if _is_unit(m) else m[0]),
        (r"\b(\d+)\.(\d+)\.(\d+)\b", lambda m: " point ".join(cardinal(part) for part in m.groups())),
        (rf"({_N})(?:x|×|\sx\s)(?=\d)", lambda m: f"{m[1]} by"),
        (rf"({_N})(?:x|×)(?!\w)", lambda m: f"{cardinal(m[1])} times"),
        (r"\b(1[1-9]\d\d|20[1-9]\d)\b(?!,\d)(?!\.\d)", lambda m: _year(m[1])),
        (_N, lambda m: cardinal(m[0])),
    )  # fmt: skip


def cardinal(digits: str) -> str:
    """A number in words; leading zeros are said one by one."""
    digits = digits.replace(",", "")
    if digits.startswith("."):
        return "point " + _digits(digits[1:])
    if len(digits) > 1 and digits.startswith("0") and "." not in digits:
        return _digits(digits)
    return str(_inflect().number_to_words(digits, andword="", comma=""))


def ordinal(digits: str) -> str:
    """The ordinal of a whole number in words."""
    return str(_inflect().number_to_words(_inflect().ordinal(digits.replace(",", "")), andword="", comma=""))


def _digits(digits: str) -> str:
    return " ".join(str(_inflect().number_to_words(digit)) for digit in digits)


def _plural(unit: str, count: str) -> str:
    if float(count.replace(",", "")) == 1:
        return unit
    first, _, rest = unit.partition(" ")
    if first in ("square", "cubic"):
        return f"{first} {_plural(rest, count)}"
    if rest == "hour":
        return f"{unit}s"
    return f"{_PLURALS.get(first, first + 's')} {rest}".strip()


def _counted(count: str, unit: str) -> str:
    return f"{cardinal(count)} {_plural(unit, count)}"


def _is_unit(match: re.Match[str]) -> bool:
    """`5 s` and `3 h` are measures; capitals such as `4K`, `5G`, `3D` are names."""
    unit = match[2]
    return not (len(unit) == 1 and unit.isupper() and unit not in ("V", "W", "L", "Ω", "\u2126"))


def _money(sign: str, amount: str, scale: str | None, country: str | None) -> str:
    unit, small = _MONEY[sign]
    where = f"{_COUNTRY[country.lower()]} " if country and country.lower() in _COUNTRY else f"{country} " if country else ""
    whole, _, part = amount.replace(",", "").partition(".")
    if scale:
        return f"{cardinal(amount)} {_SCALES.get(scale.lower(), scale.lower())} {where}{_plural(unit, '2')}"
    cents = int(part[:2].ljust(2, "0")) if part else 0
    if cents and int(whole or 0) == 0:
        return _counted(str(cents), small)
    said = f"{cardinal(whole or '0')} {where}{_plural(unit, whole or '0')}"
    return f"{said} and {_counted(str(cents), small)}" if cents else said


def _scaled(amount: str, scale: str | None) -> str:
    return f"{cardinal(amount)} {_SCALES.get(scale.lower(), scale.lower())}" if scale else cardinal(amount)


def _part_money(sign: str, whole: str, top: str, bottom: str, scale: str | None) -> str:
    """`$2 1/2m`: two and a half million dollars."""
    many = f" {_SCALES.get(scale.lower(), scale.lower())}" if scale else ""
    return f"{_mixed(whole, top, bottom, None)}{many} {_plural(_MONEY[sign][0], '2')}"


def _is_rate(text: str) -> bool:
    """Whether a stroke behind an amount says per; km/h is a unit by itself, and `5 g/what` may be a choice."""
    first, _, behind = text.partition("/")
    known = behind.strip().lower() in {*_UNITS, *_RATES, *_UNITS.values(), *_RATES.values(), "day", "night"}
    paid = any(sign in first.lower() for sign in _MONEY)
    return paid or (known and f"{first.lstrip('0123456789., ')}/{behind}".lower() not in _UNITS)


def _rate(amount: str, unit: str) -> str:
    return f"{amount} per {_UNITS.get(unit.casefold()) or _RATES.get(unit.lower(), unit)}"


def _unit(short: str | None) -> str | None:
    return "percent" if short == "%" else _UNITS[short.casefold()] if short else None


def _mixed(whole: str, top: str, bottom: str, unit: str | None) -> str:
    said = f"{cardinal(whole)} and {_fraction(top, bottom, inside=True)}"
    return f"{said} {_plural(unit, '2')}" if unit else said


def _part_of(top: str, bottom: str, unit: str) -> str:
    """Half a kilogram, three quarters of an ounce."""
    if not 0 < int(top) < int(bottom):
        return f"{_fraction(top, bottom)} {_plural(unit, '2')}"
    one = f"{'an' if unit[0] in 'aeiou' or unit == 'hour' else 'a'} {unit}"
    return f"half {one}" if (top, bottom) == ("1", "2") else f"{_fraction(top, bottom, inside=True)} of {one}"


def _slashed(first: str, second: str, year: str) -> str:
    """12/05/2024 is December 5th, as it is read in America; 25/12/2024 can only be a day before its month."""
    day, month = (first, second) if int(first) > 12 else (second, first)
    return _date(day, month, year)


def _date(day: str, month: str, year: str) -> str:
    if not (1 <= int(month) <= 12 and 1 <= int(day) <= 31):
        return " ".join(cardinal(part) for part in (day, month, year))
    return f"{_MONTHS[int(month) - 1]} {ordinal(str(int(day)))} {_year(year) if len(year) == 4 else _short_year(year)}"


def _named(month: str, day: str, year: str | None, *, day_first: bool = False) -> str:
    name = next(full for full in _MONTHS if full.startswith(month.lower().rstrip(".")[:3]))
    said = f"the {ordinal(str(int(day)))} of {name}" if day_first else f"{name} {ordinal(str(int(day)))}"
    return f"{said} {_year(year)}" if year else said


def _short_year(digits: str) -> str:
    return f"oh {cardinal(digits[1])}" if digits[0] == "0" else cardinal(digits)


def _time(hour: str, minutes: str, seconds: str | None, half: str | None) -> str:
    after = f" {half.lower()} m" if half else ""
    if int(hour) > 24 or int(minutes) > 59:
        return f"{cardinal(hour)} to {cardinal(minutes)}"
    said = "twelve" if int(hour) == 0 and not seconds else cardinal(str(int(hour)))
    if seconds:
        return f"{said} {_minutes(minutes)} and {_counted(str(int(seconds)), 'second')}{after}"
    if minutes == "00":
        return said + (after or (" hundred" if int(hour) > 12 else " o'clock"))
    return f"{said} {_minutes(minutes)}{after}"


def _minutes(digits: str) -> str:
    return f"oh {cardinal(digits[1])}" if digits[0] == "0" else cardinal(digits)


def _year(digits: str) -> str:
    if 2000 <= int(digits) <= 2009 or digits[1:] == "000":
        return cardinal(digits)
    century, rest = cardinal(digits[:2]), digits[2:]
    return f"{century} hundred" if rest == "00" else f"{century} {_minutes(rest)}"


def _decade(digits: str) -> str:
    said = _year(digits) if len(digits) == 4 else cardinal(digits)
    return re.sub("y$", "ies", said) if said.endswith("y") else f"{said}es" if said.endswith("x") else f"{said}s"


def _power(exponent: str) -> str:
    if exponent in ("2", "3"):
        return "squared" if exponent == "2" else "cubed"
    said = ordinal(exponent.lstrip("-"))
    return f"to the {'minus ' if exponent.startswith('-') else ''}{said}"


def _degrees(count: str, scale: str | None) -> str:
    said = _counted(count, "degree")
    return f"{said} {'celsius' if scale.lower() == 'c' else 'fahrenheit'}" if scale else said


def _fraction(top: str, bottom: str, *, inside: bool = False) -> str:
    """A fraction where it can be one; else the two numbers, one over the other."""
    over, under = int(top), int(bottom)
    if over == under:
        return f"{cardinal(top)} {cardinal(bottom)}"
    if top.startswith("0") or bottom.startswith("0"):
        return f"{cardinal(top)} {cardinal(bottom)}"
    if not 0 < over < under <= 100:
        return f"{cardinal(top)} over {cardinal(bottom)}"
    part = {2: "half", 4: "quarter"}.get(under) or ordinal(bottom)
    if over == 1:
        return f"{'a' if inside else 'one'} {part}"
    return f"{cardinal(top)} {'halves' if under == 2 else part + 's'}"


@cache
def _inflect() -> Any:
    import inflect

    return inflect.engine()
