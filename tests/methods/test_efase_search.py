"""The search against the literal recursion, pair by pair, in plain Python."""

import numpy as np
import pytest
from literal_search import literal

from facesynth.methods.efase.costs import Query, Weights, path_cost
from facesynth.methods.efase.nodes import MotionNodes
from facesynth.methods.efase.search import build_index, search


def random_nodes(rng, count=40, phones=5, emotions=2, width=3, scale=1.0, sentence=6, shortest=1):
    pieces = [scale * np.cumsum(rng.normal(size=(rng.integers(shortest, 9), width)), axis=0) for _ in range(count)]
    before = np.where(np.arange(count) % sentence == 0, -1, np.arange(count) - 1)
    phone = rng.integers(0, phones, count)
    return MotionNodes.from_pieces(pieces, phone, phone // 2, rng.integers(0, emotions, count), before)


def random_query(rng, nodes, count, phones=5, emotions=2, fixed=0):
    phone = rng.integers(-1, phones, count)
    emotion = rng.integers(-1, emotions, count)
    places = rng.choice(count, fixed, replace=False)
    constraints = {int(t): int(rng.integers(len(nodes))) for t in places}
    strict = (phone == 0) & (rng.random(count) < 0.5) & ~np.isin(np.arange(count), places)
    return Query(phone, np.where(phone < 0, -1, phone // 2), emotion, constraints, strict)


@pytest.mark.parametrize("pnt", [0.01, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("fixed", [0, 2])
def test_equals_the_literal_algorithm_on_random_databases(pnt, fixed):
    rng = np.random.default_rng(int(pnt * 10) + fixed)
    for _ in range(12):
        nodes = random_nodes(rng)
        query = random_query(rng, nodes, int(rng.integers(2, 12)), fixed=fixed)
        weights = Weights(pnt)
        cost, path = literal(nodes, query, weights)
        found = search(build_index(nodes, weights), query)
        np.testing.assert_allclose(found.cost, cost, rtol=1e-9)
        np.testing.assert_allclose(path_cost(nodes, query, path, weights), cost, rtol=1e-9)
        np.testing.assert_array_equal(found.nodes, path)
        for t, node in query.fixed.items():
            assert found.nodes[t] == node


def test_ties_go_to_the_lowest_node():
    rng = np.random.default_rng(3)
    nodes = random_nodes(rng, 10)
    twins = MotionNodes.from_pieces(
        [nodes.motion(i) for i in [*range(10), *range(10)]],
        *(np.tile(a, 2) for a in (nodes.phones, nodes.visemes, nodes.emotions)),
        np.concatenate([nodes.before, np.where(nodes.before < 0, -1, nodes.before + 10)]),
    )
    weights = Weights(10.0)
    for seed in range(20):
        query = random_query(np.random.default_rng(seed), twins, 6)
        np.testing.assert_array_equal(search(build_index(twins, weights), query).nodes, literal(twins, query, weights)[1])


def test_one_phone_takes_the_lowest_node_of_that_phone_and_emotion():
    nodes = random_nodes(np.random.default_rng(0))
    query = Query(np.array([2]), np.array([1]), np.array([1]), {})
    found = search(build_index(nodes, Weights(5.0)), query)
    assert found.nodes[0] == np.flatnonzero((nodes.phones == 2) & (nodes.emotions == 1))[0]
    assert found.cost == 0


def test_a_recorded_sentence_returns_itself_at_no_cost():
    nodes = random_nodes(np.random.default_rng(1))
    rows = np.arange(12, 18)
    query = Query(nodes.phones[rows], nodes.visemes[rows], nodes.emotions[rows], {})
    found = search(build_index(nodes, Weights(5.0)), query)
    np.testing.assert_array_equal(found.nodes, rows)
    assert found.cost == 0


def test_every_node_without_a_predecessor():
    rng = np.random.default_rng(4)
    nodes = random_nodes(rng, 12, sentence=1)
    weights = Weights(2.0)
    query = random_query(rng, nodes, 5)
    found = search(build_index(nodes, weights), query)
    np.testing.assert_allclose(found.cost, literal(nodes, query, weights)[0], rtol=1e-12)
    assert found.cost >= 4 * weights.alpha * weights.pnt


def test_a_database_of_one_node_can_say_everything():
    nodes = random_nodes(np.random.default_rng(0), 1)
    query = Query(np.array([0, 1, -1]), np.array([0, 0, -1]), np.array([0, 0, 0]), {})
    np.testing.assert_array_equal(search(build_index(nodes, Weights(1.0)), query).nodes, [0, 0, 0])


def test_changing_one_constraint_leaves_distant_choices_alone():
    rng = np.random.default_rng(5)
    nodes = random_nodes(rng, 300)
    phones = rng.integers(0, 5, 40)
    free = Query(phones, phones // 2, rng.integers(0, 2, 40), {})
    index = build_index(nodes, Weights(50.0))
    base = search(index, free).nodes
    other = int(np.flatnonzero((nodes.phones == free.phones[20]) & (np.arange(300) != base[20]))[0])
    fixed = search(index, Query(free.phones, free.visemes, free.emotions, {20: other})).nodes
    assert fixed[20] == other
    changed = np.flatnonzero(fixed != base)
    assert np.abs(changed - 20).max() < 15
