import numpy as np
import pytest
import torch

from facesynth.face.texture.mesh import mesh_of, ringed_mesh, signed_areas
from facesynth.face.texture.warp import PiecewiseAffineWarp, places_in, sample
from facesynth.inference.errors import FacesynthError

HEIGHT, WIDTH = 48, 64


@pytest.fixture
def picture():
    return torch.rand(1, 3, HEIGHT, WIDTH, generator=torch.Generator().manual_seed(0))


@pytest.fixture
def mesh():
    """25 points at whole pixels, about 6 px apart."""
    x, y = np.meshgrid(np.arange(18, 46, 6), np.arange(12, 36, 5))
    shifts = np.random.default_rng(0).integers(-1, 2, (25, 2))
    return ringed_mesh(np.column_stack([x.ravel(), y.ravel()]) + shifts)


def moved(mesh, amount, seed=1):
    points = mesh.reference[: mesh.moving] + np.random.default_rng(seed).uniform(-amount, amount, (mesh.moving, 2))
    return mesh.vertices(points)


def warp(mesh, picture, source, target):
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    return warper(picture, torch.from_numpy(source)[None].float(), torch.from_numpy(target)[None].float())


def by_triangle(mesh, picture, source, target):
    """The same, slowly: every pixel of every triangle by its barycentric coordinates."""
    pixels = picture[0].double().numpy()
    out = pixels.copy()
    for triangle in mesh.triangles:
        a, b, c = target[triangle]
        inverse = np.linalg.inv(np.column_stack([b - a, c - a]))
        for y in range(HEIGHT):
            for x in range(WIDTH):
                s, t = inverse @ (x - a[0], y - a[1])
                if min(s, t, 1 - s - t) >= -1e-9:
                    out[:, y, x] = bilinear(pixels, np.array([1 - s - t, s, t]) @ source[triangle])
    return out


def bilinear(pixels, point):
    x, y = np.clip(point, 0, [WIDTH - 1, HEIGHT - 1])
    j, i = min(int(x), WIDTH - 2), min(int(y), HEIGHT - 2)
    dx, dy = x - j, y - i
    top = (1 - dx) * pixels[:, i, j] + dx * pixels[:, i, j + 1]
    return (1 - dy) * top + dy * ((1 - dx) * pixels[:, i + 1, j] + dx * pixels[:, i + 1, j + 1])


def test_identical_shapes_leave_the_picture(mesh, picture):
    shape = moved(mesh, 1.0)
    assert (warp(mesh, picture, shape, shape) - picture).abs().max() < 1e-4


def test_control_points_move_exactly(mesh):
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    ramp = torch.from_numpy(np.stack([columns, rows])[None]).float()
    source = moved(mesh, 1.5)
    drawn = warp(mesh, ramp, source, mesh.reference)[0]
    x, y = mesh.reference[: mesh.moving].astype(int).T
    np.testing.assert_allclose(drawn[:, y, x].T, source[: mesh.moving], atol=1e-3)


@pytest.mark.parametrize("seed", range(2))
def test_warp_is_that_of_a_slow_reference(mesh, picture, seed):
    source, target = moved(mesh, 1.5, seed), moved(mesh, 1.5, seed + 10)
    np.testing.assert_allclose(warp(mesh, picture, source, target)[0], by_triangle(mesh, picture, source, target), atol=1e-4)


def test_level_and_vertical_edges_leave_no_holes(picture):
    corners = np.array([[0.0, 0], [WIDTH - 1, 0], [0, HEIGHT - 1], [WIDTH - 1, HEIGHT - 1]])
    mesh = mesh_of(np.array([[20.0, 10], [40, 10], [20, 30], [40, 30]]), corners)
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    inside = warper.interpolate(torch.from_numpy(mesh.reference).float()[None], torch.ones(1, 8, 1))
    assert (inside - 1).abs().max() < 1e-6


def test_interpolation_is_linear(mesh):
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    vertices = torch.from_numpy(moved(mesh, 1.0)).float()
    values = 2 * vertices[:, :1] - 3 * vertices[:, 1:] + 5
    drawn = warper.interpolate(vertices[None], values[None])[0, :, :, 0]
    covered = warper.interpolate(vertices[None], torch.ones(1, len(vertices), 1))[0, :, :, 0] > 0.5
    y, x = torch.nonzero(covered, as_tuple=True)
    torch.testing.assert_close(drawn[y, x], (2 * x - 3 * y + 5).float(), atol=1e-3, rtol=0)
    assert (drawn[~covered] == 0).all()


@pytest.mark.parametrize("amount", [0.0, 1.5, 9.0])
def test_both_ways_of_filling_agree(mesh, amount):
    """A compiled loop on the processor, torch elsewhere; folded and level triangles included."""
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    vertices = torch.from_numpy(np.stack([moved(mesh, amount, seed) for seed in (1, 2)])).float()
    values = torch.rand(2, vertices.shape[1], 3, generator=torch.Generator().manual_seed(0))
    if amount > 2:  # where triangles overlap, which of them counts is free: only what is covered is compared
        values = torch.ones_like(values)
    torch.testing.assert_close(
        warper.interpolate(vertices, values), warper.interpolate_by_spans(vertices, values), atol=2e-3, rtol=0
    )


def test_gradients_pass_through_the_warp(mesh, picture):
    target = torch.from_numpy(moved(mesh, 1.0))[None].float().requires_grad_()
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    warper(picture, torch.from_numpy(mesh.reference)[None].float(), target).square().mean().backward()
    assert target.grad.abs().max() > 0


def test_outside_the_mesh_nothing_changes(mesh, picture):
    source, target = moved(mesh, 1.0, 1), moved(mesh, 1.0, 2)
    drawn = warp(mesh, picture, source, target)
    assert (drawn[:, :, :2] - picture[:, :, :2]).abs().max() < 1e-4


def test_whole_pixel_displacement_is_a_shift(picture):
    y, x = torch.meshgrid(torch.arange(float(HEIGHT)), torch.arange(float(WIDTH)), indexing="ij")
    shifted = sample(picture, places_in(picture, torch.stack([x + 3, y], dim=-1)[None]))
    torch.testing.assert_close(shifted[..., :-3], picture[..., 3:], atol=1e-4, rtol=0)
    torch.testing.assert_close(shifted[..., -3:], picture[..., -1:].expand(-1, -1, -1, 3), atol=1e-4, rtol=0)


def test_folded_triangles_are_counted(mesh):
    assert mesh.folded(mesh.reference) == 0
    points = mesh.reference[: mesh.moving].copy()
    points[0] += [60, 0]
    assert mesh.folded(mesh.vertices(points)) > 0
    assert (signed_areas(mesh.reference, mesh.triangles) > 0).all()


@pytest.mark.parametrize("size_px", [1.0, 6.0, 40.0])
def test_unfolded_meshes_have_no_folds(mesh, size_px):
    rng = np.random.default_rng(3)
    vertices = mesh.vertices(mesh.reference[: mesh.moving] + rng.normal(scale=size_px, size=(20, mesh.moving, 2)))
    relaxed = mesh.unfolded(vertices)
    assert (signed_areas(relaxed, mesh.triangles) > 0).all()
    assert np.array_equal(relaxed[:, mesh.moving :], vertices[:, mesh.moving :]), "the ring stands still"


def test_whole_meshes_stay_and_only_what_folds_is_moved(mesh):
    gentle = mesh.vertices(mesh.reference[: mesh.moving] + np.array([0.2, -0.1]))
    assert np.array_equal(mesh.unfolded(gentle[None])[0], gentle)
    torn = mesh.reference[: mesh.moving].copy()
    torn[0] += [30, 0]
    moved = np.abs(mesh.unfolded(mesh.vertices(torn)[None])[0] - mesh.vertices(torn)).max(axis=1) > 0
    assert moved[0]
    assert moved.mean() < 0.5


def test_meshes_need_an_area():
    with pytest.raises(FacesynthError, match="one line"):
        ringed_mesh(np.column_stack([np.arange(5.0), np.arange(5.0)]))
    with pytest.raises(FacesynthError, match="at least 3 points"):
        ringed_mesh(np.zeros((2, 2)))


def test_a_batch_is_its_pictures_one_by_one(mesh, picture):
    warper = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    pictures = torch.cat([picture, picture.flip(2)])
    source, target = (torch.from_numpy(np.stack([moved(mesh, 1.0, seed), moved(mesh, 1.0, seed + 5)])).float() for seed in (1, 2))
    both = warper(pictures, source, target)
    for i in range(2):
        torch.testing.assert_close(both[i], warper(pictures[i : i + 1], source[i : i + 1], target[i : i + 1])[0])
