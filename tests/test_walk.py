"""The example runs from clips to video, where clips and models are here."""

import subprocess
import sys

import pytest

from facesynth.capture.models import MODELS, _kept


@pytest.mark.slow
def test_the_walk_from_clips_to_video(recordings, repository, tmp_path):
    if not all(_kept(name).is_file() for name in MODELS):
        pytest.skip("the models are not here; run `facesynth fetch landmarks`")
    pytest.importorskip("anny", reason="the head is not installed")
    command = [sys.executable, str(repository / "examples" / "walk.py"), str(recordings("grid_s26")), str(tmp_path / "w")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    for name in ("said.mp4", "said.csv", "said.glb", "said.TextGrid", "actor.safetensors"):
        assert (tmp_path / "w" / name).stat().st_size > 200
    assert len(list((tmp_path / "w" / "pictures").glob("*.png"))) == 9
    assert "swbm3n.mpg says" in done.stdout
