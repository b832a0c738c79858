import numpy as np
import pytest

from facesynth.face.draw import render
from facesynth.face.draw.bake import baked_head
from facesynth.face.draw.camera import Camera
from facesynth.face.draw.occlusion import sky_directions, sky_visibility
from facesynth.face.draw.render import Renderer
from facesynth.face.rig.arkit_rig import pose
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES

SIZE = (160, 90)


@pytest.fixture(scope="module")
def renderer(rig):
    return Renderer.of(rig, SIZE)


@pytest.fixture(scope="module")
def portrait(rig, renderer):
    return renderer.render(rig.rest_mm)


def weights(**values):
    w = np.zeros(52)
    for name, value in values.items():
        w[ARKIT_NAMES.index(name)] = value
    return w


def differing(one, other, threshold=12):
    return np.abs(one.astype(int) - other).max(axis=2) > threshold


def box_around(renderer, points_mm):
    """Rows and columns around points, as slices, with two pixels to spare."""
    screen = renderer.camera.project(points_mm, SIZE)
    low, high = screen[:, :2].min(axis=0).astype(int) - 2, screen[:, :2].max(axis=0).astype(int) + 3
    return slice(low[1], high[1]), slice(low[0], high[0])


def test_the_camera_sees_its_target_in_the_middle_and_left_on_the_right():
    screen = Camera().project(np.array([[0, -24, 60], [50, -24, 60], [0, 0, 60]], np.float32), (1280, 720))
    np.testing.assert_allclose(screen[0, :2], [640, 360], atol=1e-3)
    assert screen[0, 2] == pytest.approx(950, abs=0.1)
    assert screen[1, 0] > 640
    assert screen[2, 1] < 360


def test_a_picture_is_the_same_bytes_every_time(rig, renderer, portrait):
    assert portrait.shape == (90, 160, 3)
    assert portrait.dtype == np.uint8
    np.testing.assert_array_equal(portrait, renderer.render(rig.rest_mm))


def test_the_number_of_threads_changes_nothing(rig, portrait, monkeypatch):
    for cores in (1, 5):
        monkeypatch.setattr(render, "available_cores", lambda cores=cores: cores)
        np.testing.assert_array_equal(portrait, Renderer.of(rig, SIZE).render(rig.rest_mm))


def test_only_the_backdrop_where_nobody_is(rig, renderer, portrait):
    gone = renderer.render(rig.rest_mm + np.array([0, 2000, 0], np.float32))
    assert differing(gone, portrait).mean() > 0.2
    np.testing.assert_array_equal(gone[:30, :30], portrait[:30, :30])
    assert gone.std(axis=2).max() < 15  # grey


def test_the_face_has_no_holes(rig, renderer, portrait):
    gone = renderer.render(rig.rest_mm + np.array([0, 2000, 0], np.float32))
    face = rig.rest_mm[(rig.part == 0) & (rig.rest_mm[:, 2] > 100) & (np.abs(rig.rest_mm[:, 0]) < 45)]
    rows, columns = box_around(renderer, face[np.abs(face[:, 1] + 20) < 40])
    assert differing(gone, portrait, 6)[rows, columns].mean() > 0.97


def test_the_silhouette_is_nearly_symmetric(rig, renderer, portrait):
    gone = renderer.render(rig.rest_mm + np.array([0, 2000, 0], np.float32))
    seen = differing(gone, portrait)
    assert (seen == seen[:, ::-1]).mean() > 0.95


def test_the_key_light_makes_the_performers_right_brighter(rig, renderer, portrait):
    rows, _ = box_around(renderer, rig.rest_mm[rig.vertices_of("left_eye")] - np.array([0, 30, 0], np.float32))
    assert portrait[rows, 60:78].mean() > 1.1 * portrait[rows, 82:100].mean()


def test_opening_the_jaw_changes_the_mouth_and_not_the_brows(rig, renderer, portrait):
    opened = renderer.render(pose(rig, weights(jawOpen=0.4)))
    mouth = box_around(renderer, rig.rest_mm[rig.from_source([515, 535, 405, 7165])])
    brows = box_around(renderer, rig.rest_mm[rig.from_source([208, 6983, 224, 6998])])
    assert differing(opened, portrait)[mouth].mean() > 0.3
    assert differing(opened, portrait)[brows].mean() < 0.01
    assert opened[mouth].min() < portrait[mouth].min()  # it is dark inside


def test_a_blink_hides_the_white_of_the_eyes(rig, renderer, portrait):
    shut = renderer.render(pose(rig, weights(eyeBlinkLeft=1, eyeBlinkRight=1)))
    eye = box_around(renderer, rig.rest_mm[rig.from_source([13352, 13370])])
    assert differing(shut, portrait)[eye].mean() > 0.2


def test_turning_the_head_moves_hair_and_brows_with_it(rig, renderer, portrait):
    turned = renderer.render(pose(rig, np.zeros(52), [0, 0.5, 0, 0, 0, 0]))
    assert differing(turned, portrait).mean() > 0.15
    assert (turned[10] < 60).any()


def test_light_stays_within_bounds(rig, renderer, portrait):
    for values in (weights(), weights(jawOpen=1, tongueOut=1), weights(eyeWideLeft=1, mouthFunnel=1)):
        picture = renderer.render(pose(rig, values, [0.2, -0.4, 0.1, 0, 0, 0]))
        face = picture[20:70, 55:105]
        assert 60 < face.mean() < 200
        assert (picture == 255).all(axis=2).mean() < 0.005
    assert (portrait[20:70, 60:100].astype(int)[..., 0] - portrait[20:70, 60:100, 2]).mean() > 10  # skin is warm


@pytest.mark.parametrize("bad", [np.zeros((10, 3)), np.full((6202, 3), np.nan)])
def test_bad_vertices_are_refused(renderer, bad):
    with pytest.raises(FacesynthError):
        renderer.render(bad)


@pytest.mark.parametrize("size", [(0, 10), (100000, 90), (1, 2, 3)])
def test_bad_sizes_are_refused(rig, size):
    with pytest.raises(FacesynthError):
        Renderer.of(rig, size)


def test_odd_sizes_are_drawn_to_the_last_pixel(rig):
    picture = Renderer.of(rig, (101, 67)).render(rig.rest_mm)
    assert picture.shape == (67, 101, 3)
    assert picture[-1, -1].max() > 5


def test_baked_arrays_fit_together(rig):
    baked = baked_head(rig)
    surface, strands = baked.surface, baked.strands
    assert surface.quads.max() < len(surface.rest)
    assert len(surface.texture) == (surface.material == 0).sum()
    assert (surface.material[: len(surface.texture)] == 0).all()
    np.testing.assert_allclose(np.asarray(strands.binding.sum(axis=1)), 1, atol=1e-4)
    assert strands.segments.max() < len(strands.lift_mm)
    assert np.isfinite(strands.colour).all()
    assert np.isfinite(strands.lift_mm).all()
    assert ((surface.occlusion >= 0) & (surface.occlusion <= 1.001)).all()


def test_lashes_move_down_with_the_lid(rig):
    baked = baked_head(rig)
    shut = baked.refine @ pose(rig, weights(eyeBlinkLeft=1, eyeBlinkRight=1))
    lashes = baked.strands.raised_mm > 0
    fall = (baked.strands.binding @ (shut - baked.surface.rest))[lashes, 1]
    assert fall.min() < -8


def test_a_point_on_a_plane_sees_all_of_its_sky_and_one_in_a_pit_little():
    x, y = np.meshgrid(np.linspace(-50, 50, 21), np.linspace(-50, 50, 21), indexing="ij")
    flat = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    quads = np.stack([corner, corner + 21, corner + 22, corner + 1], 1).astype(np.int32)
    up = np.tile(np.array([0, 0, 1], np.float32), (len(flat), 1))
    assert sky_visibility(flat, up, quads, 64).min() > 0.95
    pit = flat + np.array([0, 0, 1], np.float32) * (0.03 * (x**2 + y**2).reshape(-1, 1)).astype(np.float32)
    assert sky_visibility(pit, up, quads, 64)[10 * 21 + 10] < 0.5


def test_directions_of_the_sky_are_even():
    directions = sky_directions(200)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert np.abs(directions.mean(axis=0)).max() < 0.01
