import numpy as np
import pytest
from talking_points import talk

from facesynth.evaluation.predictions import (
    Beside,
    load_prediction,
    read_beside,
    sample_path,
    sample_paths,
    save_prediction,
    write_beside,
)
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion


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
    with pytest.raises(FacesynthError, match=r"p\.npz is not a prediction") as caught:
        load_prediction(path)
    assert "\n" not in str(caught.value)


def test_what_lies_beside_comes_back_and_the_processor_s_time_may_be_unknown(tmp_path):
    path = tmp_path / "u.npz"
    assert read_beside(path) is None
    for beside in (Beside(0.5, 2.0, (3, 9), {"shares": 0.25}, 0.125), Beside(0.5, 2.0)):
        write_beside(path, beside)
        assert read_beside(path) == beside
    path.with_suffix(".json").write_text('{"synthesis_s": 1, "speech_s": 2}')
    assert read_beside(path) == Beside(1.0, 2.0)
    path.with_suffix(".json").write_text('{"speech_s": 2}')
    with pytest.raises(FacesynthError, match=r"u\.json tells nothing"):
        read_beside(path)


def test_other_motions_of_an_utterance_lie_in_numbered_folders(tmp_path):
    path = tmp_path / "u.npz"
    assert sample_paths(path) == []
    for number in (2, 1):
        save_prediction(sample_path(path, number), "u", talk())
    (tmp_path / "samples" / "3").mkdir()
    assert sample_paths(path) == [tmp_path / "samples" / "1" / "u.npz", tmp_path / "samples" / "2" / "u.npz"]
