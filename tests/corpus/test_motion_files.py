from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances

from facesynth.corpus.motion_files import channel_names, load_motion
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.pose import apply_head, rigid_points

LAYOUT = tiny_layout()
NEUTRAL = np.reshape(LAYOUT.neutral, (-1, 3))


@pytest.fixture
def motion():
    return tiny_utterances(1)[0][2]


def write_csv(path, columns, table):
    lines = [",".join(columns), *(",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in table)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_head_motion_is_taken_out_where_the_file_does_not_hold_it(tmp_path, motion):
    world = apply_head(motion.points, motion.head, NEUTRAL, rigid_points(LAYOUT))
    np.savez(tmp_path / "a.npz", frames=world)
    loaded, remarks = load_motion(tmp_path / "a.npz", LAYOUT, 120)
    assert remarks == ()
    assert np.abs(loaded.frames - motion.frames).max() < 0.3, "up to the noise on the rigid points"
    assert np.abs(loaded.head - motion.head).max() < 0.3


def test_head_motion_that_is_separate_stays(tmp_path, motion):
    np.savez(tmp_path / "a.npz", frames=motion.frames, head=motion.head, eyes=motion.eyes, fps=120.0)
    loaded, _ = load_motion(tmp_path / "a.npz", LAYOUT, 120)
    for name in ("frames", "head", "eyes"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(motion, name))


@pytest.mark.parametrize("layout", [replace(LAYOUT, neutral=None), replace(LAYOUT, groups={})])
def test_head_motion_stays_in_with_a_remark_where_nothing_tells_it(tmp_path, motion, layout):
    np.savez(tmp_path / "a.npz", frames=motion.points)
    loaded, remarks = load_motion(tmp_path / "a.npz", layout, 120)
    np.testing.assert_array_equal(loaded.frames, motion.frames)
    assert "head motion was left in" in remarks[0]


def test_other_rates_are_resampled(tmp_path, motion):
    np.savez(tmp_path / "a.npz", frames=motion.frames, head=motion.head, fps=np.array(60))
    loaded, remarks = load_motion(tmp_path / "a.npz", LAYOUT, 120)
    assert len(loaded) == 2 * len(motion)
    assert loaded.fps == 120
    assert remarks == ("resampled from 60 to 120 fps",)


def test_csv_in_any_order_with_times_and_empty_cells(tmp_path):
    layout = Layout("landmarks", ("a", "b"))
    columns = ["time_s", "b.y", "a.x", "extra", "a.y", "b.x"]
    table = np.column_stack([np.round(np.arange(5) / 29.97, 4), [10, np.nan, 12, 13, 14], *[np.arange(5)] * 4])
    loaded, remarks = load_motion(write_csv(tmp_path / "ä 1.csv", columns, table), layout, 30000 / 1001)
    np.testing.assert_array_equal(loaded.frames[:, 3], [10, np.nan, 12, 13, 14])
    np.testing.assert_array_equal(loaded.frames[:, 0], np.arange(5))
    assert remarks == ("columns that the layout does not have were left out: extra",)
    assert channel_names(layout) == ("a.x", "a.y", "b.x", "b.y")


def test_csv_of_curves(tmp_path):
    layout = Layout("curves", ("jawOpen", "mouthClose"))
    loaded, _ = load_motion(write_csv(tmp_path / "a.csv", layout.names, np.ones((4, 2))), layout, 60)
    np.testing.assert_array_equal(loaded.frames, np.ones((4, 2)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a.x\n1\n", "unknown column 'a.y'"),
        ("a.x,a.y\n1\n", "line 2: 1 cells"),
        ("a.x,a.y\n1,two\n", "could not convert"),
        ("a.x,a.y\n", "no frames"),
        ("a.x,a.y\n1,inf\n", "infinite"),
        ("", "unknown column 'a.x'"),
        ("time_s,a.x,a.y\n0,1,1\n0,2,1\n", "does not lie after the one before"),
        ("time_s,a.x,a.y\n0,1,1\n0.1,1,1\n0.05,1,1\n", "does not lie after the one before"),
    ],
)
def test_bad_csv_is_one_clear_error(tmp_path, content, message):
    (tmp_path / "a.csv").write_text(content, encoding="utf-8")
    with pytest.raises(FacesynthError, match=message):
        load_motion(tmp_path / "a.csv", Layout("landmarks", ("a",)), 30)


def test_bad_npz_is_one_clear_error(tmp_path, motion):
    path = tmp_path / "a.npz"
    with pytest.raises(FacesynthError, match="is missing"):
        load_motion(path, LAYOUT, 120)
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(FacesynthError, match="not a motion file"):
        load_motion(path, LAYOUT, 120)
    np.savez(path, motion=motion.frames)
    with pytest.raises(FacesynthError, match="no array 'frames'"):
        load_motion(path, LAYOUT, 120)
    np.savez(path, frames=motion.frames[:, :-1])
    with pytest.raises(FacesynthError, match=r"\[T, 42\]"):
        load_motion(path, LAYOUT, 120)
    np.savez(path, frames=np.array([["a"] * 42]))
    with pytest.raises(FacesynthError, match=r"a\.npz"):
        load_motion(path, LAYOUT, 120)
    np.savez(path, frames=motion.frames, fps=np.array([1, 2]))
    with pytest.raises(FacesynthError, match="fps"):
        load_motion(path, LAYOUT, 120)
