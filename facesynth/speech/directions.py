"""What stands in a transcript and is not said: `[music]`, `(laughs)`, `*sighs*`, `♪`."""

import re

from facesynth.speech.subtitles import without_subtitles

_DIRECTIONS = (
    "laugh|chuckl|giggl|sigh|cough|sneez|sniff|sob|cry|cries|crying|gasp|groan|moan|yawn|breath|inhal|exhal|whisper|shout|"
    "scream|mumbl|mutter|music|applau|clap|cheer|silence|pause|beat|beep|noise|sound|static|inaudible|unintelligible|indistinct|"
    "crosstalk|overlap|singing|hum|whistl|clears|throat|snort|ring|knock|door|footsteps|background|off-?screen|off-?camera|"
    "aside|continues|cont'd|speaking|in english|smil|nod|blank|foreign|audience|phone"
)
_SAYS_HOW = re.compile(rf"\b(?:{_DIRECTIONS})", re.IGNORECASE)
_TIME_STAMP = re.compile(r"\((?:\d{1,2}:[0-5]\d:[0-5]\d|00:[0-5]\d)(?:[.,:]\d{1,3})?\)")
"""Hours, minutes and seconds, or minutes below one; (9:30) is a time of day."""
_LONGEST = 4
"""Words in round brackets are said, if there are more of them."""
_MARKED = re.compile(r"\[[^\[\]]*\]|\{[^{}]*\}|<[^<>\d=]*>|\([^()]*\)|\*[^*\n]+\*|[♪♫♬]+")


def without_directions(text: str) -> tuple[str, tuple[str, ...]]:
    """A transcript with what is not said taken out, and what that was.

    Square, curly and angle brackets hold directions; round ones and asterisks do where a few words say how, such as `(laughs)`;
    round ones hold time stamps as well, such as `(00:01:02)`.
    Times of subtitles and names of who speaks are left out as well.
    """
    text, of_subtitles = without_subtitles(text)
    found = list(of_subtitles)

    def gone(match: re.Match[str]) -> str:
        marked = match[0]
        if (
            not _TIME_STAMP.fullmatch(marked)
            and marked[0] in "(*"
            and not (len(marked.split()) <= _LONGEST and _SAYS_HOW.search(marked))
        ):
            return marked
        found.append(" ".join(marked.split()))
        return " "

    return _MARKED.sub(gone, text), tuple(dict.fromkeys(found))
