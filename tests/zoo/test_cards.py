"""Figures of cards: each is measured again by its command, and none is typed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from facesynth.inference.folder import CARD
from facesynth.zoo.card import Card, Figure, read_card, write_card
from facesynth.zoo.shelf import PACKAGED

ROOT = Path(__file__).parents[2]
MEASURE = """
import sys
from pathlib import Path
import facesynth.zoo.shelf as shelf
shelf.PACKAGED = Path(sys.argv.pop(1))
sys.path.insert(0, "benchmarks")
import cards
sys.exit(cards.main())
"""


@pytest.mark.parametrize("name", sorted(path.parent.name for path in PACKAGED.glob(f"*/{CARD}")))
def test_a_figure_of_a_packaged_model_says_how_it_is_found_in_what_its_command_prints(name):
    for figure in read_card(PACKAGED / name / CARD).figures:
        assert re.compile(figure.found_by).groups == 1, figure
        program = figure.command.split()[1]
        assert figure.command.startswith("facesynth ") or (ROOT / program).is_file(), figure


@pytest.fixture
def shelf(tmp_path):
    (tmp_path / "shelf" / "one").mkdir(parents=True)
    (tmp_path / "script.py").write_text("import sys; print('size:', 2 + len(sys.argv))")
    figures = (
        Figure("size", 1.0, f"python {tmp_path / 'script.py'} GIVEN", r"size: ([\d.]+)"),
        Figure("of others", 7.0, f"python {tmp_path / 'script.py'} NOT_HERE", r"size: ([\d.]+)"),
    )
    card = Card("one", "nobody", ("en",), "CC0", "nobody was recorded", figures=figures)
    write_card(tmp_path / "shelf" / "one" / CARD, card)
    return tmp_path / "shelf"


def measured(shelf, *arguments):
    command = [sys.executable, "-c", MEASURE, shelf, *arguments]
    return subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)


def test_figures_are_measured_again_and_written_where_that_is_asked_for(shelf):
    stated = read_card(shelf / "one" / CARD)
    differs = measured(shelf, "GIVEN=here")
    assert differs.returncode == 1
    assert "size: 4 (stated 1)" in differs.stdout
    assert "of others: not measured" in differs.stdout
    assert read_card(shelf / "one" / CARD) == stated
    assert measured(shelf, "GIVEN=here", "--write").returncode == 0
    assert [figure.value for figure in read_card(shelf / "one" / CARD).figures] == [4.0, 7.0]
    assert measured(shelf, "GIVEN=here").returncode == 0
