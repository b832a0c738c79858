import numpy as np
import pytest

from facesynth.face.draw.raster import (
    FAR,
    SAMPLES,
    TILE,
    bin_segments,
    bin_triangles,
    draw_depth,
    draw_segment,
    draw_triangle,
    nearest_first,
    vertex_normals,
)


def screen_of(*points):
    return np.array(points, np.float32)


def test_depth_of_a_sloping_square_is_its_plane():
    depth = np.full((16, 16), FAR, np.float32)
    draw_depth(screen_of([2, 2, 10], [2, 12, 10], [12, 12, 20], [12, 2, 20]), np.array([[0, 1, 2, 3]], np.int32), depth)
    assert (depth[2:12, 2:12] < FAR).all()
    assert (depth < FAR).sum() == 100
    np.testing.assert_allclose(depth[5, 2:12], 10.5 + np.arange(10), atol=1e-4)


def test_a_net_of_triangles_has_no_gaps_and_counts_each_sample_once():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-3, 35, 12), np.linspace(-3, 35, 12), indexing="ij")
    jitter = rng.uniform(-1, 1, (2, 12, 12))
    screen = np.stack([x + jitter[0], y + jitter[1], np.full_like(x, 5)], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(11)[:, None] * 12 + np.arange(11)).ravel()
    quads = np.stack([corner, corner + 1, corner + 13, corner + 12], 1).astype(np.int32)
    depth, owner = np.full((TILE, TILE, SAMPLES), FAR, np.float32), np.full((TILE, TILE, SAMPLES), -1, np.int32)
    for triangle in range(2 * len(quads)):
        draw_triangle(screen, quads, triangle, 0, 0, depth, owner)
    assert (owner >= 0).all()


def test_the_nearer_triangle_wins_whatever_the_order():
    screen = screen_of([0, 0, 5], [0, 40, 5], [40, 40, 5], [40, 0, 5], [0, 0, 3], [0, 40, 3], [40, 40, 3], [40, 0, 3])
    quads = np.array([[0, 1, 2, 3], [4, 5, 6, 7]], np.int32)
    for order in ([0, 1, 2, 3], [2, 3, 0, 1]):
        depth, owner = np.full((TILE, TILE, SAMPLES), FAR, np.float32), np.full((TILE, TILE, SAMPLES), -1, np.int32)
        for triangle in order:
            draw_triangle(screen, quads, triangle, 0, 0, depth, owner)
        assert set(owner.ravel()) <= {2, 3}


def test_an_edge_through_a_pixel_covers_a_share_of_its_samples():
    screen = screen_of([0, 0, 1], [0, 32, 1], [10.5, 32, 1], [10.5, 0, 1])
    depth, owner = np.full((TILE, TILE, SAMPLES), FAR, np.float32), np.full((TILE, TILE, SAMPLES), -1, np.int32)
    for triangle in (0, 1):
        draw_triangle(screen, np.array([[0, 1, 2, 3]], np.int32), triangle, 0, 0, depth, owner)
    covered = (owner >= 0).sum(axis=2)
    assert (covered[:, :10] == SAMPLES).all()
    assert (covered[:, 10] == SAMPLES // 2).all()
    assert (covered[:, 11:] == 0).all()


def test_bins_hold_what_touches_them_and_nothing_that_faces_away():
    screen = screen_of([1, 1, 1], [1, 40, 1], [40, 40, 1], [40, 1, 1])
    starts, members = bin_triangles(screen, np.array([[0, 1, 2, 3]], np.int32), 2, 2)
    tiles = [set(members[starts[k] : starts[k + 1]]) for k in range(4)]
    assert tiles[0] == tiles[3] == {0, 1}
    assert 0 in tiles[2]
    assert 1 in tiles[1]
    assert len(bin_triangles(screen, np.array([[3, 2, 1, 0]], np.int32), 2, 2)[1]) == 0


def test_segments_are_sorted_by_depth_and_stay_so_in_bins():
    rng = np.random.default_rng(1)
    screen = np.concatenate([rng.uniform(0, 64, (200, 2)), rng.uniform(900, 1000, (200, 1))], 1).astype(np.float32)
    segments = np.arange(200, dtype=np.int32).reshape(-1, 2)
    facing = np.where(np.arange(200) < 20, -1, 1).astype(np.float32)
    order = nearest_first(screen, segments, facing, 4096)
    assert set(order) == set(range(10, 100))
    roots = screen[segments[order, 0], 2]
    assert (np.diff(roots) > -0.1).all()
    starts, members = bin_segments(screen, segments, order, 1.0, 2, 2)
    for k in range(4):
        assert (np.diff(screen[segments[members[starts[k] : starts[k + 1]], 0], 2]) > -0.1).all()


@pytest.mark.parametrize(("dx", "dy"), [(20, 0), (0, 20), (14, 14), (-18, 5)])
@pytest.mark.parametrize("width", [0.3, 1.0, 3.0])
def test_a_strand_covers_its_length_times_its_width(dx, dy, width):
    rng, covered = np.random.default_rng(4), []
    for _ in range(30):
        x, y = 16 + rng.uniform(-1, 1, 2)
        screen = screen_of([x - dx / 2, y - dy / 2, 5], [x + dx / 2, y + dy / 2, 5])
        gathered = np.zeros((TILE, TILE, 4), np.float32)
        gathered[..., 3] = 1
        depth = np.full((TILE, TILE, SAMPLES), FAR, np.float32)
        draw_segment(screen, np.full(2, width, np.float32), np.ones((2, 3), np.float32), 0, 1, 0, 0, depth, gathered)
        np.testing.assert_allclose(gathered[..., 0] + gathered[..., 3], 1, atol=1e-5)
        covered.append(gathered[..., 0].sum())
    assert np.mean(covered) == pytest.approx(np.hypot(dx, dy) * width, rel=0.05)


def test_a_strand_behind_a_surface_is_not_seen():
    gathered = np.zeros((TILE, TILE, 4), np.float32)
    gathered[..., 3] = 1
    depth = np.full((TILE, TILE, SAMPLES), 4, np.float32)
    screen = screen_of([5, 16, 5], [25, 16, 5])
    draw_segment(screen, np.ones(2, np.float32), np.ones((2, 3), np.float32), 0, 1, 0, 0, depth, gathered)
    assert gathered[..., :3].max() == 0


def test_normals_of_a_cube_point_outwards():
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]], np.int32)
    np.testing.assert_allclose(vertex_normals(points, quads), points / np.sqrt(3), atol=1e-6)
