import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.layout import Layout
from facesynth.inference.lips import gap
from facesynth.inference.openings import Openings

RNG = np.random.default_rng(8)
LAYOUT = tiny_layout()


def faces(count=200):
    return np.array(LAYOUT.neutral) + RNG.normal(0, 3, (count, LAYOUT.channels))


@pytest.mark.parametrize("power", [0.4, 0.6, 1.0, 1.5])
def test_shut_and_wide_stay_and_what_is_between_is_wider_the_lower_the_power(power):
    rule = Openings(power, shut=2.0, wide=10.0)
    np.testing.assert_allclose(rule.changed(np.array([-1.0, 2.0, 4.0, 10.0])), [-1, 2, 2 + 8 * 0.25**power, 10])
    assert (np.diff(rule.changed(np.linspace(0, 15, 100))) > 0).all()


def test_lips_get_the_openings_by_moving_both_half_of_the_way_and_nothing_else_moves():
    rule, before = Openings(0.6, shut=1.0, wide=8.0), faces()
    after = rule.even_out(before, LAYOUT)
    np.testing.assert_allclose(gap(after, LAYOUT), rule.changed(gap(before, LAYOUT)), atol=1e-9)
    (upper, lower), moved = LAYOUT.lip_pairs[0], LAYOUT.points(after - before)
    np.testing.assert_allclose(moved[:, upper], -moved[:, lower], atol=1e-9)
    lips = {*LAYOUT.group("upper_lip"), *LAYOUT.group("lower_lip"), upper, lower}
    assert not moved[:, [p for p in range(len(LAYOUT.names)) if p not in lips]].any()


def test_a_power_of_one_and_layouts_without_lips_leave_a_face_as_it_is():
    before = faces(20)
    np.testing.assert_allclose(Openings(1.0, 1.0, 8.0).even_out(before, LAYOUT), before, atol=1e-9)
    curves = Layout("curves", ("jawOpen", "mouthClose"))
    np.testing.assert_array_equal(Openings(0.5, 1.0, 8.0).even_out(before[:, :2], curves), before[:, :2])


def test_a_talker_whose_lips_hardly_move_is_left_alone():
    gaps = np.linspace(0, 5, 20)
    np.testing.assert_array_equal(Openings(0.5, 3.0, 3.0).changed(gaps), gaps)
