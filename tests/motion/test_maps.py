"""Maps of phones: the embedding, its picture, poses between its points, nodes that fit, nodes that are drawn."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from facesynth.inference.errors import FacesynthError
from facesynth.motion.maps.isomap import Isomap, neighbour_graph, residual_variance
from facesynth.motion.maps.outliers import remoteness
from facesynth.motion.maps.phone_map import Cluster, PhoneMap, emotion_colours
from facesynth.motion.maps.plane import Plane


def swiss_roll(rng, count=800):
    """A sheet [count, 2] and the same rolled up in space [count, 3]."""
    turn, across = 1.5 * np.pi * (1 + 2 * np.sqrt(rng.uniform(size=count) * 0.6 + 0.05)), 12 * rng.uniform(size=count)
    along = 0.5 * (turn * np.sqrt(1 + turn**2) + np.arcsinh(turn))
    return np.column_stack([along, across]), np.column_stack([turn * np.cos(turn), across, turn * np.sin(turn)])


def cluster(rng, count=30, width=6, emotions=("neutral", "angry")):
    """Nodes that wander in the plane of the first two coordinates, each emotion in its own corner."""
    lengths = rng.integers(4, 9, count)
    felt = tuple(emotions[k % len(emotions)] for k in range(count))
    starts = np.array([[8.0 * emotions.index(e), 0.0] for e in felt]) + rng.normal(size=(count, 2))
    plane = [start + np.cumsum(0.4 * rng.normal(size=(n, 2)), axis=0) for start, n in zip(starts, lengths, strict=True)]
    frames = np.concatenate([np.pad(piece, ((0, 0), (0, width - 2))) for piece in plane])
    frames += 0.01 * rng.normal(size=frames.shape)
    names = tuple(f"s{k:02d}:{k % 3}" for k in range(count))
    contexts = tuple(("pau", "n") if k % 5 == 0 else ("l", "t") for k in range(count))
    return Cluster("aa", names, felt, contexts, lengths, frames, 60.0, lambda z: (2 * z).astype(np.float32))


def test_a_rolled_sheet_is_unrolled():
    sheet, rolled = swiss_roll(np.random.default_rng(0))
    found = Isomap.fit(rolled, neighbours=10).places
    for column in sheet.T:
        design = np.column_stack([found, np.ones(len(found))])
        left = column - design @ np.linalg.lstsq(design, column, rcond=None)[0]
        assert left.var() / column.var() < 0.03


def test_a_plane_stays_what_it_is_and_new_points_fall_between_their_neighbours():
    rng = np.random.default_rng(1)
    flat = np.pad(rng.uniform(size=(900, 2)) * [3, 1], ((0, 0), (0, 4))) @ np.linalg.qr(rng.normal(size=(6, 6)))[0]
    isomap = Isomap.fit(flat[:800], core=500)
    ways = dijkstra(neighbour_graph(isomap.core, 12), directed=False)
    assert residual_variance(ways, isomap.places) < 0.01
    np.testing.assert_allclose(isomap.place(isomap.core), isomap.places, atol=1e-9)
    apart = np.linalg.norm(flat[800:, None] - flat[None, 800:], axis=2)
    placed = isomap.place(flat[800:])
    assert np.corrcoef(apart.ravel(), np.linalg.norm(placed[:, None] - placed[None], axis=2).ravel())[0, 1] > 0.99
    np.testing.assert_array_equal(placed, Isomap.fit(flat[:800], core=500).place(flat[800:]))


def test_parts_that_hang_together_nowhere_are_tied_and_equal_points_are_one_place():
    rng = np.random.default_rng(2)
    far = np.concatenate([rng.normal(size=(60, 3)), rng.normal(size=(60, 3)) + 100])
    places = Isomap.fit(np.concatenate([far, far])).places
    assert np.isfinite(places).all()
    np.testing.assert_allclose(places[:120], places[120:], atol=1e-6)
    assert np.linalg.norm(places[:60].mean(axis=0) - places[60:120].mean(axis=0)) > 50


@pytest.mark.parametrize("points", [np.zeros((5, 3)), np.full((50, 3), np.nan), np.zeros(50)])
def test_what_cannot_be_mapped_is_refused(points):
    with pytest.raises(FacesynthError, match="a map of 12 neighbours needs more points"):
        Isomap.fit(points)


def test_a_place_within_a_triangle_is_the_mean_of_its_corners_and_outside_is_nothing():
    rng = np.random.default_rng(3)
    points = rng.uniform(size=(40, 2))
    plane, frames = Plane(points), points @ rng.normal(size=(2, 5)) + 3.0
    asked = rng.uniform(-0.5, 1.5, size=(300, 2))
    mixed = plane.mixed(asked)
    np.testing.assert_allclose(mixed.shares.sum(axis=1), 1)
    assert (mixed.shares >= 0).all()
    made, linear = mixed.of(frames), mixed.of(points)
    np.testing.assert_allclose(linear[mixed.inside], asked[mixed.inside], atol=1e-9)
    np.testing.assert_allclose(
        made, linear @ np.linalg.lstsq(np.c_[points, np.ones(40)], frames, rcond=None)[0][:2] + 3, atol=1e-8
    )
    hull = plane.triangles.find_simplex(asked) >= 0
    np.testing.assert_array_equal(mixed.inside, hull)
    near = np.linalg.norm(points[None] - asked[~hull][:, None], axis=2).argmin(axis=1)
    np.testing.assert_array_equal(mixed.corners[~hull][:, 0], near)
    at_corners = plane.mixed(points)
    np.testing.assert_allclose(at_corners.of(points), points, atol=1e-9)


@pytest.mark.parametrize("points", [np.zeros((1, 2)), np.zeros((30, 2)), np.c_[np.arange(9.0), np.arange(9.0)]])
def test_points_that_span_no_triangle_offer_the_nearest(points):
    mixed = Plane(points).mixed([[0.2, 0.1]])
    assert not mixed.inside[0]
    np.testing.assert_allclose(mixed.of(points), points[:1], atol=1e-12)
    assert Plane(points).picture(np.ones((len(points), 3)), (40, 30)).shape == (30, 40, 3)


def test_a_picture_is_bright_where_points_lie_and_nowhere_above_one():
    plane = Plane(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    one = plane.picture([[0.5, 0, 0]] + 3 * [[0, 0, 1]], (200, 150), rho=0.4)
    left, right, bottom, top = plane.extent((200, 150))
    assert (right - left) / (top - bottom) == pytest.approx(200 / 150)

    def at(x, y):
        return one[int((top - y) / (top - bottom) * 150), int((x - left) / (right - left) * 200)]

    np.testing.assert_allclose(at(0, 0), [0.2, 0, 0], atol=0.01)
    np.testing.assert_allclose(at(1, 0), [0, 0, 0.8], atol=0.03)
    np.testing.assert_allclose(at(1, 1), [0, 0, 0.4], atol=0.02)
    np.testing.assert_allclose(at(0.5, 0.5), 0, atol=1e-6)
    assert plane.picture(np.ones((4, 3)), (200, 150), rho=30).max() == 1


@pytest.mark.parametrize("kind", ["isomap", "pca"])
def test_nodes_are_curves_of_their_frames(kind):
    found = PhoneMap.of(cluster(np.random.default_rng(4)), kind)
    curves = [found.curve(name) for name in found.cluster.names]
    np.testing.assert_array_equal(np.concatenate(curves), found.plane.points)
    np.testing.assert_allclose(found.placed(found.cluster.frames), found.plane.points, atol=1e-9)
    again = PhoneMap.of(found.cluster, kind, found.plane.points)
    np.testing.assert_allclose(again.placed(found.cluster.frames[:9]), found.plane.points[:9], atol=1e-9)
    for progress, frame in ((0.0, 0), (1.0, -1)):
        np.testing.assert_allclose(found.time_correct(progress), [curve[frame] for curve in curves])
    np.testing.assert_allclose(found.time_correct(0.5)[0], _halfway(curves[0]))
    assert found.context_correct("pau", "n").sum() == 6
    assert not found.context_correct("n", "pau").any()
    with pytest.raises(FacesynthError, match="s10:1"):
        found.curve("s00:1")


def _halfway(curve):
    at = (len(curve) - 1) / 2
    return (curve[int(np.floor(at))] + curve[int(np.ceil(at))]) / 2


def test_filters_leave_what_they_name():
    found = PhoneMap.of(cluster(np.random.default_rng(5)))
    assert found.shown().all()
    angry = found.shown(emotions={"angry"})
    assert angry.sum() == 15
    assert found.shown(emotions={"angry"}, utterances={"s01", "s02"}).tolist() == [k == 1 for k in range(30)]
    picture = found.picture((60, 40), angry)
    assert picture[..., 0].max() > 3 * picture[..., 2].max()
    assert found.picture((60, 40), found.shown(emotions=())).max() == 0
    assert len(set(emotion_colours(["neutral", "angry", "frustrated", "proud"]).values())) == 4


def test_a_drawn_node_follows_its_path_and_tells_what_lay_outside():
    found = PhoneMap.of(cluster(np.random.default_rng(6)), "pca")
    start, end = found.plane.points[found.cluster.node == 0][0], found.plane.points[found.cluster.node == 2][0]
    drawn = found.drawn([start, end], 0.2)
    assert drawn.frames.shape == (12, 6)
    np.testing.assert_allclose(np.diff(drawn.curve, axis=0), np.tile((end - start) / 11, (11, 1)), atol=1e-9)
    placed = found.placed(drawn.frames.astype(np.float64) / 2)
    assert np.linalg.norm(placed - drawn.curve, axis=1)[2:-2].max() < 0.6
    assert found.drawn([[100, 100], [200, 100]], 0.1).outside == 6
    for path, seconds in (([[0, 0]], 0.1), ([[0, 0], [np.nan, 1]], 0.1), ([[0, 0], [1, 1]], 0), ([[0, 0], [1, 1]], np.inf)):
        with pytest.raises(FacesynthError, match="drawn"):
            found.drawn(path, seconds)


def test_a_contaminated_node_is_the_remotest():
    rng = np.random.default_rng(7)
    made = cluster(rng, 40)
    made.frames[made.node == 13] += 9 * rng.normal(size=(1, 6))
    score = remoteness(made)
    assert score.argmax() == 13
    assert score[13] > 3 * np.sort(score)[-2]
    assert (remoteness(cluster(rng, 5)) == 1).all()
