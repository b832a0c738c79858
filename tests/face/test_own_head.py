import shutil

import numpy as np
import pytest
from own_heads import MAPPING, SHAPES, mask, write_mask, write_obj
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.draw.render import Renderer
from facesynth.face.files.formats import write_animation
from facesynth.face.rig.channel_map import on_channels
from facesynth.face.rig.own_head import load_own_head
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES


def animation(count=6):
    weights = np.zeros((count, 52))
    weights[:, ARKIT_NAMES.index("jawOpen")] = np.linspace(0, 0.6, count)
    weights[:, ARKIT_NAMES.index("mouthSmileLeft")] = np.linspace(1, 0, count)
    head = np.zeros((count, 6))
    head[:, 1], head[:, 4] = np.linspace(0, 0.3, count), np.linspace(0, 5, count)
    gaze = np.stack([np.linspace(0, 0.2, count), np.zeros(count)], axis=1)
    return FaceAnimation(ARKIT_NAMES, weights, head, gaze, np.zeros(count), 30)


@pytest.fixture
def head(tmp_path):
    path = write_mask(tmp_path / "mask.glb")
    path.with_suffix(".yaml").write_text(MAPPING, encoding="utf-8")
    return load_own_head(path)


def test_a_glb_in_centimetres_comes_in_millimetres_with_its_own_names(head):
    vertices, triangles, shapes = mask()
    assert head.names == SHAPES
    assert head.mm_per_unit == 1000
    np.testing.assert_allclose(np.ptp(head.rest_mm[: len(vertices)], axis=0), 10 * np.ptp(vertices, axis=0), atol=1e-3)
    np.testing.assert_allclose(head.shapes_mm[0, : len(vertices)], 10 * shapes[0], atol=1e-3)
    assert np.array_equal(head.triangles[: len(triangles)], triangles)
    np.testing.assert_allclose(head.colours[0, 0, 0], [0.5, 0.3, 0.2], atol=1e-6)
    ((ball, centre),) = head.eyes
    assert centre[0] == pytest.approx(30, abs=0.1)
    assert len(ball) == 4


def test_the_head_turns_and_so_does_the_eye_in_it(head):
    posed = head.posed(np.zeros(5), [0, np.pi / 2, 0, 0, 0, 0])
    turned = Rotation.from_rotvec([0, np.pi / 2, 0]).apply(head.rest_mm - head.pivot_mm) + head.pivot_mm
    np.testing.assert_allclose(posed, turned, atol=1e-3)
    looking = head.posed(np.zeros(5), None, [0.3, 0.0])
    moved = np.abs(looking - head.rest_mm).max(axis=1) > 1e-6
    assert moved.sum() > 0
    assert set(np.flatnonzero(moved)) <= set(head.eyes[0][0])


def test_any_unit_and_any_placement_of_nodes_gives_the_same_head(head, tmp_path):
    turn = Rotation.from_rotvec([0, 0, 0]).as_matrix() * 7.0
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, [5, 160, -3]
    other = write_mask(tmp_path / "far.glb", node={"matrix": matrix.T.ravel().tolist()})
    shutil.copy(tmp_path / "mask.yaml", tmp_path / "far.yaml")
    far = load_own_head(other)
    ratio = np.ptp(far.rest_mm, axis=0) / np.ptp(head.rest_mm, axis=0)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-4)
    assert 140 < np.ptp(far.face_mm[:, 1]) < 160, "a unit that nobody stated is read off the face"


def test_what_is_written_is_the_same_head_with_the_animation(head, tmp_path):
    own = on_channels(animation(), head.map)
    write_animation(tmp_path / "out.glb", own, head)
    shutil.copy(tmp_path / "mask.yaml", tmp_path / "out.yaml")
    again = load_own_head(tmp_path / "out.glb")
    np.testing.assert_allclose(again.rest_mm, head.rest_mm, atol=1e-3)
    from gltf_reading import played

    for k in (0, 5):
        there = played(tmp_path / "out.glb", k) * head.mm_per_unit - head.middle * head.mm_per_unit
        np.testing.assert_allclose(there, head.posed(own.weights[k], own.head[k], own.gaze[k]), atol=0.05)


def test_curves_and_arrays_of_a_head(head, tmp_path):
    own = on_channels(animation(), head.map)
    write_animation(tmp_path / "out.csv", own, head)
    table = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    assert table.dtype.names == ("time_s", *SHAPES)
    np.testing.assert_allclose(table["Mouth_Open"], np.clip(np.linspace(0, 0.6, 6) * 0.5 + 0.1, 0, 0.4), atol=1e-7)
    write_animation(tmp_path / "out.npz", own, head)
    with np.load(tmp_path / "out.npz") as stored:
        np.testing.assert_allclose(stored["weights"], own.weights, atol=1e-6)
    with pytest.raises(FacesynthError, match="unknown animation file type"):
        write_animation(tmp_path / "out.fbx", own, head)


def test_a_folder_of_obj_files_is_a_head(head, tmp_path):
    vertices, triangles, shapes = mask()
    folder = tmp_path / "objs"
    folder.mkdir()
    write_obj(folder / "Mask_Neutral.obj", vertices, triangles)
    for name, shape in zip(("jawOpen", "mouthSmile_L"), shapes, strict=False):
        write_obj(folder / f"{name}.obj", vertices + shape, triangles)
    own = load_own_head(folder)
    assert own.names == ("jawOpen", "mouthSmile_L")
    height = np.ptp(own.face_mm[:, 1])
    assert height == pytest.approx(150)
    shown = on_channels(animation(), own.map)
    write_animation(tmp_path / "out.glb", shown, own)
    from gltf_reading import played

    there = played(tmp_path / "out.glb", 5) * 1000
    np.testing.assert_allclose(there, own.posed(shown.weights[5], shown.head[5]), atol=0.01)
    write_obj(folder / "brow.obj", vertices[:-1], triangles[:4])
    with pytest.raises(FacesynthError, match=r"brow\.obj has 168 vertices"):
        load_own_head(folder)


def test_pictures_show_the_mouth_open(head):
    renderer = Renderer.of(head, (96, 96))
    shut, wide = (renderer.render(head.posed([value, 0, 0, 0, 0])) for value in (0.0, 1.0))
    assert shut.shape == (96, 96, 3)
    assert np.abs(shut.astype(int) - wide).max() > 30
    middle = shut[48, 48].astype(int)
    assert middle[0] > middle[2] + 20, "the skin has the file's own colour"
    with pytest.raises(FacesynthError, match="vertices must be finite"):
        renderer.render(np.zeros((3, 3)))


def test_own_curves_need_no_detour(head):
    own = FaceAnimation(SHAPES, np.full((2, 5), 0.25), np.zeros((2, 6)), np.zeros((2, 2)), np.zeros(2), 30)
    assert on_channels(own, head.map).names == SHAPES
    np.testing.assert_allclose(on_channels(own, head.map).weights, 0.25)
    strange = FaceAnimation(("a",), np.zeros((2, 1)), np.zeros((2, 6)), np.zeros((2, 2)), np.zeros(2), 30)
    with pytest.raises(FacesynthError, match="neither this head's nor ARKit's"):
        on_channels(strange, head.map)


def test_a_head_without_mapping_says_what_to_give(tmp_path):
    with pytest.raises(FacesynthError, match="give a mapping file"):
        load_own_head(write_mask(tmp_path / "a.glb", names=("One", "Two", "Three", "Four", "Five")))
    with pytest.raises(FacesynthError, match="is no head"):
        load_own_head(tmp_path / "a.fbx")
    assert load_own_head(write_mask(tmp_path / "b.glb", names=("jawOpen", "eyeBlink_L"))).map.idle == ()


@pytest.mark.parametrize("trials", [30, pytest.param(500, marks=pytest.mark.slow)])
def test_damaged_heads_are_one_clear_error(tmp_path, trials):
    whole = write_mask(tmp_path / "whole.glb", names=("jawOpen", "mouthSmileLeft", "mouthSmileRight", "a", "b")).read_bytes()
    rng = np.random.default_rng(3)
    refused = 0
    for trial in range(trials):
        part = bytearray(whole[: rng.integers(0, len(whole))] if trial % 3 == 0 else whole)
        for place in rng.integers(0, max(len(part), 1), rng.integers(1, 20)) if part else ():
            part[place if trial % 2 else place % 3000 % len(part)] = rng.integers(256)
        (tmp_path / "hurt.glb").write_bytes(bytes(part))
        try:
            with np.errstate(all="ignore"):
                load_own_head(tmp_path / "hurt.glb")
        except FacesynthError:
            refused += 1
    assert refused > trials / 4


@pytest.mark.parametrize("trials", [20, pytest.param(500, marks=pytest.mark.slow)])
def test_damaged_obj_sets_are_one_clear_error(tmp_path, trials):
    vertices, triangles, shapes = mask()
    names = ("neutral", "jawOpen", "mouthSmileLeft")
    folder = tmp_path / "objs"
    folder.mkdir()
    for name, shape in zip(names, (np.zeros_like(vertices), *shapes), strict=False):
        write_obj(folder / f"{name}.obj", vertices + shape, triangles)
    whole = {name: (folder / f"{name}.obj").read_bytes() for name in names}
    rng = np.random.default_rng(4)
    refused = 0
    for trial in range(trials):
        name = names[trial % 3]
        content = bytearray(whole[name][: rng.integers(0, len(whole[name]))] if trial % 2 else whole[name])
        for place in rng.integers(0, max(len(content), 1), rng.integers(1, 20)) if content else ():
            content[place] = rng.integers(256)
        (folder / f"{name}.obj").write_bytes(bytes(content))
        try:
            with np.errstate(all="ignore"):
                own = load_own_head(folder)
            assert np.isfinite(own.rest_mm).all()
        except FacesynthError as error:
            refused += 1
            assert "\n" not in str(error)
            assert len(str(error)) < 400
        (folder / f"{name}.obj").write_bytes(whole[name])
    assert refused > trials / 4
    assert load_own_head(folder).names == names[1:]
