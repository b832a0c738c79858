"""Key poses of a head."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.keys import HeadKeys, read_head_keys
from facesynth.inference.quaternions import from_angles, from_rotvec, to_angles, to_rotvec
from facesynth.inference.speech import PhoneTrack

PHONES = PhoneTrack(("pau", "aa"), np.array([1.0, 3.0]))


def written(tmp_path, *lines):
    path = tmp_path / "keys.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_angles_are_those_of_scipy_and_come_back():
    angles = np.random.default_rng(0).uniform(-1.2, 1.2, (50, 3))
    wanted = Rotation.from_euler("YXZ", angles[:, [1, 0, 2]])
    np.testing.assert_allclose(Rotation.from_rotvec(to_rotvec(from_angles(angles))).as_matrix(), wanted.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(to_angles(from_angles(angles)), angles, atol=1e-9)
    np.testing.assert_allclose(to_angles(from_rotvec(np.zeros((2, 3)))), 0)


def test_a_table_of_key_poses(tmp_path):
    keys = read_head_keys(written(tmp_path, "time_s, pitch, yaw, roll", "0, 0, 0, 0", "1.5, 10, -20, 5"), PHONES)
    np.testing.assert_allclose(keys.times_s, [0, 1.5])
    np.testing.assert_allclose(np.degrees(to_angles(from_rotvec(keys.poses[:, :3])))[1], [10, -20, 5])
    np.testing.assert_allclose(keys.poses[:, 3:], 0)


def test_each_frame_looks_to_the_next_key_pose():
    keys = HeadKeys(np.array([0.1, 0.3]), np.array([np.full(6, 1.0), np.full(6, 2.0)]))
    targets, keyed = keys.targets(0, 6, 10.0, np.zeros(6))
    np.testing.assert_allclose(targets[:, 0], [1, 1, 2, 2, 0, 0])
    np.testing.assert_array_equal(keyed, [False, True, False, True, False, False])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["time_s,pitch,yaw", "0,1,2"], r"keys.csv lacks roll; key poses are a CSV with columns time_s,pitch,yaw,roll"),
        (["time_s,pitch,yaw,roll", "1,0,0,0", "0.5,0,0,0"], r"line 3: 0.5 s is not later than the line before \(1 s\)"),
        (["time_s,pitch,yaw,roll", "1,0,0,0", "1,0,0,0"], r"line 3: 1 s is not later"),
        (["time_s,pitch,yaw,roll", "3.5,0,0,0"], r"line 2: 3.5 s is outside of the speech, 0 to 3.000 s"),
        (["time_s,pitch,yaw,roll", "1,up,0,0"], r"line 2: pitch must be a number; got 'up'"),
        (["time_s,pitch,yaw,roll", "1,nan,0,0"], r"line 2: pitch must be a number"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(tmp_path, lines, message):
    with pytest.raises(FacesynthError, match=message) as refusal:
        read_head_keys(written(tmp_path, *lines), PHONES)
    assert "\n" not in str(refusal.value)


def test_key_poses_out_of_order_are_refused():
    with pytest.raises(FacesynthError, match="one after the other"):
        HeadKeys(np.array([1.0, 0.5]), np.zeros((2, 6)))
