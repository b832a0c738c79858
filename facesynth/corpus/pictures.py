"""A picture of a recording: its waveform, its words and phones, and how far the mouth is open."""

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
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.corpus.checks.sync import mouth_opening
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.utterance import Utterance
from facesynth.inference.phones import SILENCE
from facesynth.progress import track

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


WIDTH_PER_S, MARGIN, WAVE, LABELS, MOUTH = 320, 12, 110, 46, 150
INK, GREY, LIGHT, RED, BLUE = "#202428", "#8a9096", "#e4e7ea", "#c2452d", "#2d6fc2"
LIPS_MEET = frozenset({"p", "b", "m"})


def draw_all(corpus: Corpus, folder: str | Path) -> tuple[Path, ...]:
    """Draw every usable recording of a corpus into a folder as ID.png; returns the files."""
    written = []
    for utterance_id in track(corpus.ids, "drawing"):
        path = Path(folder) / f"{utterance_id}.png"
        draw(corpus[utterance_id], path)
        written.append(path)
    return tuple(written)


def draw(utterance: Utterance, path: str | Path) -> None:
    """Draw one recording as PNG: sound above, phones in the middle (p, b and m red, underlined), opening of the mouth below."""
    from PIL import Image, ImageDraw

    width = round(utterance.speech.duration_s * WIDTH_PER_S) + 2 * MARGIN
    image = Image.new("RGB", (max(width, 320), WAVE + LABELS + MOUTH + 4 * MARGIN + 16), "white")
    title = " ".join(f"{utterance.id}   {utterance.emotion}   {utterance.speech.text}".split("\n"))
    pen, font = ImageDraw.Draw(image), font_for("")
    pen.text((MARGIN, 2), legible(title, font_for(title)), fill=INK, font=font_for(title))
    top = 16 + MARGIN
    bottom = image.height - MARGIN
    ends = [0.0, *utterance.speech.phones.ends_s.tolist()]
    for label, (start_s, end_s) in zip(utterance.speech.phones.labels, pairwise(ends), strict=True):
        left, right = (MARGIN + time_s * WIDTH_PER_S for time_s in (start_s, end_s))
        pen.line([(right, top), (right, bottom)], fill=LIGHT)
        if label != SILENCE:
            colour = RED if label in LIPS_MEET else INK
            if label in LIPS_MEET:
                pen.line([(left, bottom), (right, bottom)], fill=RED, width=3)
            pen.text(((left + right) / 2, top + WAVE + LABELS / 2), label, fill=colour, font=font, anchor="mm")
    for x, (low, high) in enumerate(_envelope(utterance, image.width - 2 * MARGIN)):
        middle = top + WAVE / 2
        pen.line([(MARGIN + x, middle - high * WAVE / 2), (MARGIN + x, middle - low * WAVE / 2)], fill=GREY)
    _draw_mouth(pen, utterance, top + WAVE + LABELS, bottom, font)
    with atomic_path(path) as part, open(part, "wb") as file:
        image.save(file, "PNG")


def _envelope(utterance: Utterance, columns: int) -> NDArray[np.float64]:
    """[columns, 2] lowest and highest sample under each column, the loudest being 1."""
    audio = utterance.speech.audio.astype(np.float64)
    step = utterance.speech.sample_rate / WIDTH_PER_S
    edges = np.minimum((np.arange(columns) * step).astype(int), max(len(audio) - 1, 0))
    low, high = np.minimum.reduceat(audio, edges), np.maximum.reduceat(audio, edges)
    return np.stack([low, high], axis=1) / max(float(np.abs(audio).max()), 1e-9)


def _draw_mouth(pen: object, utterance: Utterance, top: float, bottom: float, font: object) -> None:
    opening = mouth_opening(utterance.motion)
    known = np.isfinite(opening)
    unit = utterance.motion.layout.unit
    if not known.any():
        return
    low, high = float(opening[known].min()), float(opening[known].max())
    x = MARGIN + utterance.motion.times_s * WIDTH_PER_S
    y = bottom - (opening - low) / max(high - low, 1e-9) * (bottom - top - MARGIN)
    for k in range(len(opening) - 1):
        if known[k] and known[k + 1]:
            pen.line([(x[k], y[k]), (x[k + 1], y[k + 1])], fill=BLUE, width=2)  # type: ignore[attr-defined]
    pen.text((MARGIN, top), f"mouth {low:.3g} to {high:.3g} {unit}", fill=BLUE, font=font)  # type: ignore[attr-defined]
