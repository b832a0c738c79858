from dataclasses import replace

import numpy as np
import pytest

from facesynth.face.draw.camera import Camera
from facesynth.face.draw.furrows import furrow, pushed_together, vertex_areas
from facesynth.face.draw.render import Renderer
from facesynth.face.rig.arkit_rig import pose

CLOSE = Camera((0.0, 20.0, 1010.0), (0.0, 20.0, 60.0), 4.0)
"""Sees 66 mm of the forehead."""
SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0]], np.float32)
QUADS = np.array([[0, 1, 2, 3]], np.int32)


@pytest.fixture(scope="module")
def drawn(rig):
    """Pictures of weights with furrows and without."""
    with_furrows = Renderer.of(rig, (96, 96), CLOSE)
    without = Renderer(replace(with_furrows.look, furrows=False), (96, 96), CLOSE)

    def both(*shapes, head=None):
        weights = np.zeros(52)
        weights[rig.index(*shapes)] = 1
        vertices = pose(rig, weights, head)
        return with_furrows.render(vertices).astype(int), without.render(vertices).astype(int)

    return both


def test_areas_of_a_rectangle_and_what_half_of_it_lost():
    rest = vertex_areas(SQUARE, QUADS)
    np.testing.assert_allclose(rest, 6)
    np.testing.assert_allclose(pushed_together(SQUARE * np.float32([0.5, 1, 1]), QUADS, rest), 0.5)
    np.testing.assert_allclose(pushed_together(SQUARE * np.float32([2, 1, 1]), QUADS, rest), 0)


def test_skin_that_is_not_pushed_together_has_no_furrow(drawn):
    for plain in (drawn(), drawn(head=[0.1, 0.2, 0, 3, 0, 0]), drawn("eyeWideLeft")):
        np.testing.assert_array_equal(*plain)


def test_a_frown_has_two_lines_between_the_brows(drawn):
    furrowed, plain = drawn("browDownLeft", "browDownRight")
    darker = (plain - furrowed).sum(axis=2)
    assert darker.max() > 60
    columns = darker[darker.max(axis=1) > 60].max(axis=0)
    assert columns[:48].max() > 60 < columns[48:].max()
    assert columns[46:50].max() < 30


def test_raised_brows_have_lines_across_the_forehead(drawn):
    furrowed, plain = drawn("browInnerUp")
    darker = (plain - furrowed).sum(axis=2)
    assert darker[:40, 40:56].max() > 40
    assert darker[60:].max() < 15


def test_a_furrow_is_deepest_on_its_line_and_slopes_to_both_sides():
    deep, left, _ = furrow(5.6, 12.0, 150.0, 0.5)
    assert deep == pytest.approx(1, abs=0.01)
    assert abs(left) < 0.01
    assert furrow(6.6, 12.0, 150.0, 0.5)[1] > 0 > furrow(4.6, 12.0, 150.0, 0.5)[1]
    assert furrow(-6.6, 12.0, 150.0, 0.5)[1] < 0
    assert furrow(5.6, 12.0, 150.0, 0.0)[0] == 0
    assert furrow(5.6, 12.0, 50.0, 0.5)[0] == 0
