"""Heads of other makers: VRM avatars, names wherever they stand, textures and triangles of other kinds, presets."""

import json

import numpy as np
import pygltflib as gl
import pytest
from bringing import lay_down, run
from grids import PHONES, long_grid, put
from heads import (
    TALKING,
    as_strips,
    compressed,
    halves,
    head,
    in_another_scene,
    mirrored,
    names_in_accessors,
    names_in_node,
    names_in_primitive,
    names_in_targets,
    outside,
    teeth_on_a_jaw,
    textured,
    vrm0,
    vrm0_mixing,
    vrm1,
    vrm1_mixing,
)

from facesynth.face.rig.channel_map import arkit_name
from facesynth.face.rig.own_head import load_own_head
from facesynth.face.rig.presets import PRESETS, fitting, preset
from facesynth.inference.errors import FacesynthError

OPENING = slice(10, 25)
"""Frames of the first vowel, aa."""


@pytest.fixture
def said(tmp_path, talker):
    """A function that lets a head say "op a": its channels by name, and what was told."""
    sound = lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), long_grid([("phones", PHONES)]))

    def say(path, *options, output="out.npz"):
        out = tmp_path / output
        code, printed, errors = run("speak", talker, sound, "-o", out, "--fps", 50, "--rig", path, "--json", *options)
        assert code == 0, errors
        told = json.loads(printed)["remarks"]
        if out.suffix != ".npz":
            return out, told
        with np.load(out) as stored:
            return dict(zip(map(str, stored["names"]), stored["weights"].T, strict=True)), told

    return say


@pytest.mark.parametrize("place", [names_in_primitive, names_in_node, names_in_targets, names_in_accessors])
def test_names_wherever_they_stand(tmp_path, said, place):
    channels, _ = said(head(tmp_path / "head.glb", place))
    assert channels["jawOpen"][OPENING].max() > 0.5


def test_avatars_by_their_first_bytes(tmp_path, said):
    older, newer = head(tmp_path / "old.vrm", vrm0), head(tmp_path / "new.vrm", vrm1)
    for path, opening, chosen in ((older, "a", "vrm0"), (newer, "aa", "vrm1")):
        channels, told = said(path)
        assert channels[opening][OPENING].max() > 0.5
        assert any(f"follow the preset {chosen}" in line for line in told)
    for odd in ("binary.gltf", "downloaded.bin", "no_suffix"):
        assert load_own_head(head(tmp_path / odd)).names == TALKING


@pytest.mark.parametrize(("kind", "chosen"), [(vrm0_mixing, "vrm0"), (vrm1_mixing, "vrm1")])
def test_expressions_that_mix_shapes_drive_them_by_their_shares(tmp_path, said, kind, chosen):
    channels, told = said(head(tmp_path / "mixing.vrm", kind))
    down, wide, around, *_ = channels.values()
    assert down[OPENING].max() > 0.3
    assert wide.max() <= 0.3 + 1e-6
    np.testing.assert_allclose(wide[wide < 0.29], 0.3 / 0.8 * down[wide < 0.29], atol=1e-5)
    assert any(f"4 of its 5 channels follow the preset {chosen} through the avatar's expressions" in line for line in told)
    way = load_own_head(tmp_path / "mixing.vrm").map.channels
    assert way[0].shares["jawOpen"] == pytest.approx(0.8 * 1.4)
    assert dict(way[2].shares) == pytest.approx({"mouthFunnel": 0.9})
    assert around.min() >= 0


def test_a_mirrored_head_is_not_inside_out(tmp_path):
    plain, turned = load_own_head(head(tmp_path / "a.glb")), load_own_head(head(tmp_path / "b.glb", mirrored))

    def facing(own):
        a, b, c = (own.rest_mm[own.triangles[:, k]] for k in range(3))
        return np.cross(b - a, c - a)[:, 2].sum()

    assert facing(turned) == pytest.approx(facing(plain), rel=0.01)


def test_a_head_of_another_scene_is_shown_and_a_compressed_one_is_told_how_to_mend(tmp_path, said):
    channels, _ = said(head(tmp_path / "second.glb", in_another_scene))
    assert channels["jawOpen"].max() > 0.5
    with pytest.raises(FacesynthError, match="compressed .KHR_draco_mesh_compression.; .*gltf-transform"):
        load_own_head(head(tmp_path / "draco.glb", compressed))


def test_pictures_beside_the_file_are_drawn_where_their_transform_puts_them_and_missing_ones_are_told(tmp_path, said):
    skin = tmp_path / "the skin.png"
    plain, moved = head(tmp_path / "a.glb", halves(skin)), head(tmp_path / "b.glb", halves(skin, shift=0.5))
    assert load_own_head(plain).colours[0, 0, 0].argmax() == 0
    assert load_own_head(moved).colours[0, 0, 0].argmax() == 1
    skin.unlink()
    assert any("textures that are missing" in line for line in said(plain)[1])


def test_an_avatar_that_looks_backwards_is_turned_round(tmp_path, said):
    plain, turned = load_own_head(head(tmp_path / "plain.vrm", vrm1)), load_own_head(head(tmp_path / "turned.vrm", vrm0))
    np.testing.assert_allclose(turned.rest_mm, plain.rest_mm, atol=0.01)
    out, _ = said(turned.source, output="out.glb")
    again = load_own_head(out)
    np.testing.assert_allclose(again.rest_mm, turned.rest_mm, atol=0.01)


def test_strips_are_the_same_surface(tmp_path):
    lists, strips = load_own_head(head(tmp_path / "a.glb")), load_own_head(head(tmp_path / "b.glb", as_strips))

    def area_and_facing(own):
        a, b, c = (own.rest_mm[own.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        return np.linalg.norm(normal, axis=1).sum(), normal.sum(axis=0)

    assert len(strips.triangles) == len(lists.triangles)
    for got, wanted in zip(area_and_facing(strips), area_and_facing(lists), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0.02, atol=50)


def test_textures_of_other_kinds(tmp_path, said):
    own = load_own_head(head(tmp_path / "webp.glb", textured("webp")))
    assert own.colours[0, 0, 0, 1] > 10 * own.colours[0, 0, 0, 0], "WebP is drawn"
    path = head(tmp_path / "ktx.glb", textured("ktx2"))
    np.testing.assert_allclose(load_own_head(path).colours[0, 0, 0], [0.5, 0.3, 0.2], atol=1e-6)
    assert any("KTX2" in line for line in said(path)[1])


def test_what_stands_outside_of_the_scene_is_not_drawn(tmp_path, said):
    path = head(tmp_path / "spare.glb", outside)
    assert len(load_own_head(path).rest_mm) == len(load_own_head(head(tmp_path / "plain.glb")).rest_mm)
    assert any("spare stand outside of the scene" in line for line in said(path)[1])


def test_names_twice_move_the_first_and_are_told(tmp_path, said):
    channels, told = said(head(tmp_path / "twice.glb", names=("jawOpen", "jawOpen", "mouthSmileLeft", "browInnerUp", "Frozen")))
    assert channels["jawOpen"].max() > 0.5
    assert channels["jawOpen (2)"].max() == 0
    assert any("several shapes are called jawOpen" in line for line in told)


JAW_MAPPING = """
channels:
  jawOpen: jawOpen
  CC_Base_JawRoot: {from: jawOpen, turn: [20, 0, 0]}
"""


def test_teeth_on_a_jaw_are_told_and_a_mapping_turns_the_joint(tmp_path, said):
    path = head(tmp_path / "teeth.glb", teeth_on_a_jaw)
    assert any("Teeth hang on the joint CC_Base_JawRoot, which no channel turns" in line for line in said(path)[1])
    path.with_suffix(".yaml").write_text(JAW_MAPPING, encoding="utf-8")
    channels, told = said(path)
    assert not any("hang on the joint" in line for line in told)
    np.testing.assert_allclose(channels["CC_Base_JawRoot"], channels["jawOpen"], atol=1e-6)
    own = load_own_head(path)
    values = np.array([float(name == "CC_Base_JawRoot") for name in own.names])
    moved = own.posed(values)[-3:] - own.rest_mm[-3:]
    assert (moved[:, 1] < -20).all(), "teeth go down"
    out, _ = said(path, output="out.glb")
    document = gl.GLTF2().load(str(out))
    turned = {document.nodes[channel.target.node].name for channel in document.animations[-1].channels}
    assert "CC_Base_JawRoot" in turned
    again = load_own_head(out, path.with_suffix(".yaml"))
    np.testing.assert_allclose(again.rest_mm, own.rest_mm, atol=0.01)


@pytest.mark.parametrize("jaw", ["jaw", "J_Bip_C_Jaw", "mandible", "Chin_J", "あご"])
def test_jaws_by_other_names_are_told_as_well(tmp_path, jaw):
    def change(document, data):
        teeth_on_a_jaw(document, data)
        document.nodes[-2].name = jaw

    told = load_own_head(head(tmp_path / "teeth.glb", change)).remarks
    assert any(f"Teeth hang on the joint {jaw}, which no channel turns" in line for line in told)


@pytest.mark.parametrize(
    ("joint", "said_of_it"),
    [("{from: jawOpen, turn: 20}", "turn is degrees"), ("{from: jawOpen, turn: [1, 2, x]}", "must be a number")],
)
def test_joints_that_cannot_be_turned_are_told(tmp_path, joint, said_of_it):
    path = head(tmp_path / "teeth.glb", teeth_on_a_jaw)
    path.with_suffix(".yaml").write_text(f"channels:\n  CC_Base_JawRoot: {joint}\n", encoding="utf-8")
    with pytest.raises(FacesynthError, match=said_of_it):
        load_own_head(path)
    path.with_suffix(".yaml").write_text(JAW_MAPPING.replace("JawRoot", "Jaws"), encoding="utf-8")
    with pytest.raises(FacesynthError, match="CC_Base_JawRoot"):
        load_own_head(path)


@pytest.mark.parametrize(
    ("preset", "names"),
    [
        ("cc4", ("Jaw_Open", "Mouth_Pucker_Up_L", "Mouth_Funnel_Up_R", "Brow_Drop_L", "Mouth_Down_Lower_L")),
        ("cc4", ("V_Open", "V_Explosive", "V_Tight_O", "V_Wide", "V_Dental_Lip")),
        ("facs", ("AU25_r", "AU26_r", "AU12_r", "AU45_c", "AU20_r")),
        ("vrm0", ("Fcl_MTH_A", "Fcl_MTH_U", "Fcl_MTH_O", "Fcl_EYE_Close_L", "Fcl_ALL_Fun")),
        ("vrm1", ("aa", "ih", "ou", "ee", "blinkLeft")),
        ("mmd", ("あ", "う", "お", "ウィンク２右", "まばたき")),
        ("oculus", ("vrc.v_aa", "vrc.v_oh", "vrc.v_ou", "vrc.v_pp", "vrc.blink_left")),
        ("oculus", ("viseme_aa", "viseme_O", "viseme_CH", "viseme_E", "viseme_I")),
        ("readyplayerme", ("mouthOpen", "mouthSmile", "eyesClosed", "eyesLookUp", "other")),
        ("facs", ("AU26", "AU12L", "AU12R", "AU45L", "AU18")),
        ("facs", ("LipsFunnel", "LipsPucker", "AU26", "LipsUpperUp", "BrowsU_C")),
        ("metahuman", ("CTRL_expressions_jawOpen", "CTRL_expressions_mouthFunnelUL", "CTRL_expressions_mouthCornerPullL",
                       "CTRL_expressions_browRaiseInL", "CTRL_expressions_mouthLipsPurseUR")),
        ("cc3", ("Mouth_Open", "Mouth_Pucker", "Mouth_Top_Lip_Up", "Mouth_Bottom_Lip_Down", "Explosive")),
        ("daz", ("Genesis8Male__eCTRLMouthOpen", "Genesis8Male__eCTRLvOW", "Genesis8Male__eCTRLvF", "eCTRLEyesClosedL",
                 "eCTRLvEH")),
        ("daz", ("facs_bs_JawOpen", "facs_bs_MouthPurseUpperLeft", "facs_bs_MouthPurseUpperRight", "facs_bs_MouthFunnelLowerLeft",
                 "facs_bs_MouthFunnelLowerRight")),
        ("meta", ("jawDrop", "lipFunnelerLB", "lipPuckerR", "lipCornerPullerL", "eyesClosedR")),
        ("mixamo", ("Facial_Blends.MouthOpen", "Facial_Blends.MouthNarrow_Left", "Facial_Blends.Smile_Right",
                    "Facial_Blends.Blink_Left", "Facial_Blends.UpperLipUp_Left")),
        ("unified", ("JawOpen", "LipFunnelUpperLeft", "LipPuckerLowerRight", "MouthClosed", "MouthCornerPullLeft")),
        ("sranipal", ("Jaw_Open", "Mouth_Ape_Shape", "Mouth_Pout", "Mouth_Upper_Overturn", "Mouth_Sad_Left")),
        ("preston_blair", ("MouthAI", "MouthO", "MouthMBP", "MouthFV", "MouthL")),
        ("rhubarb", ("mouth_A", "mouth_D", "mouth_E", "mouth_F", "mouth_G")),
    ],
)  # fmt: skip
def test_a_preset_is_chosen_where_it_fits_best_and_told(tmp_path, said, preset, names):
    assert fitting(names)[0] == preset
    path = head(tmp_path / "head.glb", names=names)
    channels, told = said(path)
    assert any(f"follow the preset {preset}" in line for line in told)
    assert max(values[OPENING].max() for values in channels.values()) > 0.5
    asked, told = said(path, "--mapping", preset)
    assert not any("follow the preset" in line for line in told)
    for name in names:
        np.testing.assert_allclose(asked[name], channels[name])


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("A25_Jaw_Open", "jawOpen"), ("A14_Eye_Blink_Left", "eyeBlinkLeft"), ("head_lod0_mesh__jawOpen", "jawOpen"),
        ("jawOpen.001", "jawOpen"), ("eyeBlink.L", "eyeBlinkLeft"), ("eyeBlinkR", "eyeBlinkRight"),
        ("Face:mouthSmile_R", "mouthSmileRight"),
        ("blendShape1.mouthFunnel", "mouthFunnel"), ("MOUTH_PUCKER", "mouthPucker"),
        ("JawOpen_1", "jawOpen"), ("jaw_open_blendshape", "jawOpen"), ("jawOpenBlendShape", "jawOpen"),
        ("eyeBlink_L_2", "eyeBlinkLeft"), ("mouth_smile_right_shape", "mouthSmileRight"),
        ("L_eyeBlink", "eyeBlinkLeft"), ("rightMouthSmile", "mouthSmileRight"), ("left_brow_down", "browDownLeft"),
        ("Head:R_mouthFrown", "mouthFrownRight"), ("headJawOpen", "jawOpen"), ("jawOpen_Teeth", "jawOpen"),
        ("facs_bs_MouthFunnel_div2", "mouthFunnel"), ("browInnerUp_L", "browInnerUp"), ("cheekPuffRight", "cheekPuff"),
        ("jawLeft", "jawLeft"), ("Mouth_Right", "mouthRight"), ("leftover", None),
        ("AU25_r", None), ("Frozen", None), ("mouthOpen", None),
    ],
)  # fmt: skip
def test_names_of_arkit_in_disguise(name, meant):
    assert arkit_name(name) == meant


def test_the_end_of_an_action_unit_is_a_side_only_beside_the_other_side():
    def weights(*names):
        return {name: set(way.shares) for name, way in preset("facs", names).channels.items()}

    both = {"mouthSmileLeft", "mouthSmileRight"}
    assert weights("AU12_r", "AU12_c", "AU26_r") == {"AU12_r": both, "AU12_c": both, "AU26_r": {"jawOpen"}}
    assert weights("AU1", "AU4_L", "AU2R") == {"AU1": {"browInnerUp"}, "AU4_L": {"browDownLeft"}, "AU2R": {"browOuterUpRight"}}
    assert weights("AU12_l", "AU12_r") == {"AU12_l": {"mouthSmileLeft"}, "AU12_r": {"mouthSmileRight"}}
    assert weights("AU12_L", "AU12_R") == {"AU12_L": {"mouthSmileLeft"}, "AU12_R": {"mouthSmileRight"}}


def test_visemes_of_character_creator_do_not_move_a_mouth_that_others_move():
    names = ("Jaw_Open", "Mouth_Close", "Mouth_Funnel_Up_L", "Mouth_Funnel_Up_R", "V_Open", "V_Explosive", "V_Tight_O", "V_Wide")
    assert {name for name in preset("cc4", names).channels if name.startswith("V_")} == {"V_Wide"}


def test_visemes_beside_shapes_that_move_the_same_do_not_move_it_twice():
    for name, channels in (("daz", ("eCTRLMouthOpen", "eCTRLvAA", "eCTRLvOW")), ("cc3", ("Mouth_Open", "Open", "Dental_Lip"))):
        assert channels[1] not in preset(name, channels).channels
        assert channels[2] in preset(name, channels).channels


def test_a_head_with_all_of_arkit_needs_no_preset():
    from facesynth.motion.arkit_names import ARKIT_NAMES

    assert fitting((*ARKIT_NAMES, "viseme_aa", "viseme_O", "viseme_U", "mouthOpen")) == ("", {})
    assert fitting(("one", "two", "three", "four")) == ("", {})
    assert fitting(("LipsFunnel", "LipsPucker", "Wink", "Tongue_Long", "Ears_Back", "Hat"))[0] == "facs"
    assert fitting(("A", "B", "C", "D", "E", "F", "G", "H")) == ("", {})


FACESHIFT = """EyeBlink EyeSquint EyeDown EyeIn EyeOpen EyeOut EyeUp BrowsD BrowsU MouthFrown MouthSmile MouthDimple LipsStretch
CheekSquint"""
SINGLE = """BrowsU_C JawForward JawLeft JawOpen JawRight MouthLeft MouthRight LipsUpperUp LipsLowerDown LipsFunnel LipsPucker
ChinLowerRaise ChinUpperRaise Sneer Puff"""


def test_names_of_another_kind_beside_many_of_arkits_are_driven_too():
    """Heads of FaceScape have 22 names of ARKit's, but no funnel and no pucker by them."""
    names = [f"{name}_{side}" for name in FACESHIFT.split() for side in "LR"] + SINGLE.split()
    assert len({arkit_name(name) for name in names} - {None}) > 15
    chosen, ways = fitting(names)
    assert chosen == "facs"
    assert [name for name in names if not arkit_name(name) and name not in ways] == []
    assert not [name for name in ways if arkit_name(name)], "none moves twice"
    assert [dict(ways[name].shares) for name in ("LipsFunnel", "EyeUp_L")] == [{"mouthFunnel": 1.0}, {"eyeLookUpLeft": 1.0}]


def test_a_preset_that_opens_the_mouth_goes_before_one_that_does_not(tmp_path, said):
    names = ("viseme_PP", "viseme_aa", "viseme_O", "viseme_U", "mouthSmile")
    channels, told = said(head(tmp_path / "head.glb", names=names))
    assert any("follow the preset oculus" in line for line in told)
    assert channels["viseme_aa"][OPENING].max() > 0.5


def test_a_preset_that_there_is_not_is_told_with_those_there_are(tmp_path):
    with pytest.raises(FacesynthError, match="unknown mapping 'cc5'; did you mean cc4"):
        load_own_head(head(tmp_path / "head.glb"), "cc5")


def test_every_preset_says_where_its_names_are_from():
    from importlib import resources

    for name in PRESETS:
        text = resources.files("facesynth.face.rig").joinpath("presets", f"{name}.yaml").read_text(encoding="utf-8")
        assert "# Names from: https://" in text
        assert "jawOpen" in text


def test_points_that_lie_beyond_any_head_are_refused(tmp_path):
    def far(document, _data):
        document.nodes[-1].translation = [0.0, 1e30, 0.0]

    with pytest.raises(FacesynthError, match=r"has points more than 10 km from its face"):
        load_own_head(head(tmp_path / "a.glb", far))
