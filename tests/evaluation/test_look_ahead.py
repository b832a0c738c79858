"""What waiting is worth to a network: known differences, the script that prints them, and the card that states them."""

import re
import runpy
import sys
from importlib import import_module

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.inference.folder import CARD
from facesynth.methods.learn import windows
from facesynth.zoo.card import read_card
from facesynth.zoo.shelf import DEFAULT, PACKAGED


@pytest.fixture
def benchmark(monkeypatch, repository):
    """A function that imports a module of benchmarks/."""
    monkeypatch.syspath_prepend(repository / "benchmarks")
    return import_module


def test_each_look_ahead_stands_beside_the_next_clip_by_clip(benchmark):
    look_ahead = benchmark("look_ahead")
    errors = np.random.default_rng(0).uniform(1.5, 2, 40)
    rows = {0: errors + 0.1, 40: errors, 80: errors[::-1]}
    lines = look_ahead.table({ms: look_ahead.Row(0.1 + ms / 1000, each, 0.6, 0.9) for ms, each in rows.items()})
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert {len(row) for row in cells} == {len(look_ahead.COLUMNS)}
    assert [row[:2] for row in cells[2:]] == [["0", "0.10"], ["40", "0.14"], ["80", "0.18"]]
    assert cells[2][5:7] == ["0.100", "40 of 40"]
    assert float(cells[2][7]) < 1e-6
    assert float(cells[3][7]) > 0.1
    assert cells[4][5:] == ["", "", ""]


def test_networks_that_wait_longer_are_streams_that_are_later(benchmark, monkeypatch, repository, tmp_path, capsys):
    monkeypatch.setattr(windows, "BATCH", 2)
    monkeypatch.setattr(benchmark("network_variants"), "LOOK_AHEAD_MS", (0, 80))
    corpus = tiny_corpus(tmp_path / "corpus", utterances=15, fps=25)
    monkeypatch.setattr(sys, "argv", ["look_ahead.py", str(corpus.path), "-o", str(tmp_path / "kept"), "--steps", "1"])
    runpy.run_path(str(repository / "benchmarks" / "look_ahead.py"), run_name="__main__")
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")][2:]
    cells = [[cell.strip() for cell in line.split("|")[1:]] for line in lines]
    assert [int(row[0]) for row in cells] == [0, 80, 720]
    assert np.ptp([float(row[1]) - int(row[0]) / 1000 for row in cells]) <= 0.01 + 1e-9


def test_the_card_of_a_network_says_how_its_error_depends_on_what_it_may_hear_ahead(benchmark):
    look_ahead = benchmark("look_ahead")
    found = [figure for figure in read_card(PACKAGED / DEFAULT / CARD).figures if "look_ahead.py" in figure.command]
    asked = [*look_ahead.LOOK_AHEAD_MS, 720]
    rows = {ms: look_ahead.Row(1.0, np.full(3, figure.value), 0.6, 0.9) for ms, figure in zip(asked, found, strict=True)}
    printed = "\n".join(["", *look_ahead.table(rows)])
    assert [float(re.search(figure.found_by, printed).group(1)) for figure in found] == [figure.value for figure in found]
    assert found[0].value > found[-1].value > 0
    assert all(f"{ms} ms" in figure.what for ms, figure in zip(asked, found, strict=True))
