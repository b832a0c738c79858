from itertools import pairwise

import numpy as np
import pytest

from facesynth.inference.coarticulation.blending import (
    SETTLE_S,
    WAKE_S,
    KeyShapes,
    WeightModels,
    anchors_of,
    blend_key_shapes,
    blend_share,
    blended,
    cover,
)
from facesynth.inference.speech import PhoneTrack

CLASSES = 4
LINEAR = np.array([[1.0, -1.0], [0.0, 1.0]])
HALVES = np.array([[1.0, -1.0], [0.5, 0.0], [0.0, 1.0]])
"""Weights of a triphone that are told from a diphone's everywhere."""


def models(*triples):
    keys = np.array(sorted(triples), np.int64).reshape(-1, 3)
    return WeightModels(np.tile(LINEAR, (CLASSES, CLASSES, 1, 1)), keys, np.tile(HALVES, (len(keys), 1, 1)))


def track(*pairs):
    return PhoneTrack(tuple(label for label, _ in pairs), np.cumsum([length for _, length in pairs]))


@pytest.mark.parametrize("seed", range(20))
def test_every_interval_is_covered_once_and_twice_only_between_two_triphones(seed):
    rng = np.random.default_rng(seed)
    classes = rng.integers(0, 2, rng.integers(2, 15))
    known = [tuple(triple) for triple in rng.integers(0, 2, (int(rng.integers(0, 7)), 3)).tolist()]
    spans = cover(classes, models(*set(known)))
    times = np.zeros(len(classes) - 1, int)
    for span in spans:
        times[span.first : span.last] += 1
    shared = {b.first for a, b in pairwise(spans) if a.last > b.first}
    assert set(np.flatnonzero(times == 2)) == shared
    assert all(a.triphone >= 0 and b.triphone >= 0 for a, b in pairwise(spans) if b.first in shared)
    assert times.min() == 1
    assert times.max() <= 2
    for span in spans:
        if span.triphone >= 0:
            assert tuple(classes[span.first : span.last + 1]) in known


def test_without_triphones_every_interval_has_a_diphone():
    assert [(span.first, span.last) for span in cover(np.array([0, 1, 2, 3]), models())] == [(0, 1), (1, 2), (2, 3)]


def test_weights_meet_the_anchors_and_are_the_polynomials_between_them():
    anchors_s, times_s = np.array([0.1, 0.3, 0.4]), np.array([0.0, 0.1, 0.15, 0.3, 0.35, 0.4, 0.9])
    weights = blended(np.array([0, 1, 2]), np.eye(3), anchors_s, times_s, models())
    expected = [[1, 0, 0], [1, 0, 0], [0.75, 0.25, 0], [0, 1, 0], [0, 0.5, 0.5], [0, 0, 1], [0, 0, 1]]
    assert weights == pytest.approx(np.array(expected, float))


def test_two_triphones_are_faded_over_the_interval_that_they_share():
    anchors_s = np.arange(4.0)
    weights = blended(np.array([0, 1, 2, 3]), np.eye(4), anchors_s, np.array([0.5, 1.25, 2.5]), models((0, 1, 2), (1, 2, 3)))
    share = float(blend_share(np.array([0.25]))[0])
    first = np.array([1 - 0.625, 0.5, 0.625, 0])  # of the first triphone at t = 1.25 / 2
    second = np.array([0, 1 - 0.125, 0.5, 0.125])  # of the second at t = 0.25 / 2
    assert weights[0] == pytest.approx([0.75, 0.5, 0.25, 0])
    assert weights[1] == pytest.approx(share * first + (1 - share) * second)
    assert weights[2] == pytest.approx([0, 0.25, 0.5, 0.75])


def test_the_share_of_a_blend_falls_from_one_to_nothing_and_is_half_in_the_middle():
    t = np.linspace(0, 1, 11)
    share = blend_share(t)
    assert (share[0], share[5], share[-1]) == pytest.approx((1, 0.5, 0))
    assert (np.diff(share) < 0).all()


def test_long_pauses_rest():
    phones = track(("aa", 0.2), ("pau", 1.0), ("aa", 0.2))
    keys = np.array([[1.0], [0.0], [1.0]])
    times_s = np.arange(0, 1.4, 0.01)
    shapes = blend_key_shapes(phones, np.array([1, 0, 1]), keys, models(), times_s)[:, 0]
    resting = (times_s > 0.2 + SETTLE_S) & (times_s < 1.2 - WAKE_S)
    assert shapes[resting] == pytest.approx(0)
    assert shapes[times_s < 0.1] == pytest.approx(1)
    assert (shapes[(times_s > 0.11) & (times_s < 0.2 + SETTLE_S - 0.01)] > 0).all()


def test_pauses_at_the_edges_have_one_anchor_each_and_a_pause_alone_has_two():
    assert anchors_of(track(("pau", 1.0), ("aa", 0.2), ("pau", 1.0))).phones.tolist() == [0, 1, 2]
    assert anchors_of(track(("pau", 1.0))).phones.tolist() == [0, 0]


def test_one_phone_holds_its_shape():
    phones = track(("aa", 0.2))
    assert blend_key_shapes(phones, np.array([1]), np.array([[3.0]]), models(), np.arange(5) / 25) == pytest.approx(3.0)


def test_key_shapes_are_changed_by_neighbours_and_length():
    def at(rows, *place):
        array = np.zeros(rows)
        array[place] = 1.0
        return array

    pair, one = (2, 2, 1), (2, 1)
    usual = np.array([0.1, 0.1])
    base = {"left": pair, "right": pair, "far_left": one, "far_right": one, "pace": one}
    numbers, classes, lengths = np.array([0, 1, 1]), np.array([0, 1, 1]), np.array([0.1, 0.1, 0.2])

    def of(**changed):
        keys = KeyShapes(np.zeros((2, 1)), **({k: np.zeros(v) for k, v in base.items()} | changed), usual_s=usual)
        return keys.of(numbers, classes, lengths)[:, 0]

    assert of(left=at(pair, 0, 1)) == pytest.approx([0, 1, 0])
    assert of(right=at(pair, 1, 1)) == pytest.approx([0, 1, 0])
    assert of(far_left=at(one, 0)) == pytest.approx([0, 0, 1])
    assert of(far_right=at(one, 1)) == pytest.approx([1, 0, 0])
    assert of(pace=at(one, 1)) == pytest.approx([0, 0, np.log(2)])
