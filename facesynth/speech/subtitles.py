"""Transcripts that are subtitles (SubRip, WebVTT) or name who speaks: the words alone."""

import re

_TIME = r"(?:\d{1,3}:)?\d{1,2}:\d{2}[.,]\d{1,3}"
_CUE = re.compile(rf"^[^\S\n]*{_TIME}[^\S\n]*-->[^\S\n]*{_TIME}[^\n]*$", re.MULTILINE)
_NUMBERED_CUE = re.compile(rf"(?:^[^\S\n]*[\w.-]+[^\S\n]*\n)?{_CUE.pattern}", re.MULTILINE)
"""With the line before it, which holds its number or its name, if it is one word."""
_BLOCKS = re.compile(r"^(?:WEBVTT|NOTE|STYLE|REGION)\b.*?(?=\n[^\S\n]*\n|\Z)", re.MULTILINE | re.DOTALL)
"""Parts of WebVTT that are no cues: up to an empty line."""
_TAGS = re.compile(r"</?(?:[a-zA-Z][^<>\n]*|\d[\d:.]*)>|\{\\[^{}\n]*\}")
_ROLE = r"speaker|interviewer|interviewee|narrator|host|guest|moderator|announcer|person|voice|participant"
_SPEAKER = re.compile(
    rf"^[^\S\n]*(?:>>+[^\S\n]*)?(?:-[^\S\n]*)?((?:{_ROLE})(?:[ _#-]?(?:\d{{1,3}}|[A-Z]))?)[^\S\n]*:(?!\d)", re.M | re.I
)
_NAME = re.compile(
    r"^[^\S\n]*(?:>>+[^\S\n]*)?(?:-[^\S\n]*)?([A-Z][A-Z.'’-]+(?: [A-Z0-9][A-Z0-9.'’-]*){0,2})[^\S\n]*:(?!\S)", re.MULTILINE
)
"""A name in capitals at the beginning of a line."""
_TURN = re.compile(r"^[^\S\n]*>>+[^\S\n]*", re.MULTILINE)


def without_subtitles(text: str) -> tuple[str, tuple[str, ...]]:
    """A transcript without times, numbers and marks of subtitles and without names of who speaks; and what that was.

    Names in capitals (`JOHN:`) are taken for such where not all of the text is in capitals.
    """
    found: list[str] = []
    text = text.replace("\r\n", "\n").replace("\r", "\n").lstrip("\ufeff")
    cues = len(_CUE.findall(text))
    if cues:
        found.append(f"times of {cues} subtitle{'s' * (cues > 1)}")
        text = _TAGS.sub("", _NUMBERED_CUE.sub("", _BLOCKS.sub("", text)))

    def gone(match: re.Match[str]) -> str:
        found.append(f"{match[1]}:")
        return ""

    text = _SPEAKER.sub(gone, text)
    if text != text.upper() and _NAME.sub("", text) != _NAME.sub("", text).upper():
        text = _NAME.sub(gone, text)
    return _TURN.sub("", text), tuple(dict.fromkeys(found))
