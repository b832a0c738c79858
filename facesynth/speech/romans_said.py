"""Roman numerals as people say them: chapters and films by number, rulers by their order, years."""

import re

from facesynth.speech.numbers_said import cardinal, ordinal

_NUMBERED = (
    "chapter|part|war|act|volume|book|scene|section|phase|type|title|level|stage|bowl|apollo|page|class|figure|table|step|episode|"
    "season|grade|group|tier|unit|lesson|exercise|appendix|article|amendment|mark|generation|division|corps|symphony|sonata|"
    "rocky|rambo|godfather|fantasy|quest|auto|craft|souls|evil|kombat|civilization|tekken|diablo|jaws|halo|expo"
)
_RULERS = (
    "Henry|Charles|George|Edward|James|William|Richard|Louis|Philip|Pius|Leo|Benedict|Clement|Gregory|Innocent|Urban|Paul|"
    "Alfonso|Ferdinand|Frederick|Christian|Gustav|Karl|Carl|Haakon|Olav|Harald|Sixtus|Alexander|Ramses|Ptolemy|Mohammed|Mehmed|"
    "Murad|Otto|Ludwig|Wilhelm|Friedrich|Baldwin|Boniface|Nicholas|Constantine|Leopold|Albert|Rama|Robert|John|Stephen|Darius"
)
_ROMAN = r"(?=[IVXL]{2,}\b|[VX]\b)(XL|L?X{0,3})(IX|IV|V?I{0,3})(?<=\w)\b"
_YEAR = r"\b(?=[MDCLXVI]{4,}\b)(M{1,2})(CM|CD|D?C{0,3})(XC|XL|L?X{0,3})(IX|IV|V?I{0,3})\b"
_VALUES = {"I": 1, "İ": 1, "V": 5, "X": 10, "L": 50, "C": 100, "D": 500, "M": 1000}


def romans_written_out(text: str) -> str:
    """`World War II` as two, `Henry VIII` as the eighth; one letter behind a name is a number only where rulers have the name."""
    text = re.sub(_YEAR, lambda m: str(_roman(m[0])), text)
    numbered = rf"\b({_NUMBERED})\s+{_ROMAN}"
    text = re.sub(numbered, lambda m: f"{m[1]} {cardinal(str(_roman(m[2] + m[3])))}", text, flags=re.IGNORECASE)
    text = re.sub(r"\b(War|Chapter|Part|Act|Volume|Book|Type|Phase|Level|Scene) I\b(?! (?:[a-z]{1,6}\b|'))", r"\1 one", text)
    text = re.sub(r"\b(World War) I\b", r"\1 one", text)
    text = re.sub(r"\b((?:King|Queen|Pope|Emperor|Kaiser|Tsar|Saint) [A-Z]\w+) I\b", r"\1 the first", text)
    behind = rf"\b((?:{_RULERS})|[A-Z][a-z]+(?=\s+[IVXL]{{2}}))\s+{_ROMAN}"
    return re.sub(behind, lambda m: f"{m[1]} the {ordinal(str(_roman(m[2] + m[3])))}", text)


def _roman(letters: str) -> int:
    values = [_VALUES[letter] for letter in letters.upper()]
    return sum(-value if value < following else value for value, following in zip(values, [*values[1:], 0], strict=True))
