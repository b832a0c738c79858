"""The search against the literal recursion, pair by pair, in plain Python."""

import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from literal_search import literal, path_cost, target_costs, transition_cost

from facesynth.inference.efase import steps
from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.costs import Query, Weights, all_targets
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.search import BEAM, Search, SearchIndex
from facesynth.methods.efase.torch_search import torch_engine


def random_nodes(rng, count=40, phones=5, emotions=2, width=3, scale=1.0, sentence=6, shortest=1):
    pieces = [scale * np.cumsum(rng.normal(size=(rng.integers(shortest, 9), width)), axis=0) for _ in range(count)]
    before = np.where(np.arange(count) % sentence == 0, -1, np.arange(count) - 1)
    phone = rng.integers(0, phones, count)
    return Nodes.from_pieces(pieces, phone, phone // 2, rng.integers(0, emotions, count), before)


def random_query(rng, nodes, count, phones=5, emotions=2, fixed=0):
    phone = rng.integers(-1, phones, count)
    emotion = rng.integers(-1, emotions, count)
    places = rng.choice(count, fixed, replace=False)
    constraints = {int(t): int(rng.integers(len(nodes))) for t in places}
    strict = (phone == 0) & (rng.random(count) < 0.5) & ~np.isin(np.arange(count), places)
    return Query(phone, np.where(phone < 0, -1, phone // 2), emotion, constraints, strict)


def by_numpy(nodes, weights):
    return SearchIndex(nodes, weights, step_bounds(nodes, weights)).cheapest_path


ENGINES = {"numpy": by_numpy, "torch": torch_engine}
"""Each finds what the literal algorithm finds."""


def search(nodes, query, weights, engine="numpy"):
    """Cost and path of the cheapest path."""
    path = ENGINES[engine](nodes, weights)(all_targets(nodes, query, weights))
    return steps.path_cost(nodes, query, path, weights), path


@cache
def literally_searched(pnt, fixed):
    """Twelve random databases, each with a query, and its least cost and path: both engines meet them."""
    rng, found = np.random.default_rng(int(pnt * 10) + fixed), []
    for _ in range(12):
        nodes = random_nodes(rng)
        query = random_query(rng, nodes, int(rng.integers(2, 12)), fixed=fixed)
        found.append((nodes, query, *literal(nodes, query, Weights(pnt))))
    return found


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("pnt", [0.01, 1.0, 30.0, 1000.0])
@pytest.mark.parametrize("fixed", [0, 2])
def test_equals_the_literal_algorithm_on_random_databases(pnt, fixed, engine):
    weights = Weights(pnt)
    for nodes, query, cost, path in literally_searched(pnt, fixed):
        found, nodes_found = search(nodes, query, weights, engine)
        np.testing.assert_allclose(found, cost, rtol=1e-9)
        np.testing.assert_allclose(path_cost(nodes, query, nodes_found, weights), cost, rtol=1e-9)
        np.testing.assert_array_equal(nodes_found, path)
        for t, node in query.fixed.items():
            assert nodes_found[t] == node


def test_ties_go_to_the_lowest_node():
    rng = np.random.default_rng(3)
    nodes = random_nodes(rng, 10)
    twins = Nodes.from_pieces(
        [nodes.motion(i) for i in [*range(10), *range(10)]],
        *(np.tile(a, 2) for a in (nodes.phones, nodes.visemes, nodes.emotions)),
        np.concatenate([nodes.before, np.where(nodes.before < 0, -1, nodes.before + 10)]),
    )
    weights = Weights(10.0)
    for seed in range(20):
        query = random_query(np.random.default_rng(seed), twins, 6)
        np.testing.assert_array_equal(search(twins, query, weights)[1], literal(twins, query, weights)[1])


def test_one_phone_takes_the_lowest_node_of_that_phone_and_emotion():
    nodes = random_nodes(np.random.default_rng(0))
    query = Query(np.array([2]), np.array([1]), np.array([1]), {})
    cost, path = search(nodes, query, Weights(5.0))
    assert path[0] == np.flatnonzero((nodes.phones == 2) & (nodes.emotions == 1))[0]
    assert cost == 0


def test_a_recorded_sentence_returns_itself_at_no_cost():
    nodes = random_nodes(np.random.default_rng(1))
    rows = np.arange(12, 18)
    query = Query(nodes.phones[rows], nodes.visemes[rows], nodes.emotions[rows], {})
    cost, path = search(nodes, query, Weights(5.0))
    np.testing.assert_array_equal(path, rows)
    assert cost == 0


def test_every_node_without_a_predecessor():
    rng = np.random.default_rng(4)
    nodes = random_nodes(rng, 12, sentence=1)
    weights = Weights(2.0)
    query = random_query(rng, nodes, 5)
    cost, _ = search(nodes, query, weights)
    np.testing.assert_allclose(cost, literal(nodes, query, weights)[0], rtol=1e-12)
    assert cost >= 4 * weights.alpha * weights.pnt


def test_a_database_of_one_node_can_say_everything():
    nodes = random_nodes(np.random.default_rng(0), 1)
    query = Query(np.array([0, 1, -1]), np.array([0, 0, -1]), np.array([0, 0, 0]), {})
    np.testing.assert_array_equal(search(nodes, query, Weights(1.0))[1], [0, 0, 0])


def test_changing_one_constraint_leaves_distant_choices_alone():
    rng = np.random.default_rng(5)
    nodes = random_nodes(rng, 300)
    phones = rng.integers(0, 5, 40)
    free = Query(phones, phones // 2, rng.integers(0, 2, 40), {})
    base = search(nodes, free, Weights(50.0))[1]
    other = int(np.flatnonzero((nodes.phones == free.phones[20]) & (np.arange(300) != base[20]))[0])
    fixed = search(nodes, Query(free.phones, free.visemes, free.emotions, {20: other}), Weights(50.0))[1]
    assert fixed[20] == other
    changed = np.flatnonzero(fixed != base)
    assert np.abs(changed - 20).max() < 15


def test_a_constraint_far_from_all_that_is_near_is_found_exactly_in_little_memory(monkeypatch):
    predecessors, reached = [], Search._reached
    monkeypatch.setattr(Search, "_reached", lambda self, i, *rest: predecessors.append(len(i)) or reached(self, i, *rest))
    rng = np.random.default_rng(8)
    nodes, weights = random_nodes(rng, 1500, phones=30, emotions=3, width=4), Weights(3000.0, delta=0.06)
    index = SearchIndex(nodes, weights, step_bounds(nodes, weights))
    steps_of_all = np.concatenate(
        [steps.step_matrix(nodes, part, np.arange(1500), weights) for part in np.split(np.arange(1500), 6)]
    )
    for at in (5, 9, 16):
        query = random_query(rng, nodes, 20, phones=30, emotions=3)
        targets = all_targets(nodes, replace(query, fixed={at: int(rng.integers(1500))}, strict=None), weights)
        tracemalloc.start()
        path = index.cheapest_path(targets)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        phi = targets[0]
        for target in targets[1:]:
            phi = (phi[:, None] + steps_of_all).min(axis=0) + target
        found = targets[np.arange(20), path].sum() + steps.step_costs(nodes, path[:-1], path[1:], weights).sum()
        np.testing.assert_allclose(found, phi.min(), rtol=1e-9)
        assert most < 80e6
    assert max(predecessors) <= 2 * BEAM


def test_where_penalties_are_small_beside_joints_nothing_is_lost():
    rng = np.random.default_rng(9)
    nodes, weights = random_nodes(rng, 700, phones=30, emotions=3, width=4, scale=3.0), Weights(40.0)
    index, every = SearchIndex(nodes, weights, step_bounds(nodes, weights)), np.arange(700)
    steps_of_all = steps.step_matrix(nodes, every, every, weights)
    targets = all_targets(nodes, random_query(rng, nodes, 45, phones=30, emotions=3), weights)
    path, phi = index.cheapest_path(targets), targets[0]
    for target in targets[1:]:
        phi = (phi[:, None] + steps_of_all).min(axis=0) + target
    found = targets[np.arange(45), path].sum() + steps.step_costs(nodes, path[:-1], path[1:], weights).sum()
    np.testing.assert_allclose(found, phi.min(), rtol=1e-9)


@pytest.mark.parametrize("shortest", [1, 3])
def test_costs_of_pairs_and_targets_are_the_literal_ones(shortest):
    rng = np.random.default_rng(6)
    nodes, weights = random_nodes(rng, 30, shortest=shortest), Weights(2.0)
    i, j = rng.integers(0, 30, (2, 200))
    wanted = [transition_cost(nodes, int(a), int(b), weights) for a, b in zip(i, j, strict=True)]
    np.testing.assert_allclose(steps.step_costs(nodes, i, j, weights), wanted, rtol=1e-12, atol=1e-12)
    query = replace(random_query(rng, nodes, 9, fixed=2), heard=rng.exponential(1.0, (9, 30)))
    literally = [target_costs(nodes, query, t, weights) for t in range(9)]
    np.testing.assert_allclose(all_targets(nodes, query, weights), literally, rtol=1e-12)


def test_tables_of_bounds_are_below_every_step():
    rng = np.random.default_rng(7)
    nodes, weights = random_nodes(rng, 50), Weights(3.0)
    index = SearchIndex(nodes, weights, step_bounds(nodes, weights))
    every, phi = np.arange(50), rng.exponential(5.0, 50)
    cost = steps.step_costs(index.nodes, np.repeat(every, 50), np.tile(every, 50), weights).reshape(50, 50)
    assert (index.bounds.forward(phi) <= (phi[:, None] + cost).min(axis=0) * (1 + 1e-5)).all()
    assert (index.bounds.backward(every, phi, every) <= (cost + phi).min(axis=1) * (1 + 1e-5)).all()
