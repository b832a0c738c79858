import numpy as np
import pytest
from own_heads import MAPPING, SHAPES

from facesynth.face.rig.channel_map import Channel, ChannelMap, arkit_name
from facesynth.face.rig.mapping_file import read_mapping
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES


def weights(**values):
    found = np.zeros((1, 52))
    for name, value in values.items():
        found[0, ARKIT_NAMES.index(name)] = value
    return found


@pytest.fixture
def channel_map(tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text(MAPPING, encoding="utf-8")
    return ChannelMap.of(SHAPES, read_mapping(path).channels)


def test_gain_offset_limit_share_and_mute(channel_map):
    own = channel_map.own(weights(jawOpen=0.4, mouthSmileRight=0.4, cheekSquintRight=0.8, browInnerUp=1.0))
    np.testing.assert_allclose(own, [[0.3, 0.0, 0.5, 0.0, 0.0]], atol=1e-9)
    assert channel_map.own(weights(jawOpen=1.0))[0, 0] == pytest.approx(0.4), "the limit holds"
    assert channel_map.own(weights())[0, 0] == pytest.approx(0.1), "the offset holds at rest"


def test_own_curves_become_arkit_weights_again(channel_map):
    asked = weights(jawOpen=0.5, mouthSmileLeft=0.7, eyeBlinkLeft=0.6, eyeBlinkRight=0.6, browInnerUp=0.9)
    found = channel_map.arkit(channel_map.own(asked))
    back = weights(jawOpen=0.5, mouthSmileLeft=0.7, eyeBlinkLeft=0.6, eyeBlinkRight=0.6)
    np.testing.assert_allclose(found, back, atol=1e-3)


def test_arkit_names_need_no_mapping():
    channel_map = ChannelMap.of(ARKIT_NAMES[::-1])
    asked = np.random.default_rng(0).random((5, 52))
    np.testing.assert_allclose(channel_map.own(asked), asked[:, ::-1])
    np.testing.assert_allclose(channel_map.arkit(asked[:, ::-1]), asked, atol=1e-5)
    assert arkit_name("head.JawOpen") == "jawOpen"
    assert arkit_name("eyeBlink_L") == "eyeBlinkLeft"
    assert arkit_name("mouth_smile_right") == "mouthSmileRight"
    assert arkit_name("Viseme_AA") is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("channels: [a]", "is no mapping"),
        ("- x", "is no mapping"),
        ("channels: {A: jawOpn}", "did you mean jawOpen"),
        ("channels: {A: {from: jawOpen, gian: 2}}", "did you mean gain"),
        ("channels: {A: {from: jawOpen, gain: much}}", "gain must be a number; got 'much'"),
        ("channels: {A: {from: jawOpen, limit: [1, 0]}}", "lower limit 1 is above"),
        ("channels: {A: {from: jawOpen, limit: 1}}", r"limit is \[low, high\]"),
        ("channels: {A: {from: [jawOpen]}}", "ARKit name or names with shares"),
        ("channels: {A: 3}", "wanted an ARKit name"),
        ("channels: {A: jawOpen}\nmm_per_unit: 0", "must be positive"),
        ("channels: {A: jawOpen}\nheads: x", "did you mean head"),
        ("channels: {A: jawOpen", "cannot be read as YAML"),
    ],
)
def test_a_mapping_that_is_wrong_says_where(tmp_path, text, message):
    path = tmp_path / "map.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FacesynthError, match=message):
        read_mapping(path)


def test_channels_that_do_not_exist_or_mean_nothing():
    with pytest.raises(FacesynthError, match="did you mean Smile_L"):
        ChannelMap.of(SHAPES, {"Smile_LL": Channel({"jawOpen": 1.0})})
    with pytest.raises(FacesynthError, match="give a mapping file"):
        ChannelMap.of(("A", "B"))
