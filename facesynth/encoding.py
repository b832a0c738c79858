"""Text of files whose encoding nobody states."""

from pathlib import Path

_LOWER = frozenset("àáâãäåæçèéêëìíîïñòóôõöøùúûüýÿßœ")
_UPPER = frozenset("ÀÁÂÃÄÅÆÇÈÉÊËÌÍÎÏÑÒÓÔÕÖØÙÚÛÜŸŒ")


def decoded(content: bytes) -> tuple[str, str]:
    """The text of a file, and its encoding where that had to be guessed: UTF-16 without a mark, MacRoman, Latin-1."""
    for mark, encoding in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if content.startswith(mark):
            return content[len(mark) :].decode(encoding), ""
    sample = content[:4000]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(sample) > 8 and sample[first::2].count(0) > 0.4 * len(sample[first::2]) > 2 * sample[1 - first :: 2].count(0):
            return content[: len(content) // 2 * 2].decode(encoding), "UTF-16 without a mark"
    try:
        return content.decode("utf-8"), ""
    except UnicodeDecodeError:
        latin, mac = content.decode("cp1252", errors="replace"), content.decode("mac_roman")
        return (mac, "MacRoman") if _likely_letters(mac) > _likely_letters(latin) else (latin, "Latin-1")


def text_of(path: Path, most: int | None = None) -> str:
    """The text of a file, or of its first `most` bytes, in any encoding; OSError and UnicodeDecodeError where there is none."""
    with open(path, "rb") as file:
        content = file.read() if most is None else file.read(most)
    if most is not None and len(content) == most and b"\0" in content:
        content = content[: most // 2 * 2]  # of two bytes a letter
    elif most is not None and len(content) == most:
        content = content[: content.rfind(b"\n") + 1] or content  # a letter may be cut at the end
    return decoded(content)[0]


def encoding_remark(path: Path) -> tuple[str, ...]:
    """What is said of a text whose encoding had to be guessed."""
    guessed = decoded(path.read_bytes())[1]
    return (f"{path.name} is not UTF-8; it was read as {guessed}",) if guessed else ()


def _likely_letters(text: str) -> int:
    """How many letters beyond ASCII stand as they do in words: small ones anywhere, capitals not behind a small letter."""
    small = sum(letter in _LOWER for letter in text)
    return small + sum(now in _UPPER and not before.islower() for before, now in zip(" " + text, text, strict=False))
