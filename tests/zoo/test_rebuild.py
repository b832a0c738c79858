"""Packaged models are made again by the commands of their cards."""

import subprocess
import sys
from pathlib import Path

import pytest

from facesynth.inference.folder import CARD
from facesynth.zoo.card import read_card
from facesynth.zoo.shelf import PACKAGED

ROOT = Path(__file__).parents[2]
WITHOUT_RECORDINGS = "arkit-shapes"


@pytest.mark.slow
def test_a_model_that_needs_no_recordings_is_made_again_to_the_byte():
    done = subprocess.run(
        [sys.executable, "benchmarks/rebuild.py", WITHOUT_RECORDINGS], cwd=ROOT, check=False, capture_output=True, text=True
    )
    assert f"{WITHOUT_RECORDINGS}: the same" in done.stdout, done.stdout + done.stderr
    assert done.returncode == 0


@pytest.mark.parametrize("name", sorted(path.parent.name for path in PACKAGED.glob(f"*/{CARD}")))
def test_a_rebuild_ends_where_the_model_lies(name):
    assert f"facesynth/zoo/models/{name}" in read_card(PACKAGED / name / CARD).rebuild
