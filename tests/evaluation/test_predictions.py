import numpy as np
import pytest
from talking_points import talk

from facesynth.errors import FacesynthError
from facesynth.evaluation.predictions import load_prediction, save_prediction
from facesynth.motion.motion import Motion


def test_what_is_kept_is_what_was_made_and_the_same_bytes_every_time(tmp_path):
    talking = talk()
    motion = Motion(talking.frames, 23.976, talking.layout, np.ones((240, 6)), np.zeros((240, 3)))
    for name in ("a.npz", "ö b.npz"):
        save_prediction(tmp_path / name, "sätze 1", motion)
    utterance, loaded = load_prediction(tmp_path / "ö b.npz")
    assert utterance == "sätze 1"
    assert loaded.fps == 23.976
    assert loaded.layout == motion.layout
    for name in ("frames", "head", "eyes"):
        assert np.array_equal(getattr(loaded, name), getattr(motion, name))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "ö b.npz").read_bytes()


def test_a_head_may_be_absent(tmp_path):
    save_prediction(tmp_path / "a.npz", "u", talk())
    assert load_prediction(tmp_path / "a.npz")[1].head is None


@pytest.mark.parametrize("fault", ["text", "truncated", "absent", "pickle", "incomplete", "shape", "layout"])
def test_other_files_are_refused_in_one_line(tmp_path, fault):
    path = tmp_path / "p.npz"
    save_prediction(path, "u", talk())
    with np.load(path) as file:
        arrays = dict(file)
    if fault == "text":
        path.write_text("no archive")
    elif fault == "truncated":
        path.write_bytes(path.read_bytes()[:2000])
    elif fault == "absent":
        path.unlink()
    elif fault == "pickle":
        np.savez(path, **{**arrays, "utterance": np.array([{}], object)})
    elif fault == "incomplete":
        np.savez(path, frames=arrays["frames"])
    elif fault == "shape":
        np.savez(path, **{**arrays, "frames": arrays["frames"][:, :5]})
    else:
        np.savez(path, **{**arrays, "layout": "[1, 2]"})
    with pytest.raises(FacesynthError, match=r"p\.npz is no prediction") as caught:
        load_prediction(path)
    assert "\n" not in str(caught.value)
