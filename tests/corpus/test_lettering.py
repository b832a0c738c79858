"""Titles of pictures are legible, whatever they are written in."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.corpus.pictures import draw

pytest.importorskip("PIL", reason="pillow is not installed")


def test_letters_that_a_font_lacks_are_written_with_others():
    from facesynth.corpus import pictures

    plain = pictures._fonts()[-1]
    assert pictures.legible("Ünï köde: ok", plain) in ("Uni kode: ok", "Ünï köde: ok")
    assert pictures.legible("你好 x", plain) == "[4F60 597D] x"
    assert pictures.legible("", plain) == ""


def test_accents_and_cyrillic_are_drawn_as_they_are_where_matplotlib_is_installed():
    pytest.importorskip("matplotlib", reason="DejaVu Sans comes with it")
    from facesynth.corpus.pictures import font_for, legible

    for text in ("Ünï köde", "Žluťoučký kůň", "Привет"):
        assert legible(text, font_for(text)) == text


def test_a_picture_with_another_title_differs_in_its_title_alone(tmp_path):
    from PIL import Image

    corpus = tiny_corpus(tmp_path / "c", 1)
    utterance = corpus[corpus.ids[0]]
    pictures = []
    for text in ("Ünï", "Uni", "你好"):
        draw(replace(utterance, speech=replace(utterance.speech, text=text)), tmp_path / "p.png")
        pictures.append(np.asarray(Image.open(tmp_path / "p.png")))
    for one, other in ((0, 1), (0, 2), (1, 2)):
        rows = np.flatnonzero((pictures[one] != pictures[other]).any(axis=(1, 2)))
        assert len(rows) > 0
        assert rows.max() < 24
