"""Steps of eFASE: the transition cost TC between motion nodes (Deng 2008, eq. 4-8), by matrix products.

The first rule that applies to the step from i to j, pre(j) being what was recorded right before j:

    0                                            if i = pre(j)
    alpha · pnt                                  if j has no pre(j)
    beta · DSC + eta · PGap + VGap               if i and pre(j) are of one viseme class
    beta · DSC + eta · PGap + VGap + pnt         otherwise

PGap and VGap, the jumps of position and of velocity at the joint, are ‖end(i) - start(j)‖² of vectors `ends`, `starts`. DSC
is the bending of a blend from i, stretched to the length of pre(j), into pre(j): ‖D²[(1 - w) i] + D²[w pre(j)]‖² with D² the
second difference and w from 0 to 1. Side by side, for all j whose pre(j) has one length, both are one product.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from facesynth.motion.search.steps import LOWERED, Which, lower_distances, squared_distances

SHORTEST = 3
"""Frames below which nothing bends."""
PAIRS = 1 << 16
"""Frames of pairs whose bending is computed at once."""


class Recorded(Protocol):
    """N motion nodes; node n moves through `frames[starts[n] : starts[n] + lengths[n]]`. Arrays or tensors."""

    @property
    def frames(self) -> Any:
        """[F, D]"""

    @property
    def starts(self) -> Any:
        """[N]"""

    @property
    def lengths(self) -> Any:
        """[N] in frames, 1 at least."""

    @property
    def visemes(self) -> Any:
        """[N] viseme class."""

    @property
    def before(self) -> Any:
        """[N] the node recorded right before, or -1."""


class StepWeights(Protocol):
    """Weights of TC; tensors where gradients are wanted."""

    @property
    def pnt(self) -> float | Tensor:
        """The large constant, in squared units of the motion."""

    @property
    def alpha(self) -> float | Tensor:
        """Of pnt where there is no pre(j)."""

    @property
    def beta(self) -> float | Tensor:
        """Of DSC."""

    @property
    def eta(self) -> float | Tensor:
        """Of PGap."""


class MotionNodeSteps(nn.Module):
    """TC between any nodes of a database. Memory grows with its frames."""

    frames: Tensor
    """[F, D] float64."""
    starts: Tensor
    lengths: Tensor
    visemes: Tensor
    before: Tensor
    bends: Tensor
    """[N] length of pre(j); 0 where there is none, or where it is too short to bend."""
    centre: Tensor
    """[D] mean frame: distances stay when everything is moved, and lose less to rounding near the origin."""

    def __init__(self, nodes: Recorded, weights: StepWeights) -> None:
        super().__init__()
        self.weights = weights
        self.register_buffer("frames", torch.as_tensor(nodes.frames, dtype=torch.float64), persistent=False)
        for name in ("starts", "lengths", "visemes", "before"):
            self.register_buffer(name, torch.as_tensor(getattr(nodes, name), dtype=torch.int64), persistent=False)
        length = self.lengths[self.before]
        bends = torch.where((self.before >= 0) & (length >= SHORTEST), length, 0)
        self.register_buffer("bends", bends, persistent=False)
        self.register_buffer("centre", self.frames.mean(dim=0), persistent=False)

    def __len__(self) -> int:
        return len(self.starts)

    def between(self, before: Tensor, after: Tensor) -> Tensor:
        """[m, n] float64 TC from the nodes `before` [n] to the nodes `after` [m]; differentiable in the weights."""
        cost = self.frames.new_empty(len(after), len(before))
        for rows, arriving, leaving in self._vectors(before, after):
            cost[rows] = squared_distances(arriving, leaving)
        return self._ruled(cost, before, after[:, None])

    def lower(self, before: Tensor, after: Tensor) -> Tensor:
        """[m, n] float32, at most `between`."""
        cost = self.frames.new_empty(len(after), len(before), dtype=torch.float32)
        for rows, arriving, leaving in self._vectors(before, after):
            cost[rows] = lower_distances(arriving, leaving)
        return LOWERED * self._ruled(cost, before, after[:, None])

    def lower_without_bending(self, before: Tensor, after: Tensor) -> Tensor:
        """The same, DSC taken as 0: a tenth of the work."""
        cost = lower_distances(self._joints(after), self._ends(before))
        return LOWERED * self._ruled(cost, before, after[:, None])

    def pairs(self, before: Tensor, after: Tensor) -> Tensor:
        """[p] float64 TC of single steps by differences; what a step costs does not depend on those beside it."""
        cost = (self._ends(before) - self._joints(after)).square().sum(dim=1)
        bends, wide, shortest, longest = self.bends[after], int(self.lengths.max()), 0, 2 * SHORTEST
        while shortest < wide:
            within = ((bends > shortest) & (bends <= longest)).nonzero()[:, 0]
            for some in torch.split(within, PAIRS // longest):
                cost[some] += self._bending(before[some], self.before[after[some]], longest).square().sum(dim=1)
            shortest, longest = longest, 2 * longest
        return self._ruled(cost, before, after)

    def _ruled(self, cost: Tensor, before: Tensor, after: Tensor) -> Tensor:
        """Smooth costs with the rules that depend on labels alone."""
        previous, weights = self.before[after], self.weights
        cost = torch.where(self.visemes[previous] == self.visemes[before], cost, cost + weights.pnt)
        orphan = torch.as_tensor(weights.alpha * weights.pnt, dtype=cost.dtype, device=cost.device)
        cost = torch.where(previous < 0, orphan, cost)
        return torch.where(previous == before, 0.0, cost)

    def _vectors(self, before: Tensor, after: Tensor) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Rows of `after` whose pre has one length; vectors of them, and of all `before`, whose distance² is the smooth cost."""
        bends, ends, joints = self.bends[after], self._ends(before), self._joints(after)
        for length in torch.unique(bends).tolist():
            rows = (bends == length).nonzero()[:, 0]
            if length < SHORTEST:
                yield rows, joints[rows], ends
                continue
            rising = self._fading(self.before[after[rows]], length, into=True)
            yield rows, torch.cat([joints[rows], -rising], dim=1), torch.cat([ends, self._fading(before, length)], dim=1)

    def _fading(self, nodes: Tensor, length: int, *, into: bool = False) -> Tensor:
        """[n, (length - 2) D] √beta D²[(1 - w) motion] of nodes stretched to a length, or D²[w motion]."""
        w = torch.linspace(0, 1, length, dtype=self.frames.dtype, device=self.frames.device)[:, None]
        motion = self._stretched(nodes, torch.full_like(nodes, length), length)
        return _root(self.weights.beta) * ((w if into else 1 - w) * motion).diff(n=2, dim=1).flatten(1)

    def _bending(self, nodes: Tensor, into: Tensor, longest: int) -> Tensor:
        """[p, (longest - 2) D] √beta D²[(1 - w) i + w pre(j)] of pairs; zeros behind the end of each blend."""
        lengths, k = self.lengths[into], torch.arange(longest, device=nodes.device)
        w = (k.double() / (lengths - 1)[:, None])[..., None]
        blend = (1 - w) * self._stretched(nodes, lengths, longest) + w * self._stretched(into, lengths, longest)
        inside = (k[:-2] < (lengths - 2)[:, None])[..., None]
        return _root(self.weights.beta) * torch.where(inside, blend.diff(n=2, dim=1), 0.0).flatten(1)

    def _stretched(self, nodes: Tensor, lengths: Tensor, count: int) -> Tensor:
        """[n, count, D] motions time-warped to `lengths` [n] frames; what lies behind these has no meaning."""
        own, k = (self.lengths[nodes] - 1)[:, None], torch.arange(count, device=nodes.device)
        at = (k * own).double() / (lengths - 1)[:, None]
        low = torch.minimum(at.long(), (own - 1).clamp(min=0))
        first = self.starts[nodes][:, None]
        here, there = self.frames[first + low], self.frames[first + torch.minimum(low + 1, own)]
        return here + (at - low)[..., None] * (there - here)

    def _ends(self, nodes: Tensor) -> Tensor:
        """[n, 2D] such that ‖ends(i) - joints(j)‖² = eta PGap + VGap."""
        last = self.starts[nodes] + self.lengths[nodes] - 1
        return self._joint(last, last - (self.lengths[nodes] > 1).long(), 1)

    def _joints(self, nodes: Tensor) -> Tensor:
        """[n, 2D] see `_ends`."""
        first = self.starts[nodes]
        return self._joint(first, first + (self.lengths[nodes] > 1).long(), -1)

    def _joint(self, at: Tensor, inner: Tensor, sign: int) -> Tensor:
        # A node of one frame has no velocity: it is taken as zero.
        position, velocity = self.frames[at], sign * (self.frames[at] - self.frames[inner])
        return torch.cat([_root(self.weights.eta) * (position - self.centre), velocity], dim=1)


class NodePath:
    """`Steps` through positions at each of which some nodes of a database may stand, the same for all utterances."""

    def __init__(self, steps: MotionNodeSteps, nodes: Sequence[Tensor]) -> None:
        """nodes: T of [n_t] candidates."""
        self.steps, self.nodes = steps, nodes

    def rows(self, t: int, most: int) -> Sequence[Tensor]:
        """See `Steps`; candidates whose pre is of one length stand together."""
        order = self.steps.bends[self.nodes[t + 1]].argsort(stable=True)
        return torch.split(order, max(1, most // len(self.nodes[t])))

    def cost(self, t: int, rows: Which, columns: Which) -> Tensor:
        """See `Steps`."""
        return self.steps.between(self.nodes[t][columns], self.nodes[t + 1][rows])[None]

    def lower(self, t: int, rows: Tensor, columns: Tensor) -> Tensor:
        """See `BoundedSteps`."""
        return self.steps.lower_without_bending(self.nodes[t][columns], self.nodes[t + 1][rows])[None]

    def pairs(self, t: int, utterance: Tensor, after: Tensor, before: Tensor) -> Tensor:
        """See `BoundedSteps`."""
        return self.steps.pairs(self.nodes[t][before], self.nodes[t + 1][after])

    def captured(self, t: int) -> Tensor:
        """See `Steps`."""
        place = torch.full((len(self.steps) + 1,), -1, device=self.nodes[t].device)
        place[self.nodes[t]] = torch.arange(len(self.nodes[t]), device=place.device)
        return place[self.steps.before[self.nodes[t + 1]]][None]


def _root(weight: float | Tensor) -> float | Tensor:
    return weight**0.5
