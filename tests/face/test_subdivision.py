import numpy as np
import pytest

from facesynth.face.draw.subdivision import catmull_clark, refine_corners
from facesynth.inference.errors import FacesynthError

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def test_a_cube_becomes_the_textbook_26_points():
    matrix, fine = catmull_clark(8, CUBE_QUADS)
    points = matrix @ CUBE
    assert points.shape == (8 + 12 + 6, 3)
    assert fine.shape == (24, 4)
    np.testing.assert_allclose(np.abs(points[:8]), 5 / 9, atol=1e-6)  # (F + 2 R) / 3 with F = 1/3, R = 2/3
    np.testing.assert_allclose(np.sort(np.abs(points[8:20]), axis=1), [[0, 0.75, 0.75]] * 12, atol=1e-6)
    np.testing.assert_allclose(np.sort(np.abs(points[20:]), axis=1), [[0, 0, 1]] * 6, atol=1e-6)


def test_a_flat_grid_stays_flat_and_keeps_its_border_straight():
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    corner = (np.arange(4)[:, None] * 4 + np.arange(3)).ravel()
    matrix, fine = catmull_clark(20, np.stack([corner, corner + 4, corner + 5, corner + 1], 1))
    refined = matrix @ points
    np.testing.assert_allclose(np.asarray(matrix.sum(axis=1)), 1, atol=1e-6)
    assert np.abs(refined[:, 2]).max() == 0
    corners = refined[fine]
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 2] / 2
    assert (area > 0).all()  # orientation is kept
    assert refined[:, 0].min() == pytest.approx(0)
    assert refined[:, 0].max() == pytest.approx(4)


def test_corner_values_follow_the_fine_quads():
    corners = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]], float)
    fine = refine_corners(corners)
    assert fine.shape == (4, 4, 2)
    np.testing.assert_allclose(fine[0], [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    np.testing.assert_allclose(fine[2], [[1, 1], [0.5, 1], [0.5, 0.5], [1, 0.5]])


def test_triangles_are_refused():
    with pytest.raises(FacesynthError):
        catmull_clark(3, [[0, 1, 2]])
