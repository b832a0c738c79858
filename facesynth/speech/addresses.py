"""Addresses as people say them: pages, mail, files, hashtags, numbers of telephones and of computers."""

import re

from facesynth.speech.pronunciation import is_known

_ENDINGS = (
    "com|org|net|edu|gov|io|co|uk|de|fr|eu|ai|tv|info|dev|app|us|me|ch|at|ca|au|jp|"
    "js|ts|py|txt|pdf|docx?|xlsx?|csv|json|ya?ml|html?|exe|zip|png|jpe?g|gif|mp[34]|wav|md|sh|cpp"
)
_SIGNS = {".": "dot", "-": "dash", "_": "underscore", "/": "slash", "+": "plus", "?": "question mark", "=": "equals", "&": "and"}
_SIGNS |= {"#": "hash", "~": "tilde", ":": "colon", "%": "percent"}
_MAIL = re.compile(r"(?<![\w.+-])\w[\w.+-]{0,63}@[\w-]+(?:\.[\w-]+)*\.\w+")
_PAGE = re.compile(
    r"(?:\b(?:https?|ftp)://)([\w-]+(?:\.[\w-]+)*(?::\d+)?(?:/[\w./?=&#~%+-]*[\w/])?)"
    r"|\b(www(?:\.[\w-]+)+(?:/[\w./?=&#~%+-]*[\w/])?)"
    r"|(?<![\w.-])([\w-]{1,63}(?:\.[\w-]{1,63}){0,8}\.(?:com|org|net|edu|gov|io|co\.uk|info)/[\w./?=&#~%+-]*\w)"
)
_COMPUTER = re.compile(r"(?<![\d.])(\d{1,3})\.(\d{1,3})\.(\d{1,3})\.(\d{1,3})(?!\.?\d)")


def addresses_written_out(text: str) -> str:
    """Text with the dots, strokes and signs of addresses in words; `https://`, which nobody says, is left out."""
    text = _MAIL.sub(lambda mail: _in_words(mail[0].replace("@", " at ")), text)
    text = _PAGE.sub(lambda page: _in_words(page[1] or page[2] or page[3]), text)
    text = re.sub(r"(?<!\w)#(?=\w*[A-Za-z]{2})(\w+)", lambda tag: f"hashtag {_parted(tag[1])}", text)
    text = re.sub(r"(?<!\w)@(?=\w*[A-Za-z])(\w+)", lambda name: f"at {_in_words(name[1])}", text)
    text = re.sub(r"(?<=\w)@(?=\w)", " at ", text)
    text = _COMPUTER.sub(lambda number: " dot ".join(" ".join(part) for part in number.groups()), text)
    text = re.sub(r"(?<![\w.])\.(?=[A-Z]{2,})", " dot ", text)
    return re.sub(rf"(?<=\w)\.({_ENDINGS})\b(?!\.?\w)", lambda end: f" dot {_letters(end[1])} ", text)


def _in_words(address: str) -> str:
    said = re.sub(r"[./_+?=&#~:%-]", lambda sign: f" {_SIGNS[sign[0]]} ", address)
    return f" {' '.join(_letters(part) for part in said.split())} "


def _letters(part: str) -> str:
    """A short part that is no word, letter by letter."""
    return " ".join(part) if part.isalpha() and len(part) <= 4 and not is_known(part.lower()) else part


def _parted(tag: str) -> str:
    """`MeToo2024` as me too 2024."""
    return " ".join(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", tag)) or tag


def telephones_written_out(text: str) -> str:
    """Text with the numbers of telephones and cards digit by digit, so far as their writing tells them from counts."""
    text = re.sub(r"(?<![\w+])\+(\d{1,3}[ ().-]*\d[\d ().-]{5,}\d)(?![\w-])", lambda number: f"plus {_spaced(number[1])}", text)
    text = re.sub(
        r"(?<![\w-])(1[-. ])?\(?8(00|88|77|66|55)\)?[-. ](\d{3})[-. ](\d{4})(?![\w-])",
        lambda n: f"{'1 ' if n[1] else ''}{'8 hundred' if n[2] == '00' else '8 ' + ' '.join(n[2])} {_spaced(n[3] + n[4])}",
        text,
    )
    us = r"(?<![\w-])(1[-. ])?(?:\(\d{3}\)[ -]?|\d{3}[-. ])\d{3}[-.]\d{4}(?![\w-])"
    text = re.sub(us, lambda number: _spaced(number[0]), text)
    text = re.sub(
        r"(?<![\w,./:-])0\d{2,5}[ /-]+(?:\d{5,}|\d{3,4}(?:[ -]\d{2,})+)(?![\w,-])", lambda number: _spaced(number[0]), text
    )
    return re.sub(r"(?<![\w-])(?:\d{4}[ -]){3}\d{4}(?![\w-])|(?<![\w-])\d{3}-\d\d-\d{4}(?![\w-])", lambda m: _spaced(m[0]), text)


def _spaced(number: str) -> str:
    return " ".join(re.findall(r"\d", number))
