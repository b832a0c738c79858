"""Letters for pictures: a font that holds them, or other letters that say the same."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont
    from PIL.ImageFont import ImageFont as BitmapFont

SIZE = 13
SYSTEM_FONTS = (
    "DejaVuSans.ttf", "NotoSansCJK-Regular.ttc", "NotoSansSC-Regular.otf", "wqy-zenhei.ttc", "wqy-microhei.ttc", "PingFang.ttc",
    "msyh.ttc", "arialuni.ttf",
)  # fmt: skip
"""Fonts that systems have: Latin and Cyrillic, then Chinese, Japanese and Korean. Pillow knows where they lie."""
NOWHERE = "\U0010ffff"
"""A character that no font has: it shows what stands for those that lack."""


def font_for(text: str) -> FreeTypeFont | BitmapFont:
    """The first font that has all letters of a text, or else the one that has most of them."""
    lacking = [sum(not _has(font, letter) for letter in set(text)) for font in _fonts()]
    return _fonts()[lacking.index(min(lacking))]


def legible(text: str, font: FreeTypeFont | BitmapFont) -> str:
    """The text; letters that the font lacks lose their accents, or are written as their numbers: ü as u, 你好 as [4F60 597D]."""
    written: list[str] = []
    numbers: list[str] = []
    for letter in [*text, ""]:
        known = letter if not letter or _has(font, letter) else "".join(p for p in _parts(letter) if _has(font, p))
        if letter and not known and not unicodedata.combining(letter):
            numbers.append(f"{ord(letter):04X}")
            continue
        written += [f"[{' '.join(numbers)}]"] if numbers else []
        numbers.clear()
        written.append(known)
    return "".join(written)


def _parts(letter: str) -> Iterator[str]:
    """The letters that a letter is put together from, without accents."""
    return (part for part in unicodedata.normalize("NFKD", letter) if not unicodedata.combining(part))


@cache
def _has(font: FreeTypeFont | BitmapFont, letter: str) -> bool:
    if letter.isspace():
        return True
    try:
        return bytes(font.getmask(letter)) != bytes(font.getmask(NOWHERE))
    except UnicodeEncodeError:
        return False


@cache
def _fonts() -> tuple[FreeTypeFont | BitmapFont, ...]:
    """Matplotlib's DejaVu Sans where it is installed, fonts of the system, Pillow's own last."""
    from PIL import ImageFont

    places = [str(path) for path in _of_matplotlib()] + list(SYSTEM_FONTS)
    found = []
    for place in places:
        try:
            found.append(ImageFont.truetype(place, SIZE))
        except OSError:
            continue
    return (*found, ImageFont.load_default(SIZE))


def _of_matplotlib() -> list[Path]:
    spec = find_spec("matplotlib")
    if spec is None or spec.origin is None:
        return []
    path = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
    return [path] if path.is_file() else []
