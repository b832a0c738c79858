"""The path search as tensors against plain Python, path by path: the cheapest, and the mean over all."""

from collections import Counter
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from literal_search import transition_cost
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from facesynth.inference.errors import FacesynthError
from facesynth.motion.search import pruning, steps
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.jumps import JumpSteps
from facesynth.motion.search.motion_nodes import MotionNodeSteps, NodePath
from facesynth.motion.search.pictures import PictureSteps
from facesynth.motion.search.posterior import posterior
from facesynth.motion.search.pruning import MotionNodeSearch
from facesynth.motion.search.steps import GivenSteps, lower_distances, padded


@dataclass
class Recorded:
    """Motion nodes of lengths from 1 to 8 frames, recorded in rows of six."""

    frames: np.ndarray
    starts: np.ndarray
    lengths: np.ndarray
    visemes: np.ndarray
    before: np.ndarray

    @classmethod
    def random(cls, rng, count=40, width=3, in_a_row=6):
        lengths = rng.integers(1, 9, count)
        frames = np.cumsum(rng.normal(size=(lengths.sum(), width)), axis=0)
        before = np.where(np.arange(count) % in_a_row == 0, -1, np.arange(count) - 1)
        return cls(frames, np.cumsum(lengths) - lengths, lengths, rng.integers(0, 3, count), before)

    def __len__(self):
        return len(self.starts)

    def motion(self, node):
        return self.frames[self.starts[node] : self.starts[node] + self.lengths[node]]

    def costs(self, weights):
        """[N next, N previous] pair by pair."""
        return np.array([[transition_cost(self, i, j, weights) for i in range(len(self))] for j in range(len(self))])


def weights_of(pnt, **more):
    return SimpleNamespace(**{"pnt": pnt, "alpha": 3.6, "beta": 5.8, "eta": 6.8, **more})


def random_targets(rng, length, count, scale):
    """A third of them equal, as where all nodes of a phone suit alike; some forbidden, and one position prescribed."""
    targets = rng.exponential(scale, (length, count)) * (rng.random((length, count)) < 0.7)
    targets[rng.random(targets.shape) < 0.1] = np.inf
    t, node = rng.integers(length), rng.integers(count)
    targets[t] = np.where(np.arange(count) == node, 0.5, np.inf)
    targets[:, node] = np.where(np.isfinite(targets[:, node]), targets[:, node], scale)
    return targets


def viterbi(targets, costs):
    """Least cost and its path; costs T - 1 of [next, previous]; ties go to the lowest."""
    phi, origins = list(targets[0]), []
    for target, cost in zip(targets[1:], costs, strict=True):
        totals = [[p + c for p, c in zip(phi, row, strict=True)] for row in cost]
        origins.append([row.index(min(row)) for row in totals])
        phi = [min(row) + t for row, t in zip(totals, target, strict=True)]
    path = [phi.index(min(phi))]
    for origin in reversed(origins):
        path.append(origin[path[-1]])
    return min(phi), path[::-1]


def enumerated(targets, costs, temperature):
    """log Z and T of [n_t] posteriors, by adding up all paths."""
    paths = np.array(list(product(*(range(len(target)) for target in targets))))
    total = sum(np.asarray(target)[paths[:, t]] for t, target in enumerate(targets))
    total = total + sum(np.asarray(cost)[paths[:, t + 1], paths[:, t]] for t, cost in enumerate(costs))
    log_z = np.logaddexp.reduce(-total / temperature)
    shares = np.exp(-total / temperature - log_z)
    return log_z, [np.bincount(paths[:, t], shares, len(target)) for t, target in enumerate(targets)]


def classes_of(nodes):
    return torch.as_tensor(nodes.visemes)


def as_tensors(arrays):
    return [torch.as_tensor(array) for array in arrays]


@pytest.fixture(params=["all nodes", "bounds first", "small blocks"])
def way(request, monkeypatch):
    """Every way through the search finds the same."""
    if request.param != "all nodes":
        monkeypatch.setattr(pruning, "FEW", 0)
        monkeypatch.setattr(pruning, "TRIED", 3)
    if request.param == "small blocks":
        monkeypatch.setattr(steps, "ON_PROCESSOR", 130)
        monkeypatch.setattr(pruning, "MANY", 0)


@cache
def literally_searched(pnt):
    """Four times motion nodes, and of three utterances targets, least cost and path: every way through the search meets them."""
    rng, found = np.random.default_rng(int(pnt * 10)), []
    for _ in range(4):
        nodes = Recorded.random(rng)
        costs = nodes.costs(weights_of(pnt))
        targets = [random_targets(rng, length, len(nodes), pnt) for length in (1, 7, 4)]
        found.append((nodes, [(target, *viterbi(target, [costs] * (len(target) - 1))) for target in targets]))
    return found


@pytest.mark.usefixtures("way")
@pytest.mark.parametrize("pnt", [0.01, 1.0, 30.0, 1000.0])
def test_motion_nodes_as_by_the_literal_algorithm_in_batches_of_unequal_lengths(pnt):
    for nodes, utterances in literally_searched(pnt):
        search = MotionNodeSearch(MotionNodeSteps(nodes, weights_of(pnt)), classes_of(nodes))
        found = search.cheapest(as_tensors(target for target, *_ in utterances))
        for (target, least, wanted), path, cost in zip(utterances, found.path.tolist(), found.cost.tolist(), strict=True):
            assert cost == pytest.approx(least, rel=1e-12)
            assert path == wanted + [-1] * (7 - len(target))


@pytest.mark.usefixtures("way")
def test_of_twins_the_lower_node_is_taken():
    rng = np.random.default_rng(3)
    once = Recorded.random(rng, 12)
    before = np.concatenate([once.before, np.where(once.before < 0, -1, once.before + 12)])
    doubled = (np.tile(column, 2) for column in (once.starts, once.lengths, once.visemes))
    nodes, weights = Recorded(once.frames, *doubled, before), weights_of(5.0)
    search, costs = MotionNodeSearch(MotionNodeSteps(nodes, weights), classes_of(nodes)), nodes.costs(weights)
    for _ in range(10):
        targets = np.tile(rng.exponential(5.0, (6, 12)), 2)
        assert search.cheapest([torch.as_tensor(targets)]).path[0].tolist() == viterbi(targets, [costs] * 5)[1]


@pytest.mark.usefixtures("way")
def test_one_node_says_everything_and_a_recorded_row_costs_nothing():
    rng = np.random.default_rng(0)
    one = Recorded.random(rng, 1)
    found = MotionNodeSearch(MotionNodeSteps(one, weights_of(2.0)), classes_of(one)).cheapest([torch.zeros(3, 1)])
    assert found.path.tolist() == [[0, 0, 0]]
    assert float(found.cost) == pytest.approx(2 * 3.6 * 2.0)
    nodes = Recorded.random(rng)
    targets = torch.ones(5, len(nodes), dtype=torch.float64)
    targets[range(5), range(13, 18)] = 0
    found = MotionNodeSearch(MotionNodeSteps(nodes, weights_of(9.0)), classes_of(nodes)).cheapest([targets])
    assert (found.path.tolist(), float(found.cost)) == ([[13, 14, 15, 16, 17]], 0.0)


def test_steps_between_motion_nodes_are_the_transition_cost():
    rng = np.random.default_rng(5)
    for shift in (0.0, 3000.0):  # far from the origin, too
        nodes, weights = Recorded.random(rng, 25, width=5), weights_of(2.0)
        wanted = nodes.costs(weights)
        nodes.frames = nodes.frames + shift
        made, all_nodes = MotionNodeSteps(nodes, weights), torch.arange(25)
        np.testing.assert_allclose(made.between(all_nodes, all_nodes), wanted, rtol=1e-8, atol=1e-6)
        after, before = (x.flatten() for x in torch.meshgrid(all_nodes, all_nodes, indexing="ij"))
        pairs = made.pairs(before, after).view(25, 25)
        np.testing.assert_allclose(pairs, wanted, rtol=1e-8, atol=1e-12)
        for lower in (made.lower, made.lower_without_bending):
            assert (lower(all_nodes, all_nodes).double() <= pairs).all()
        tight = made.lower(all_nodes, all_nodes).double()
        assert (pairs - tight).max() < 1e-3 * pairs.max()


def test_lower_distances_are_never_above_the_distances():
    rng = np.random.default_rng(6)
    for scale in (1e-3, 1.0, 1e4):
        a = torch.as_tensor(rng.normal(size=(60, 300)) * scale + 1)
        b = torch.cat([a[:30] + 1e-4 * torch.as_tensor(rng.normal(size=(30, 300))), torch.as_tensor(rng.normal(size=(40, 300)))])
        exact = (a[:, None] - b).square().sum(dim=2)
        assert (lower_distances(a, b).double() <= exact).all()


def random_jumps(rng, length, most=6):
    """Of T positions: targets, first and last frames, links; a third of the candidates follow one that was recorded before."""
    counts = rng.integers(1, most + 1, length)
    targets, first, last = ([rng.normal(size=(n, 4)[: 2 if wide else 1]) for n in counts] for wide in (False, True, True))
    links = [np.full(n, -1) for n in counts]
    for t in range(1, length):
        for place in rng.permutation(min(counts[t - 1], counts[t]))[: counts[t] // 3 + 1]:
            links[t][place] = place
    return [np.abs(target) for target in targets], first, last, links


def jump_costs(first, last, links, jump, jump_cost):
    """T - 1 of [next, previous] (Cao 2005, eq. 2), pair by pair."""
    return [
        [
            [0.0 if link == i else jump + jump_cost * float(np.linalg.norm(a - b)) for i, b in enumerate(before)]
            for a, link in zip(after, linked, strict=True)
        ]
        for before, after, linked in zip(last[:-1], first[1:], links[1:], strict=True)
    ]


def batch_of_jumps(utterances, jump, jump_cost):
    """Padded targets, steps and lengths."""
    columns = [[as_tensors(u[k]) for u in utterances] for k in range(4)]
    made = JumpSteps(padded(columns[1], 0), padded(columns[2], 0), padded(columns[3], -1), jump, jump_cost)
    return padded(columns[0], torch.inf), made, torch.tensor([len(u[0]) for u in utterances])


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize(("jump", "jump_cost"), [(1.0, 0.7), (0.0, 1.0), (3.0, 0.0)])
def test_jumps_as_by_a_plain_search_in_batches_of_unequal_lengths(jump, jump_cost, small, monkeypatch):
    if small:
        monkeypatch.setattr(steps, "ON_PROCESSOR", 9)
    rng = np.random.default_rng(1)
    for _ in range(10):
        utterances = [random_jumps(rng, length) for length in (5, 1, 9)]
        found = cheapest(*batch_of_jumps(utterances, jump, jump_cost))
        for (targets, *rest), path, cost in zip(utterances, found.path.tolist(), found.cost.tolist(), strict=True):
            least, wanted = viterbi(targets, jump_costs(*rest, jump, jump_cost))
            assert cost == pytest.approx(least, rel=1e-12)
            assert path == wanted + [-1] * (9 - len(targets))


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize("temperature", [0.05, 1.0, 50.0])
def test_the_mean_over_jumps_is_that_over_all_paths(temperature, small, monkeypatch):
    if small:
        monkeypatch.setattr(steps, "ON_PROCESSOR", 9)
    rng = np.random.default_rng(2)
    for _ in range(5):
        utterances = [random_jumps(rng, length, most=4) for length in (3, 1, 5)]
        found = posterior(*batch_of_jumps(utterances, 1.0, 0.7)[:2], temperature, torch.tensor([3, 1, 5]))
        for b, (targets, *rest) in enumerate(utterances):
            costs = jump_costs(*rest, 1.0, 0.7)
            log_z, wanted = enumerated(targets, costs, temperature)
            assert float(found.log_z[b]) == pytest.approx(log_z)
            for t in range(5):
                shares = found.nodes[t][b].numpy()
                own = wanted[t] if t < len(wanted) else np.zeros(0)
                np.testing.assert_allclose(shares, np.pad(own, (0, len(shares) - len(own))), atol=1e-9)
            for t in range(4):
                pairs, has = found.of_steps(t)[b].numpy(), rest[2][t + 1] >= 0 if t + 1 < len(targets) else np.zeros(0, bool)
                assert pairs.sum() == pytest.approx(float(t + 1 < len(targets)))
                captured = sum(pairs[rest[2][t + 1][j], j] for j in np.flatnonzero(has))
                assert float(found.captured(t)[b]) == pytest.approx(captured, abs=1e-12)


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize("temperature", [0.3, 5.0, 200.0])
def test_the_mean_over_motion_nodes_is_that_over_all_paths(temperature, small, monkeypatch):
    if small:
        monkeypatch.setattr(steps, "ON_PROCESSOR", 20)
    rng = np.random.default_rng(4)
    for _ in range(4):
        nodes, weights = Recorded.random(rng, 7, in_a_row=4), weights_of(3.0)
        targets = random_targets(rng, 4, 7, 3.0)
        path = NodePath(MotionNodeSteps(nodes, weights), [torch.arange(7)] * 4)
        found = posterior([row[None] for row in as_tensors(targets)], path, temperature)
        log_z, wanted = enumerated(targets, [nodes.costs(weights)] * 3, temperature)
        assert float(found.log_z) == pytest.approx(log_z)
        np.testing.assert_allclose(torch.cat(found.nodes), wanted, atol=1e-9)
        for t in range(3):
            pairs, has = found.of_steps(t)[0].numpy(), np.flatnonzero(nodes.before >= 0)
            assert float(found.captured(t)) == pytest.approx(pairs[nodes.before[has], has].sum(), abs=1e-12)


def test_cold_the_mean_is_the_cheapest_path():
    rng = np.random.default_rng(7)
    nodes, weights = Recorded.random(rng), weights_of(3.0)
    made = MotionNodeSteps(nodes, weights)
    targets = [torch.as_tensor(rng.exponential(3.0, (1, 40))) for _ in range(6)]  # no ties
    path = NodePath(made, [torch.arange(40)] * 6)
    found = posterior(targets, path, 1e-6)
    best = cheapest(targets, path)
    assert [int(shares.argmax()) for shares in found.nodes] == best.path[0].tolist()
    assert -1e-6 * float(found.log_z) == pytest.approx(float(best.cost))


def test_gradients_are_those_of_small_steps_and_the_same_in_small_blocks(monkeypatch):
    rng = np.random.default_rng(8)
    nodes = Recorded.random(rng, 7, in_a_row=4)
    targets = [torch.as_tensor(rng.exponential(2.0, (2, 7))).requires_grad_() for _ in range(3)]
    numbers = torch.tensor([2.0, 1.5, 0.7, 1.1, 0.9], dtype=torch.float64, requires_grad=True)

    def shares(numbers, *targets):
        *weights, temperature = numbers
        made = MotionNodeSteps(nodes, SimpleNamespace(**dict(zip(("pnt", "alpha", "beta", "eta"), weights, strict=True))))
        forbidden = torch.full((2, 7), False)
        forbidden[1, 3] = True
        asked = [target.masked_fill(forbidden, torch.inf) for target in targets]
        found = posterior(asked, NodePath(made, [torch.arange(7)] * 3), temperature, torch.tensor([3, 2]))
        return *found.nodes, found.captured(0), found.log_z

    def gradients():
        made = shares(numbers, *targets)
        return torch.autograd.grad(made, (numbers, *targets), [torch.ones_like(one).cumsum(dim=-1) for one in made])

    assert torch.autograd.gradcheck(shares, (numbers, *targets))
    whole = gradients()
    monkeypatch.setattr(steps, "ON_PROCESSOR", 20)
    for one, other in zip(gradients(), whole, strict=True):
        torch.testing.assert_close(one, other)


def test_given_costs_find_the_cheapest_of_all():
    rng = np.random.default_rng(1)
    targets, costs = rng.normal(size=(2, 4, 3)), rng.normal(size=(2, 3, 3, 3))
    given = GivenSteps([torch.as_tensor(costs[:, t]) for t in range(3)])
    found = cheapest([torch.as_tensor(targets[:, t]) for t in range(4)], given)
    for b in range(2):
        least, path = viterbi(targets[b], costs[b].tolist())
        assert (found.path[b].tolist(), float(found.cost[b])) == (path, pytest.approx(least))


def test_pictures_as_by_a_plain_search():
    rng = np.random.default_rng(9)
    looks, starts = rng.normal(size=(30, 5)), rng.random(30) < 0.2
    candidates = np.array([rng.permutation(30)[:6] for _ in range(12)])
    targets = rng.exponential(size=(12, 6))
    made = PictureSteps(*as_tensors((looks, starts, candidates)), scale=0.8)
    costs = [
        [[0.0 if j in (i, i + 1 - 31 * starts[j]) else 0.8 * ((looks[i] - looks[j]) ** 2).mean() for i in a] for j in b]
        for a, b in pairwise(candidates)
    ]
    found = cheapest([row[None] for row in as_tensors(targets)], made)
    assert found.path[0].tolist() == viterbi(targets, costs)[1]
    for t, (a, b) in enumerate(pairwise(candidates)):
        follows = [[k for k, i in enumerate(a) if i + 1 == j and not starts[j]] for j in b]
        assert made.captured(t)[0].tolist() == [k[0] if k else -1 for k in follows]


class LargestTensor(TorchDispatchMode):
    """Numbers in the largest tensor that any operation made."""

    numbers = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        made = func(*args, **(kwargs or {}))
        self.numbers = max([self.numbers, *(leaf.numel() for leaf in tree_leaves(made) if isinstance(leaf, torch.Tensor))])
        return made


def searched(count, soft):
    rng = np.random.default_rng(10)
    nodes = Recorded.random(rng, count)
    made, targets = MotionNodeSteps(nodes, weights_of(5.0)), torch.as_tensor(rng.exponential(5.0, (3, count)))
    kept = Counter()

    def count_kept(tensor):
        kept[tensor.untyped_storage().data_ptr()] = tensor.untyped_storage().nbytes()
        return tensor

    with LargestTensor() as largest, torch.autograd.graph.saved_tensors_hooks(count_kept, lambda tensor: tensor):
        if soft:
            path = NodePath(made, [torch.arange(count)] * 3)
            found = posterior([row[None] for row in targets.requires_grad_()], path, 2.0)
            found.nodes[1].square().sum().backward()
        else:
            MotionNodeSearch(made, classes_of(nodes)).cheapest([targets])
    return largest.numbers, sum(kept.values())


@pytest.mark.parametrize("soft", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_memory_grows_with_the_nodes_and_not_with_their_square(soft, monkeypatch):
    monkeypatch.setattr(steps, "ON_PROCESSOR", 4000)
    monkeypatch.setattr(pruning, "FEW", 0)
    (small, kept_small), (large, kept_large) = searched(300, soft), searched(600, soft)
    assert large < 2.2 * small
    assert large < 600 * 600 / 10
    assert kept_large <= 2.3 * kept_small


def test_another_device_is_not_left():
    rng = np.random.default_rng(11)
    utterances = [random_jumps(rng, 4), random_jumps(rng, 4)]
    targets, made, _ = batch_of_jumps(utterances, 1.0, 0.7)
    elsewhere = [target.to("meta") for target in targets]
    found = posterior(elsewhere, made.to("meta"), 1.0)
    assert {share.device.type for share in (*found.nodes, found.log_z, found.captured(0), found.of_steps(0))} == {"meta"}
    pictures = PictureSteps(torch.zeros(9, 2), torch.zeros(9, dtype=torch.bool), torch.zeros(4, 3, dtype=torch.int64), 1.0)
    best = cheapest([torch.zeros(1, 3, device="meta")] * 4, pictures.to("meta"))
    assert {best.path.device.type, best.cost.device.type} == {"meta"}
    nodes = MotionNodeSteps(Recorded.random(rng), weights_of(1.0)).to("meta")
    some = torch.zeros(5, dtype=torch.int64, device="meta")
    assert nodes.lower_without_bending(some, some).device.type == "meta"


def test_what_has_no_path_is_said():
    given = GivenSteps([torch.zeros(2, 2)])
    forbidden = [torch.zeros(2, 2), torch.tensor([[0.0, torch.inf], [torch.inf, torch.inf]])]
    with pytest.raises(FacesynthError, match="position 1 of utterance 1"):
        cheapest(forbidden, given)
    assert cheapest(forbidden, given, torch.tensor([2, 1])).path.tolist() == [[0, 0], [0, -1]]
    with pytest.raises(FacesynthError, match="temperature above 0"):
        posterior([torch.zeros(1, 2)], given, 0.0)
    with pytest.raises(FacesynthError, match="from 1 to 2"):
        cheapest([torch.zeros(1, 2)] * 2, given, torch.tensor([3]))
    with pytest.raises(FacesynthError, match="at least one position"):
        cheapest([], given)
