"""Which components are taken for emotion, on takes whose components are made by rule."""

import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.mapping import MapSettings, fit_emotion_map, matched
from facesynth.methods.anime_graph.parallel import Take, emotion_pairs
from facesynth.methods.anime_graph.split import split_components

LAYOUT = tiny_layout()


def components(turn=None):
    """Two of the lips, two of the brows; `turn` [4, 4] mixes them."""
    rng = np.random.default_rng(0)
    columns = [LAYOUT.columns(group) for group in ("mouth", "brows")]
    mixing = np.zeros((LAYOUT.channels, 4))
    for k in range(4):
        mixing[columns[k // 2], k] = rng.normal(size=len(columns[k // 2]))
    made = FaceComponents()
    made.keep(np.array(LAYOUT.neutral), mixing if turn is None else mixing @ turn, np.array([0, 0, 1, 1]))
    return made


def takes_of(made, lift, seed=0):
    """Ten sentences, two takes, neutral and happy: the words move the first two, and happy lifts the last two."""
    rng = np.random.default_rng(seed)
    plain, takes = components(), []
    for sentence in range(10):
        words = np.cumsum(rng.normal(size=(60, 2)), axis=0)
        words -= words.mean(axis=0)
        for emotion in ("neutral", "happy"):
            for take in (1, 2):
                felt = lift * (emotion == "happy") + 0.3 * rng.normal(size=2)
                u = np.hstack([words, np.tile(felt, (60, 1))]) + 0.1 * rng.normal(size=(60, 4))
                frames = plain.decode_array(u).astype(np.float32)
                takes.append(Take(f"s{sentence}", emotion, take, frames, made.encode_array(frames), 60))
    return takes


def turned():
    return np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))[0]


def test_what_emotions_change_is_found_and_said():
    made = components()
    split = split_components(takes_of(made, 4.0), made, LAYOUT, None, seed=0)
    assert split.emotional.tolist() == [2, 3]
    assert not split.mixed
    assert split.held > 0.9
    assert (split.discovery[[2, 3]] < 0.05).all()
    assert "2 of them (2, 3) are emotional" in split.summary()


def test_where_speech_and_emotion_are_mixed_all_components_are_mapped():
    made = components(turned())
    takes = takes_of(made, 4.0)
    split = split_components(takes, made, LAYOUT, None, seed=0)
    assert split.mixed
    assert split.emotional.tolist() == [0, 1, 2, 3]
    assert "mixed" in split.summary()
    known = [pair for pair in emotion_pairs(takes, "neutral", "happy") if pair[0].sentence != "s0"]
    found = fit_emotion_map(matched(known, split), split, MapSettings(), made.mixing.numpy())
    lifted = np.linalg.solve(turned(), np.array([0, 0, 4.0, 4.0]))
    np.testing.assert_allclose(found.shift, lifted, atol=0.6)


def test_without_a_change_nothing_is_found():
    made = components()
    split = split_components(takes_of(made, 0.0), made, LAYOUT, None, seed=0)
    assert not len(split.emotional)
    assert not split.mixed
    assert "there is nothing to map" in split.summary()


@pytest.mark.parametrize("lift", [0.0, 4.0])
def test_a_person_has_the_last_word(lift):
    made = components()
    split = split_components(takes_of(made, lift), made, LAYOUT, [1], seed=0)
    assert split.emotional.tolist() == [1]
    assert not split.mixed
