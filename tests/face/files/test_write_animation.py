"""Every animation file read back, and the same bytes for the same animation."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.formats import SUFFIXES, write_animation
from facesynth.face.files.livelink import COUNT, HEADER, read_livelink, take_of, write_livelink
from facesynth.face.files.npz import read_npz
from facesynth.face.rig.arkit_rig import PIVOT_MM
from facesynth.inference import long_arrays
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.timecode import nominal_rate, timecode

RATES = [24000 / 1001, 24.0, 25.0, 30000 / 1001, 30.0, 60000 / 1001, 60.0, 120.0]


def animation_at(fps=30.0, count=90, seed=0):
    rng = np.random.default_rng(seed)
    weights = rng.uniform(0, 1, (count, 52))
    head = rng.normal(0, [0.2] * 3 + [4.0] * 3, (count, 6))
    return FaceAnimation(ARKIT_NAMES, weights, head, rng.normal(0, 0.1, (count, 2)), weights[:, 3], fps, weights[:, 5])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_same_animation_same_bytes(rig, tmp_path, suffix):
    paths = [tmp_path / f"süße nacht {i}{suffix}" for i in range(2)]
    for path in paths:
        write_animation(path, animation_at(), rig)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert sorted(tmp_path.iterdir()) == sorted(paths)


def test_some_frames_at_a_time_give_the_same_take_and_the_same_other_rate(rig, tmp_path, monkeypatch):
    whole, slower = animation_at(), animation_at().resampled(24.0)
    write_livelink(tmp_path / "whole.csv", take_of(whole))
    monkeypatch.setattr(long_arrays, "BLOCK_ROWS", 7)
    write_animation(tmp_path / "pieces.csv", whole, rig)
    assert (tmp_path / "pieces.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    again = whole.resampled(24.0)
    for name in ("weights", "head", "gaze"):
        np.testing.assert_array_equal(getattr(again, name), getattr(slower, name))


def test_unknown_suffix_names_the_known_ones(rig, tmp_path):
    with pytest.raises(FacesynthError, match=r"\.glb"):
        write_animation(tmp_path / "a.glbb", animation_at(), rig)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_the_old_file(rig, tmp_path, suffix, monkeypatch):
    import os

    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full_disk)
    with pytest.raises(OSError, match="No space"):
        write_animation(path, animation_at(), rig)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_real_takes_round_trip_to_the_byte(recordings, tmp_path):
    takes = sorted(recordings("livelink").glob("*.csv"))
    assert takes
    for path in takes:
        take = read_livelink(path)
        write_livelink(tmp_path / "copy.csv", take)
        assert (tmp_path / "copy.csv").read_bytes() == path.read_bytes()
        assert take.fps == pytest.approx(60, rel=0.005)


def test_eye_angles_have_the_signs_of_real_takes(recordings):
    """Where the app's eyes look, the animation's gaze looks, and the eyeLook weights agree."""
    for path in sorted(recordings("livelink").glob("*.csv")):
        animation = read_livelink(path).animation()
        sideways = animation.weight("eyeLookOutLeft") - animation.weight("eyeLookInLeft")
        upwards = animation.weight("eyeLookUpLeft") - animation.weight("eyeLookDownLeft")
        assert np.corrcoef(animation.gaze[:, 0], sideways)[0, 1] > 0.8
        assert np.corrcoef(animation.gaze[:, 1], upwards)[0, 1] > 0.8


@pytest.mark.parametrize("fps", RATES)
def test_livelink_keeps_animation_and_rate(rig, tmp_path, fps):
    animation = animation_at(fps, count=round(2.5 * fps))
    write_animation(tmp_path / "a.csv", animation, rig)
    take = read_livelink(tmp_path / "a.csv")
    back = take.animation()
    assert take.fps == pytest.approx(fps, abs=1e-9)
    np.testing.assert_allclose(back.weights, animation.weights, atol=1e-7)
    np.testing.assert_allclose(back.gaze, animation.gaze, atol=1e-7)
    np.testing.assert_allclose(back.head[:, :3], animation.head[:, :3], atol=1e-6)
    write_livelink(tmp_path / "b.csv", take)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_livelink_has_the_form_of_the_app(rig, tmp_path):
    write_animation(tmp_path / "a.csv", animation_at(), rig)
    header, first, *_ = (tmp_path / "a.csv").read_text().splitlines()
    assert header.startswith("Timecode,BlendshapeCount,EyeBlinkLeft,EyeLookDownLeft,")
    assert header.endswith(
        "TongueOut,HeadYaw,HeadPitch,HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll"
    )
    assert len(header.split(",")) == 63
    assert first.startswith("00:00:00:00.000,61,0.")
    assert all(len(value.split(".")[1]) == 10 for value in first.split(",")[2:])


def test_head_angles_of_single_turns():
    """Positive yaw is to the performer's right, positive pitch down, positive roll to their left shoulder."""
    still = np.zeros((3, 6))
    still[0, 1] = 0.3  # about y, right-handed: to the performer's left
    still[1, 0] = 0.2  # about x: down
    still[2, 2] = 0.1  # about z: the performer's left side goes up
    take = take_of(FaceAnimation(ARKIT_NAMES, np.zeros((3, 52)), still, np.zeros((3, 2)), np.zeros(3), 30.0))
    np.testing.assert_allclose(take.values[:, 52:55], [[-0.3, 0, 0], [0, 0.2, 0], [0, 0, -0.1]], atol=1e-7)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "header"),
        ("Timecode,Jaw\n", "Jaw"),
        (",".join(HEADER) + "\n", "no frames"),
        (",".join(HEADER) + "\n00:00:00:00.000,61,0.1\n", "row 2 has 3 values"),
        (",".join(HEADER) + "\n00:00:00:00.000,61" + ",x" * COUNT + "\n", "no number"),
        (",".join(HEADER) + "\n00:00:00:00.000,61" + ",nan" * COUNT + "\n", "NaN"),
        (",".join(HEADER) + "\nnoon,61" + ",0" * COUNT + "\n", "noon"),
        (",".join(HEADER) + "\n00:00:00:00.000,61" + ",0" * COUNT + "\n", "too short"),
        ("\ufeff\x00\x00", "Live Link"),
    ],
)
def test_strange_livelink_files_are_one_clear_error(tmp_path, text, complaint):
    path = tmp_path / "take.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FacesynthError, match=complaint):
        read_livelink(path)


def test_a_short_take_reads_with_its_rate_given(tmp_path):
    write_livelink(tmp_path / "a.csv", take_of(animation_at(30.0, 10)))
    assert read_livelink(tmp_path / "a.csv", fps=30.0).fps == 30.0


def test_binary_and_missing_files_are_clear_errors(tmp_path):
    (tmp_path / "a.csv").write_bytes(bytes(range(128, 256)))
    for name in ("a.csv", "none.csv"):
        with pytest.raises(FacesynthError, match="cannot be read"):
            read_livelink(tmp_path / name)


@pytest.mark.parametrize(
    ("seconds", "rate", "text"),
    [
        (0, 30, "00:00:00:00.000"),
        (1, 30, "00:00:01:00.000"),
        (29 / 30, 30, "00:00:00:29.000"),
        (3661.5, 24, "01:01:01:12.000"),
        (1001 / 30000, 30, "00:00:00:01.001"),
        (0.99999, 120, "00:00:00:119.999"),
    ],
)
def test_timecodes(seconds, rate, text):
    assert timecode(seconds, rate) == text


@pytest.mark.parametrize("rate", [24, 30, 60, 120])
def test_time_codes_come_back_as_the_times_that_were_written(tmp_path, rate):
    take = take_of(animation_at(float(rate), 3 * rate))
    write_livelink(tmp_path / "a.csv", take)
    back = read_livelink(tmp_path / "a.csv")
    assert back.fps == rate
    assert back.timecodes == tuple(timecode(k / rate, rate) for k in range(3 * rate))


def test_rates_of_television():
    assert [nominal_rate(fps) for fps in RATES] == [24, 24, 25, 30, 30, 60, 60, 120]


@pytest.mark.parametrize("fps", RATES)
def test_npz_round_trip(rig, tmp_path, fps):
    layout = Layout("markers", ("chin", "nose_mid"), {"jaw": (0,)}, neutral=(0.0,) * 6)
    rng = np.random.default_rng(0)
    motion = Motion(rng.normal(size=(40, 6)), 120.0, layout, rng.normal(size=(40, 6)), rng.normal(size=(40, 3)))
    animation = animation_at(fps)
    write_animation(tmp_path / "a.npz", animation, rig, motion)
    back, moved = read_npz(tmp_path / "a.npz")
    for name in ("weights", "head", "gaze", "tongue_up", "residual_mm"):
        np.testing.assert_array_equal(getattr(back, name), getattr(animation, name))
    assert (back.fps, back.names) == (fps, animation.names)
    for name in ("frames", "head", "eyes"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(motion, name))
    assert moved.layout.to_dict() == layout.to_dict()
    write_animation(tmp_path / "b.npz", animation, rig)
    assert read_npz(tmp_path / "b.npz")[1] is None


def test_damaged_npz_files_are_one_clear_error(rig, tmp_path):
    write_animation(tmp_path / "a.npz", animation_at(), rig)
    whole = (tmp_path / "a.npz").read_bytes()
    broken = {"cut": whole[: len(whole) // 2], "text": b"hello", "empty": b""}
    for name, content in broken.items():
        (tmp_path / f"{name}.npz").write_bytes(content)
        with pytest.raises(FacesynthError, match="npz"):
            read_npz(tmp_path / f"{name}.npz")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(FacesynthError, match="not an animation that facesynth wrote"):
        read_npz(tmp_path / "other.npz")
    np.savez(tmp_path / "pickle.npz", names=np.array([{}], object))
    with pytest.raises(FacesynthError, match="npz"):
        read_npz(tmp_path / "pickle.npz")
    with pytest.raises(FacesynthError, match="npz"):
        read_npz(tmp_path / "missing.npz")


def read_bvh(path):
    """A reader of one-joint BVH: (offset, channel names, rows, frame time)."""
    words = path.read_text().split()
    assert words[:4] == ["HIERARCHY", "ROOT", "head", "{"]
    offset = [float(word) for word in words[words.index("OFFSET") + 1 :][:3]]
    at = words.index("CHANNELS")
    channels = words[at + 2 : at + 2 + int(words[at + 1])]
    assert words.count("{") == words.count("}")
    motion = words[words.index("MOTION") :]
    count, step = int(motion[motion.index("Frames:") + 1]), float(motion[motion.index("Time:") + 1])
    rows = np.array(motion[motion.index("Time:") + 2 :], float).reshape(count, len(channels))
    return np.array(offset), channels, rows, step


@pytest.mark.parametrize("fps", RATES)
def test_bvh_holds_the_head(rig, tmp_path, fps):
    animation = animation_at(fps)
    write_animation(tmp_path / "a.bvh", animation, rig)
    _, channels, rows, step = read_bvh(tmp_path / "a.bvh")
    assert 1 / step == pytest.approx(fps, rel=1e-9)
    turn = np.tile(np.eye(3), (len(rows), 1, 1))
    place = np.zeros((len(rows), 3))
    for column, channel in zip(rows.T, channels, strict=True):
        axis = "XYZ".index(channel[0])
        if channel.endswith("position"):
            place[:, axis] = column
        else:  # each rotation acts in the axes that the ones before it left
            turn = turn @ Rotation.from_rotvec(np.radians(column)[:, None] * np.eye(3)[axis]).as_matrix()
    np.testing.assert_allclose(turn, Rotation.from_rotvec(animation.head[:, :3]).as_matrix(), atol=1e-6)
    np.testing.assert_allclose(place * 10, PIVOT_MM + animation.head[:, 3:], atol=1e-4)


def test_npz_layout_is_json(rig, tmp_path):
    motion = Motion(np.zeros((3, 3)), 30.0, Layout("markers", ("chin",)))
    write_animation(tmp_path / "a.npz", animation_at(), rig, motion)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        assert json.loads(str(archive["layout"]))["names"] == ["chin"]
