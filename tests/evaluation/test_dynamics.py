import numpy as np
import pytest
from talking_points import FPS, LAYOUT, REST, face, moved, talk

from facesynth.evaluation import dynamics
from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion


def scaled(motion, size):
    """The motion with its displacement from rest made `size` times as large."""
    return moved(motion, (REST.ravel() + size * (motion.frames - REST.ravel())).astype(np.float32))


def test_identity():
    truth = talk()
    assert dynamics.velocity_error(truth, truth) == 0
    assert dynamics.fdd(truth, truth) == dynamics.fdd_abs(truth, truth) == 0
    assert dynamics.jerk_ratio(truth, truth) == dynamics.energy_ratio(truth, truth) == 1


def test_a_constant_offset_is_no_velocity():
    truth = talk()
    assert dynamics.velocity_error(moved(truth, truth.frames + 8), truth) == pytest.approx(0, abs=1e-2)


def test_a_steady_drift_is_its_own_velocity_error_at_any_rate():
    for fps in (25.0, 120.0):
        truth = talk(fps=fps)
        drift = np.arange(len(truth))[:, None] / fps * np.tile([0, 0, 7.0], 12)
        assert dynamics.velocity_error(moved(truth, truth.frames + drift), truth) == pytest.approx(7, rel=1e-3)


def test_doubled_amplitude_doubles_speed_and_quadruples_squared_jerk():
    truth = talk()
    assert dynamics.energy_ratio(scaled(truth, 2), truth) == pytest.approx(2, rel=1e-4)
    assert dynamics.jerk_ratio(scaled(truth, 2), truth) == pytest.approx(4, rel=1e-3)


def test_fdd_is_the_spread_that_the_upper_face_lacks_and_signs_cancel_only_in_fdd():
    t = np.arange(600)
    brow = np.abs(np.sin(2 * np.pi * t / 100))
    truth = face(5 + np.sin(t / 9), 3 * brow)
    spread = (3 * brow).std()
    still, lively = face(np.full(600, 5.0)), face(5 + np.sin(t / 9), 6 * brow)
    assert dynamics.fdd(still, truth) == pytest.approx(spread, rel=1e-4)
    assert dynamics.fdd(lively, truth) == pytest.approx(-spread, rel=1e-4)
    assert dynamics.fdd_abs(lively, truth) == pytest.approx(spread, rel=1e-4)


def test_fdd_needs_a_rest_pose_and_an_upper_face():
    truth = talk()
    restless = Layout("markers", LAYOUT.names, LAYOUT.groups, LAYOUT.lip_pairs)
    with pytest.raises(UnavailableError, match="rest pose"):
        dynamics.fdd(Motion(truth.frames, FPS, restless), Motion(truth.frames, FPS, restless))
    browless = Layout("markers", LAYOUT.names, {"mouth": (5,)}, LAYOUT.lip_pairs, LAYOUT.neutral)
    with pytest.raises(UnavailableError, match="upper_face"):
        dynamics.fdd(Motion(truth.frames, FPS, browless), Motion(truth.frames, FPS, browless))


def test_a_standing_truth_gives_no_ratio():
    with pytest.raises(UnavailableError, match="does not move"):
        dynamics.energy_ratio(talk(), face(np.full(240, 5.0)))


def test_join_jump_sees_a_step_at_the_join_and_nothing_in_a_smooth_one():
    t = np.arange(400) / FPS
    smooth = face(5 + np.sin(2 * np.pi * 3 * t))
    step = face(5 + np.sin(2 * np.pi * 3 * t) + (t >= 200 / FPS) * 3)
    assert dynamics.join_jump(smooth, range(7, 400, 7)) == pytest.approx(1, abs=0.1)
    assert dynamics.join_jump(step, [200]) > 20
    assert dynamics.join_jump(step, [200]) > 5 * dynamics.join_jump(step, [190])
    jumps = [dynamics.join_jump(face(5 + np.sin(2 * np.pi * 3 * t) + (t >= 200 / FPS) * size), [200]) for size in (0, 1, 2, 4)]
    assert jumps == sorted(jumps)


def test_join_jump_on_a_piecewise_straight_line_is_known():
    ramp = np.concatenate([np.zeros(50), np.arange(1.0, 51.0)])
    noise = np.tile([0.0, 0.01], 50)
    change = np.abs(np.diff(ramp + noise, 2))
    motion = Motion((ramp + noise)[:, None], 30, Layout("curves", ("jawOpen",)))
    elsewhere = np.delete(change, [48, 49]).mean()  # the changes at frames 49 and 50
    assert dynamics.join_jump(motion, [50]) == pytest.approx(change[[48, 49]].mean() / elsewhere, rel=1e-3)


def test_joins_outside_the_motion_are_refused_and_none_is_unavailable():
    with pytest.raises(FacesynthError, match="join 240"):
        dynamics.join_jump(talk(), [240])
    with pytest.raises(UnavailableError, match="no joins"):
        dynamics.join_jump(talk(), [])
