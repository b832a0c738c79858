"""The example runs from clips to video, where clips and models are here."""

import subprocess
import sys

import numpy as np
import pytest

from facesynth.face.draw.video import read_video


@pytest.mark.slow
def test_the_walk_from_clips_to_video(recordings, landmark_models, rig, repository, tmp_path):
    command = [sys.executable, str(repository / "examples" / "walk.py"), str(recordings("grid_s26")), str(tmp_path / "w")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    for name in ("said.mp4", "said.csv", "said.glb", "said.npz", "said.TextGrid", "actor.safetensors"):
        assert (tmp_path / "w" / name).stat().st_size > 200
    assert len(list((tmp_path / "w" / "pictures").glob("*.png"))) == 9
    assert "swbm3n.mpg says" in done.stdout
    said, beside = (read_video(tmp_path / "w" / name) for name in ("said.mp4", "beside.mp4"))
    assert (len(beside.frames), beside.fps) == (len(said.frames), said.fps)
    assert beside.frames.shape[1:3] == (640, 800 + 640)
    right = beside.frames[:, :, 800:].astype(int) - said.frames
    assert np.abs(right).mean() < 6, "the head is on the right, picture by picture"
    assert beside.frames[:, :, :800].std(axis=0).mean() > 1, "the talker on the left moves"
    assert beside.audio is not None
    assert len(beside.audio) / beside.sample_rate > 2.9
    from PIL import Image

    with Image.open(tmp_path / "w" / "plate.png") as plate:
        assert plate.size == (1600, 640)
