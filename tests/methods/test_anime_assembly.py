import numpy as np
import pytest

from facesynth.inference.anime_graph.assembly import Blender, Piece, warped
from facesynth.inference.anime_graph.candidates import AS_RECORDED, Chooser, Maps
from facesynth.inference.anime_graph.graph import Graph
from facesynth.inference.phones import PHONE_INDEX

AA, B, T = PHONE_INDEX["aa"], PHONE_INDEX["b"], PHONE_INDEX["t"]
FPS, L = 120.0, 10


def graph_of(runs, level=100.0):
    """Runs of phones; each node has 10 frames, of a straight line through its run, run r starting at r * level."""
    rows, frames = [], []
    for r, run in enumerate(runs):
        start = sum(map(len, frames))
        stop = start + L * len(run)
        frames.append(r * level + np.arange(L * len(run))[:, None] * np.ones((1, 2)))
        for n, phone in enumerate(run):
            before = len(rows) - 1 if n else -1
            place = (start + L * n, start + L * (n + 1))
            rows.append((phone, 0, *place, *place, start, stop, before, r, n))
    columns = np.array(rows).T
    after = np.array([i + 1 if i + 1 < len(rows) and rows[i + 1][8] == i else -1 for i in range(len(rows))])
    frames = np.concatenate(frames).astype(float)
    features = np.random.default_rng(0).normal(size=(len(frames), 3))
    return Graph(frames, features, *columns[:9], after, *columns[9:])


def piece(graph, node, count=L):
    heard = graph.audio(node)
    return Piece(0, node, AS_RECORDED, heard, warped(graph.motion(node), heard, heard, count))


def blended(graph, nodes, captured, counts=None):
    blender = Blender(Chooser(graph, Maps()), FPS)
    for node, linked, count in zip(nodes, captured, counts or [L] * len(nodes), strict=True):
        blender.add(piece(graph, node, count), linked)
    return np.concatenate([blender.blended(t) for t in range(len(nodes))]), blender


def test_the_same_sound_is_not_warped():
    rng = np.random.default_rng(0)
    heard, motion = rng.normal(size=(12, 9)), rng.normal(size=(15, 4))
    np.testing.assert_allclose(warped(motion, heard, heard, 15), motion, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 7, 40])
def test_warping_is_monotone_and_keeps_the_ends(count):
    rng = np.random.default_rng(count)
    place = np.arange(20.0)[:, None]
    result = warped(place, rng.normal(size=(9, 3)), rng.normal(size=(16, 3)), count)
    assert result.shape == (count, 1)
    assert (np.diff(result[:, 0]) >= 0).all()
    if count > 1:
        assert (result[0, 0], result[-1, 0]) == (0, 19)


def test_warping_follows_the_sound():
    sounds = np.eye(2)
    heard, wanted = sounds[[0] * 15 + [1] * 5], sounds[[0] * 5 + [1] * 15]
    result = warped(np.arange(20.0)[:, None], wanted, heard, 20)[:, 0]
    assert result[5] > 11


def test_one_frame_of_sound_is_enough():
    motion = np.arange(6.0)[:, None]
    np.testing.assert_allclose(warped(motion, np.zeros((1, 2)), np.zeros((1, 2)), 3)[:, 0], [0, 2.5, 5])


def test_captured_neighbours_are_left_alone():
    graph = graph_of([[AA, B, T]])
    motion, blender = blended(graph, [0, 1, 2], [False, True, True])
    np.testing.assert_allclose(motion, graph.frames)
    assert not blender.joins


def test_a_jump_is_bridged_by_a_captured_transition():
    graph = graph_of([[AA, T], [T, B], [AA, B]])
    motion, blender = blended(graph, [0, 3], [False, False])
    assert blender.joins[1].how == "help"
    np.testing.assert_allclose(motion[9], graph.motion(4)[9])
    np.testing.assert_allclose(motion[10], graph.motion(5)[0])
    np.testing.assert_allclose(motion[0], graph.motion(0)[0])
    np.testing.assert_allclose(motion[-1], graph.motion(3)[-1])


def test_of_several_transitions_the_one_that_sounds_right_helps():
    graph = graph_of([[AA, T], [T, B], [AA, B], [AA, B]])
    graph.features[graph.feature_starts[6] : graph.feature_stops[6]] = graph.audio(0)
    graph.features[graph.feature_starts[7] : graph.feature_stops[7]] = graph.audio(3)
    motion, _ = blended(graph, [0, 3], [False, False])
    np.testing.assert_allclose(motion[9], graph.motion(6)[9])


def test_of_transitions_that_sound_alike_the_nearest_one_helps():
    graph = graph_of([[AA, T], [T, B], [AA, B], [AA, B]])
    for node in (4, 6):
        graph.features[graph.feature_starts[node] : graph.feature_stops[node]] = graph.audio(0)
        graph.features[graph.feature_starts[node + 1] : graph.feature_stops[node + 1]] = graph.audio(3)
    motion, _ = blended(graph, [0, 3], [False, False])
    np.testing.assert_allclose(motion[9], graph.motion(4)[9])


def test_without_one_both_nodes_are_extended_by_what_was_captured():
    graph = graph_of([[AA, T], [T, B]])
    motion, blender = blended(graph, [0, 3], [False, False])
    assert blender.joins[1].how == "extension"
    onward, backward = graph.frames[:20], graph.frames[20:]
    fade = ((np.arange(20) + 0.5) / 20)[:, None]
    np.testing.assert_allclose(motion, (1 - fade) * onward + fade * backward)


def test_where_the_recording_ends_movement_runs_out():
    graph = graph_of([[AA], [B]])
    motion, blender = blended(graph, [0, 1], [False, False])
    assert blender.joins[1].how == "extension"
    onward = graph.motion(1)[0, 0] + blender.joins[1].right[0, 0] / (1 - 10.5 / 20)
    assert 0.8 < onward - graph.motion(0)[-1, 0] < 1
    assert np.abs(np.diff(motion[:, 0])).max() < 12


@pytest.mark.parametrize("runs", [[[AA, T], [T, B], [AA, B]], [[AA, T], [T, B]], [[AA], [B]]])
@pytest.mark.parametrize("counts", [[10, 10], [3, 25], [1, 1], [0, 4], [6, 0]])
def test_jumps_leave_no_step(runs, counts):
    graph = graph_of(runs)
    nodes = [0, len(runs[0]) + len(runs[1]) - 1 if len(runs) > 1 else 1]
    motion, _ = blended(graph, nodes, [False, False], counts)
    assert motion.shape == (sum(counts), 2)
    assert np.isfinite(motion).all()
    if min(counts) > 2:
        assert np.abs(motion[counts[0]] - motion[counts[0] - 1]).max() < 20


def test_a_node_between_two_jumps_is_continuous_on_both_sides():
    helped = graph_of([[AA], [B], [T], [AA, B], [B, T]])
    motion, blender = blended(helped, [0, 1, 2], [False, False, False])
    assert [blender.joins[t].how for t in (1, 2)] == ["help", "help"]
    np.testing.assert_allclose(motion[[9, 10]], np.concatenate([helped.motion(3)[9:], helped.motion(4)[:1]]))
    np.testing.assert_allclose(motion[[19, 20]], np.concatenate([helped.motion(5)[9:], helped.motion(6)[:1]]))
    extended = graph_of([[AA], [B], [T]])
    motion, blender = blended(extended, [0, 1, 2], [False, False, False])
    assert [blender.joins[t].how for t in (1, 2)] == ["extension", "extension"]
    np.testing.assert_allclose(motion[14:16], extended.motion(1)[4:6], atol=3.5)


def test_fades_of_a_shared_node_keep_to_its_halves():
    graph = graph_of([[AA], [B], [T]])
    left, middle, right = (piece(graph, n) for n in range(3))
    blender = Blender(Chooser(graph, Maps()), FPS)
    first, second = blender.bridge(left, middle, (False, True)), blender.bridge(middle, right, (True, False))
    assert np.abs(first.right[5:]).max() == 0
    assert np.abs(second.left[:4]).max() == 0
    assert np.abs(second.left[-1]).min() > 10
