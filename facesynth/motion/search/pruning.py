"""Which nodes of a database may stand on the cheapest path, from bounds, and the path through these alone.

A class is a set of nodes, such as those of one phone in one emotion. Made once by blocks: the least step from each class to
each node, and from each node to each class, captured steps left out; both are C numbers a node. Then for every input

    F_1 = target_1,   F_t(j) = target_t(j) + min(F_t-1(pre(j)), min_c [least F_t-1 of c + arriving(c, j)])
    R_T = 0,          R_t(i) = min(V_t+1(after(i)), min_c [least V_t+1 of c + leaving(c, i)]),   V_t = R_t + target_t

bound from below what a path costs up to a node and after it. The cheapest path through the nodes of least F is a real one:
its cost bounds the best from above, and a node with F + R beyond that stands on no best path. What is left, a few nodes a
phone, goes through `cheapest`, which finds the path that it would find among all nodes, ties included.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from facesynth.motion.search.cheapest import Cheapest, cheapest
from facesynth.motion.search.motion_nodes import MotionNodeSteps, NodePath
from facesynth.motion.search.steps import LOWERED, block_size, lengths_of, padded

TRIED = 48
"""Nodes a phone through which an upper bound is looked for."""
MANY = 150
"""Nodes a phone, on average, that are left: above, a better upper bound is looked for first."""
FEW = 512
"""Nodes of a database up to which all of them are searched."""
MARGIN = 1 + 1e-9
"""Of upper bounds: sums in float64 are rounded."""


@dataclass(frozen=True, eq=False)
class Left:
    """The nodes that may stand at one position."""

    nodes: Tensor
    """[n] in rising order."""
    targets: Tensor
    """[B, n] infinite where another utterance needs the node."""
    limits: Tensor | None = None
    """[B, n] what a best path costs at most up to each of them."""


class MotionNodeSearch(nn.Module):
    """The cheapest path through a database of motion nodes; results are nodes. Memory grows with N · (T + C)."""

    classes: Tensor
    after: Tensor
    arriving: Tensor | None
    """[C, N] least step from each class to each node."""
    leaving: Tensor | None
    """[C, N] least step from each node to each class."""

    def __init__(self, steps: MotionNodeSteps, classes: Tensor) -> None:
        """classes: [N] 0 … C - 1; the more alike the nodes of a class are, the better."""
        super().__init__()
        self.steps = steps
        self.register_buffer("classes", classes, persistent=False)
        self.register_buffer("arriving", None, persistent=False)
        self.register_buffer("leaving", None, persistent=False)
        after = torch.full((len(steps),), -1, device=classes.device)
        followers = (steps.before >= 0).nonzero()[:, 0]
        after[steps.before[followers]] = followers
        self.register_buffer("after", after, persistent=False)

    @torch.no_grad()
    def cheapest(self, targets: Sequence[Tensor]) -> Cheapest:
        """Paths of B utterances; targets [T_b, N] are what every node costs at every phone, ≥ 0, infinite where forbidden.

        Raises FacesynthError where a phone has no node of finite cost.
        """
        asked = padded([list(utterance.double()) for utterance in targets], torch.inf)
        lengths = lengths_of(asked, torch.tensor([len(utterance) for utterance in targets], device=asked[0].device))
        everything = torch.arange(len(self.steps), device=lengths.device)
        left = [Left(everything, target) for target in asked]
        return self._among(left if len(everything) <= FEW else self.left(asked, lengths), lengths)

    def left(self, targets: Sequence[Tensor], lengths: Tensor) -> list[Left]:
        """The nodes that may stand at each of T positions; targets T of [B, N]."""
        reached = self._reached(targets)
        limit = self._among(self._likely(reached, targets), lengths).cost * MARGIN
        kept, whole = self._kept(reached, targets, lengths, limit)
        if sum(int(some.sum()) for some in kept) > MANY * int(lengths.sum()):
            limit = torch.minimum(limit, self._among(self._likely(whole, targets), lengths).cost * MARGIN)
            kept, whole = self._kept(reached, targets, lengths, limit)
        found = []
        for some, target, reach, total in zip(kept, targets, reached, whole, strict=True):
            nodes = some.any(dim=0).nonzero()[:, 0]
            beyond = torch.where(some, target, torch.inf)[:, nodes], (limit[:, None] - (total - reach))[:, nodes]
            found.append(Left(nodes, *beyond))
        return found

    def _among(self, left: Sequence[Left], lengths: Tensor) -> Cheapest:
        path = NodePath(self.steps, [some.nodes for some in left])
        limits = [some.limits for some in left if some.limits is not None]
        found = cheapest([some.targets for some in left], path, lengths, limits or None)
        nodes = torch.stack([some.nodes[found.path[:, t]] for t, some in enumerate(left)], dim=1)
        return Cheapest(torch.where(found.path >= 0, nodes, -1), found.cost)

    def _likely(self, scores: Sequence[Tensor], targets: Sequence[Tensor]) -> list[Left]:
        """Those of least score at each position, and what was recorded right after those before."""
        found: list[Left] = []
        last = torch.zeros(0, dtype=torch.int64, device=self.after.device)
        for score, target in zip(scores, targets, strict=True):
            least = score.topk(min(TRIED, score.shape[1]), largest=False).indices.flatten()
            following = self.after[last]
            nodes = torch.unique(torch.cat([least, following[following >= 0]]))
            found.append(Left(nodes, target[:, nodes]))
            last = least
        return found

    def _reached(self, targets: Sequence[Tensor]) -> list[Tensor]:
        """F: T of [B, N]."""
        before, found = self.steps.before, [targets[0]]
        for target in targets[1:]:
            last = found[-1]
            captured = torch.where(before >= 0, last[:, before], torch.inf)
            found.append(target + torch.minimum(captured, self._least(last, self.tables[0])))
        return found

    def _kept(
        self, reached: Sequence[Tensor], targets: Sequence[Tensor], lengths: Tensor, limit: Tensor
    ) -> tuple[list[Tensor], list[Tensor]]:
        """T of [B, N] which nodes may be on a path within the limit [B], and F + R."""
        kept: list[Tensor] = []
        rest, whole = torch.zeros_like(targets[-1]), []
        for t in range(len(targets) - 1, -1, -1):
            if t + 1 < len(targets):
                value = torch.where(kept[-1], rest + targets[t + 1], torch.inf)
                captured = torch.where(self.after >= 0, value[:, self.after], torch.inf)
                rest = torch.minimum(captured, self._least(value, self.tables[1]))
                rest = torch.where((t + 1 < lengths)[:, None], rest, 0.0)
            whole.append(reached[t] + rest)
            kept.append((whole[-1] <= limit[:, None]) & (t < lengths)[:, None])
        return kept[::-1], whole[::-1]

    def _least(self, values: Tensor, table: Tensor) -> Tensor:
        """[B, N] at least min_c [least value of class c + table(c, n)]; values [B, N], table [C, N]."""
        by_class = values.new_full((len(values), len(table)), torch.inf)
        by_class = by_class.scatter_reduce(1, self.classes.expand_as(values), values, "amin")
        least = by_class.amin(dim=1, keepdim=True).nan_to_num(posinf=0.0)
        above, wide = (by_class - least).float(), max(1, block_size(values.device) // by_class.numel())
        sums = [(above[:, :, None] + part).amin(dim=1) for part in torch.split(table, wide, dim=1)]
        return least + LOWERED * torch.cat(sums, dim=1).double()

    @property
    def tables(self) -> tuple[Tensor, Tensor]:
        """`arriving` and `leaving`, made when they are first asked for."""
        if self.arriving is None or self.leaving is None:
            self.arriving, self.leaving = self._tables()
        return self.arriving, self.leaving

    def _tables(self) -> tuple[Tensor, Tensor]:
        steps, classes = self.steps, self.classes
        everything = torch.arange(len(steps), device=classes.device)
        arriving = torch.full((int(classes.max()) + 1, len(steps)), torch.inf, device=classes.device)
        leaving = arriving.clone()
        path = NodePath(steps, [everything, everything])
        for rows in path.rows(0, block_size(classes.device)):
            least = steps.lower(everything, rows).masked_fill(steps.before[rows][:, None] == everything, torch.inf)
            leaving.scatter_reduce_(0, classes[rows][:, None].expand_as(least), least, "amin")
            by_class = arriving.new_full((len(rows), len(arriving)), torch.inf)
            arriving[:, rows] = by_class.scatter_reduce(1, classes.expand_as(least), least, "amin").T
        return arriving, leaving
