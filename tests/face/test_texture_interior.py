"""Teeth between the lips of a synthetic face whose every pixel is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from facesynth.face.texture.compose import Report, TexturedFace
from facesynth.face.texture.interior import Interior, Sources, jaw_maps
from facesynth.face.texture.lips import Lips, facing, meeting
from facesynth.face.texture.speaker import Speaker, lower_face_window
from facesynth.motion.planar import HeadMaps

HEIGHT, WIDTH, MIDDLE = 100, 130, 50.0
SKIN = 90.0
ACROSS = np.linspace(45, 85, 9)
OUTLINE = np.arange(16)
"""Nine points of the upper lip with both corners, then seven of the lower one, back."""
JAW = np.arange(16, 20)


def shape(opening):
    """[22, 2] the inner lips, the jaw, and two points of the cheeks, of a mouth that is open so far (px); the jaw does it."""
    bow = 1 - ((ACROSS - 65) / 20) ** 2
    upper = np.column_stack([ACROSS, MIDDLE - 1.0 * bow])
    lower = np.column_stack([ACROSS, MIDDLE + 1.0 * bow + opening * bow])[-2:0:-1]
    jaw = np.array([[50.0, 80], [60, 83], [70, 83], [80, 80]]) + np.array([0, opening])
    return np.concatenate([upper, lower, jaw, [[35.0, 55], [95, 55]]])


def upper_teeth(x, y):
    return 150 + 40 * np.sin(x) * np.cos(0.4 * y)


def lower_teeth(x, y):
    return 120 + 40 * np.cos(0.8 * x + 0.3 * y)


def picture(opening):
    """[H, W, 3] skin; between the lips upper teeth that stand, and lower teeth that go with the jaw, meeting in the middle."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    depth, down = Lips.of(shape(opening)[None], OUTLINE).between(0, np.stack([x, y], axis=-1))
    teeth = np.where(down < 0.5, upper_teeth(x, y), lower_teeth(x, y - opening))
    return np.repeat(np.where(depth > 0, teeth, SKIN)[..., None], 3, axis=-1).round().astype(np.uint8)


@pytest.fixture(scope="module")
def speaker():
    openings = 9 + 7 * np.sin(np.arange(80) * 0.37)
    shapes = np.stack([shape(opening) for opening in openings])
    pictures = np.stack([picture(opening) for opening in openings])
    linear, shift = np.tile(np.eye(2), (80, 1, 1)), np.zeros((80, 2))
    left, top, right, bottom = lower_face_window(shapes, HeadMaps(linear, shift), HEIGHT, WIDTH)
    cut = pictures[:, top:bottom, left:right]
    behind, starts = pictures[:4], np.arange(80) % 40 == 0
    corner = np.array([left, top])
    return Speaker(cut, corner, shapes, linear, shift, starts, behind, linear[:4], shift[:4], 25.0, OUTLINE, JAW)


def drawn_mouth(speaker, openings, head=None):
    """[T, H, W] a plain skin with the interior of shapes, on a head that may be moved."""
    shapes = np.stack([shape(opening) for opening in openings])
    head = head or HeadMaps(np.tile(np.eye(2), (len(shapes), 1, 1)), np.zeros((len(shapes), 2)))
    skin = torch.full((len(shapes), 3, HEIGHT, WIDTH), SKIN)
    return Interior(speaker).over(skin, (0, 0), head, shapes).numpy()[:, 0]


OPENINGS = (8.3, 11.2, 13.7)


def test_upper_teeth_stand_while_the_mouth_opens(speaker):
    x, y = np.meshgrid(np.arange(58, 73), [52, 53])
    for drawn in drawn_mouth(speaker, OPENINGS):
        assert np.abs(drawn[52:54, 58:73] - upper_teeth(x, y)).max() < 4


def test_lower_teeth_go_with_the_jaw_and_are_not_stretched(speaker):
    x, y = np.meshgrid(np.arange(60, 71), [47.0])
    for drawn, opening in zip(drawn_mouth(speaker, OPENINGS), OPENINGS, strict=True):
        rows = y + round(opening)
        found = drawn[47 + round(opening), 60:71]
        assert np.abs(found - lower_teeth(x, rows - opening)).max() < 4


def test_they_move_with_the_head(speaker):
    turned, shift = np.array([[[0.0, 1.0], [-1.0, 0.0]]]), np.array([[110.0, -10.0]])  # (x, y) -> (110 - y, x - 10)
    plain = drawn_mouth(speaker, OPENINGS[:1])[0]
    moved = drawn_mouth(speaker, OPENINGS[:1], HeadMaps(turned, shift))[0]
    np.testing.assert_allclose(moved[48:63, 51:59], plain[52:60, 58:73].T[:, ::-1], atol=2.0)


def test_nothing_appears_from_one_moment_to_the_next(speaker):
    """A hundred times smaller a step of the shape makes a much smaller step of the picture: none comes in at once."""
    coarse = drawn_mouth(speaker, [10.0, 11.0])
    fine = drawn_mouth(speaker, np.linspace(10.0, 11.0, 101))
    largest = np.abs(np.diff(fine, axis=0)).max()
    assert largest < 0.1 * np.abs(np.diff(coarse, axis=0)).max()


def test_shut_lips_show_no_interior(speaker):
    assert np.array_equal(drawn_mouth(speaker, [-2.0])[0], np.full((HEIGHT, WIDTH), SKIN, np.float32))


RED = 1.5
"""px that the points of a lip lie on its red, from where it ends."""


def on_the_red(shapes):
    """[T, 22, 2] the shapes as a face mesh sees them: 3 px apart where lips touch."""
    seen = shapes.copy()
    seen[:, 1:8, 1] -= RED
    seen[:, 9:16, 1] += RED
    return seen


def as_a_mesh_sees(speaker):
    return replace(speaker, shapes=on_the_red(speaker.shapes), shut=np.full(7, 2 * RED))


def test_points_on_the_red_meet_where_lips_do():
    truth = np.stack([shape(opening) for opening in (2.0, 9.0, 16.0)])
    shut, usual = np.full(7, 2 * RED), np.full(7, 8.0)
    np.testing.assert_allclose(meeting(on_the_red(truth), OUTLINE, shut, usual), truth, atol=1e-9)
    upper, lower = facing(OUTLINE)
    met = meeting(on_the_red(shape(-2.0)[None]), OUTLINE, shut, usual)
    np.testing.assert_allclose(met[:, lower, 1] - met[:, upper, 1], 0.32)  # a little is left


def test_shut_lips_hide_what_an_open_picture_shows(speaker):
    """No picture of the speaker is anywhere near it: where it is known how lips meet, a wide open one is warped shut."""
    target, background = on_the_red(shape(-2.0)[None]), np.array([0])
    wide = np.flatnonzero(speaker.shapes[:, 12, 1] - speaker.shapes[:, 4, 1] > 9)
    names = ("pictures", "shapes", "linear", "shift", "clip_starts")
    known = as_a_mesh_sees(replace(speaker, **{name: getattr(speaker, name)[wide] for name in names}))
    holes = []
    for some in (known, replace(known, shut=np.zeros(0))):
        drawn = next(TexturedFace(some).draw(target, background, Report())).astype(float)[..., 0]
        holes.append((np.abs(drawn[40:62, 44:87] - SKIN) > 12).sum(axis=0)[2:-2].mean())
    assert holes[0] < 0.8  # px high, on average: the line between the lips
    assert holes[1] > 1.2


def test_shut_lips_are_taken_from_pictures_of_shut_lips(speaker):
    """Though a picture of open lips has cheeks and jaw where they are wanted."""
    shapes = on_the_red(np.stack([shape(-2.0), shape(0.0), shape(6.0)]))
    shapes[0, 16:] += 16.0
    starts = np.array([True, False, False])
    few = replace(speaker, pictures=speaker.pictures[:3], shapes=shapes, clip_starts=starts, linear=speaker.linear[:3])
    known = replace(few, shift=speaker.shift[:3], shut=np.full(7, 2 * RED))
    wanted = on_the_red(shape(-2.0)[None])
    assert TexturedFace(known).choose(wanted, "nearest")[0] == 0
    assert TexturedFace(replace(known, shut=np.zeros(0))).choose(wanted, "nearest")[0] == 1


def test_pressed_lips_are_for_a_moment_and_resting_ones_for_longer(speaker):
    """A mesh sees no difference between them."""
    names = ("pictures", "linear", "shift")
    few = replace(speaker, **{name: getattr(speaker, name)[:3] for name in names}, clip_starts=np.array([True, False, False]))
    shapes = on_the_red(np.stack([shape(opening) for opening in (-2.0, -2.0, 6.0)]))
    face = TexturedFace(replace(few, shapes=shapes, shut=np.full(7, 2 * RED), pressed=np.array([False, True, False])))
    assert face.choose(shapes[[2, 0, 0, 2]], "nearest").tolist() == [2, 1, 1, 2]
    assert face.choose(shapes[[2, *[0] * 12, 2]], "nearest").tolist() == [2, *[0] * 12, 2]


def test_nothing_of_an_open_mouth_fades_over_shut_lips(speaker):
    """A closure takes two pictures: one of before that fades within them, warped shut, would be a slit."""
    known, background = as_a_mesh_sees(speaker), np.zeros(4, int)
    wanted = on_the_red(np.stack([shape(opening) for opening in (15.0, 15.0, -2.0, 9.0)]))
    hard, soft = (
        np.stack(list(TexturedFace(known, fade_s=fade_s).draw(wanted, background, Report(), "nearest"))).astype(float)
        for fade_s in (0.0, 0.12)
    )
    faded = np.abs(hard - soft).max(axis=(1, 2, 3))
    assert faded[2] < 0.3 * faded[3]


def test_the_face_draws_it_and_a_speaker_without_lips_does_not(speaker):
    plain = replace(speaker, inner_lips=np.zeros(0, np.int64), jaw=np.zeros(0, np.int64))
    shapes, background = np.stack([shape(11.2)]), np.array([0])
    here, there = (next(TexturedFace(some).draw(shapes, background, Report())).astype(float) for some in (speaker, plain))
    x, y = np.meshgrid(np.arange(58, 73), [52, 53])
    errors = [np.abs(drawn[52:54, 58:73, 0] - upper_teeth(x, y)).mean() for drawn in (here, there)]
    assert errors[0] < 8
    assert not plain.knows_lips


def test_the_jaw_is_rigid():
    rng = np.random.default_rng(0)
    rest, angle = rng.normal(scale=20, size=(5, 2)), 0.2
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    found = jaw_maps(np.stack([rest @ turn + [3, 7], 1.5 * rest]), rest)
    np.testing.assert_allclose(found.linear[0], turn, atol=1e-12)
    np.testing.assert_allclose(found.shift[0], [3, 7], atol=1e-9)
    np.testing.assert_allclose(found.linear[1] @ found.linear[1].T, np.eye(2), atol=1e-12)


def test_a_speaker_keeps_its_lips(speaker, tmp_path):
    speaker.save(tmp_path / "speaker.npz")
    back = Speaker.load(tmp_path / "speaker.npz")
    assert back.knows_lips
    assert np.array_equal(back.inner_lips, OUTLINE)
    assert np.array_equal(back.jaw, JAW)


def test_the_interior_is_that_of_the_pictures_drawn_from_and_fades_between_them(speaker):
    """Two pictures of one shape, in one of which the teeth are dark: which is seen is said by the sources, half and half too."""
    dark, same = speaker.pictures.copy(), speaker.shapes.copy()
    dark[47], same[47] = 30, same[7]
    interior = Interior(replace(speaker, pictures=dark, shapes=same))
    shapes = np.repeat(speaker.shapes[7][None], 3, axis=0)
    sources = Sources(np.array([7, 47, 47]), np.array([7, 47, 7]), np.array([0.0, 0.0, 0.5]))
    head = HeadMaps(np.tile(np.eye(2), (3, 1, 1)), np.zeros((3, 2)))
    skin = torch.full((3, 3, HEIGHT, WIDTH), SKIN)
    light, black, half = interior.over(skin, (0, 0), head, shapes, sources).numpy()[:, 0, 52:54, 58:73]
    assert light.mean() > black.mean() + 40
    np.testing.assert_allclose(half, (light + black) / 2, atol=0.05 * (light.mean() - black.mean()) + 1)
