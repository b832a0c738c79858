"""What a search asks of steps, and steps whose costs are given."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor

from facesynth.inference.errors import FacesynthError

ON_PROCESSOR, ELSEWHERE = 1 << 20, 1 << 24
"""Costs in one block: few enough for a processor's cache, many enough to fill an accelerator."""
ALL = slice(None)
Which = Tensor | slice
"""Some candidates of a position, by their places, or all of them."""
UNITS = {"highest": 2.0**-24, "high": 2.0**-11, "medium": 2.0**-8}
"""Unit roundoff of float32 matrix products, by torch's `float32_matmul_precision`: float32, TF32, bfloat16."""

LOWERED = 1 - 2.0**-21
"""Of what was added up in float32 a few times, so that it is a lower bound in spite of rounding."""


class Steps(Protocol):
    """Steps from the n candidates of position t to the m candidates of position t + 1, for B utterances."""

    def rows(self, t: int, most: int) -> Sequence[Tensor]:
        """Blocks of candidates of t + 1, each [r], all of them together; at most `most` costs to a block."""

    def cost(self, t: int, rows: Which, columns: Which) -> Tensor:
        """[B or 1, r, c] float64 cost of coming to the candidates `rows` from `columns`."""

    def captured(self, t: int) -> Tensor:
        """[B or 1, m] which candidate of t was recorded right before each of t + 1, or -1; that step is free."""


@runtime_checkable
class BoundedSteps(Steps, Protocol):
    """Steps with a cheap lower bound, which tells the few pairs that are worth computing."""

    def lower(self, t: int, rows: Tensor, columns: Tensor) -> Tensor:
        """[B or 1, r, c] float32, at most the costs, which are ≥ 0."""

    def pairs(self, t: int, utterance: Tensor, after: Tensor, before: Tensor) -> Tensor:
        """[p] float64 costs of single steps; the same step costs the same, whichever others are beside it."""


class GivenSteps:
    """All costs in memory: for few candidates, or costs that are used again and again, as in learning."""

    def __init__(self, costs: Sequence[Tensor]) -> None:
        """costs: T - 1 of [B, m next, n previous], or without B."""
        self.costs = [cost if cost.ndim == 3 else cost[None] for cost in costs]

    def rows(self, t: int, most: int) -> Sequence[Tensor]:
        """See `Steps`."""
        batch, after, before = self.costs[t].shape
        return split_places(after, most // (batch * before), self.costs[t].device)

    def cost(self, t: int, rows: Which, columns: Which) -> Tensor:
        """See `Steps`."""
        return self.costs[t][:, rows][:, :, columns].double()

    def captured(self, t: int) -> Tensor:
        """See `Steps`; nothing is known to have been recorded in a row."""
        return torch.full_like(self.costs[t][:, :, 0], -1, dtype=torch.int64)


def block_size(device: torch.device) -> int:
    """Costs that are made at once on a device."""
    return ON_PROCESSOR if device.type == "cpu" else ELSEWHERE


def split_places(count: int, wide: int, device: torch.device) -> Sequence[Tensor]:
    """The places 0 … count - 1 in blocks of `wide`, one at least."""
    return torch.split(torch.arange(count, device=device), max(1, wide))


def squared_distances(a: Tensor, b: Tensor) -> Tensor:
    """[..., r, n] ‖a - b‖² of a [..., r, k] and b [..., n, k], by one matrix product: ‖a‖² + ‖b‖² - 2ab."""
    return (_lengths(a, b) - 2 * a @ b.mT).clamp(min=0)


def lower_distances(a: Tensor, b: Tensor) -> Tensor:
    """[..., r, n] float32, at most ‖a - b‖² of float64 vectors.

    At unit roundoff u a sum of k products, in any order, is off by at most k u ‖a‖‖b‖ (1 + k u), twice that by at most
    k u (‖a‖² + ‖b‖²). Both squared lengths are off by k u of themselves, rounding a and b adds 2 u of each, adding up 3 u.
    """
    a, b = a.float(), b.float()
    off = 1.01 * (2 * a.shape[-1] + 8) * UNITS[torch.get_float32_matmul_precision()]
    return ((1 - off) * _lengths(a, b) - 2 * a @ b.mT).clamp(min=0)


def _lengths(a: Tensor, b: Tensor) -> Tensor:
    return a.square().sum(-1)[..., :, None] + b.square().sum(-1)[..., None, :]


def padded(utterances: Sequence[Sequence[Tensor]], fill: float) -> list[Tensor]:
    """T of [B, n_t, ...] from B utterances of unequal lengths, each of T_b tensors [n, ...]; what is missing is `fill`."""
    count = max(len(utterance) for utterance in utterances)
    columns = [[u[t] if t < len(u) else u[-1][:0] for u in utterances] for t in range(count)]
    return [torch.nn.utils.rnn.pad_sequence(column, batch_first=True, padding_value=fill) for column in columns]


def lengths_of(targets: Sequence[Tensor], lengths: Tensor | None) -> Tensor:
    """[B] positions of each utterance, all of them unless given; every position must have a candidate that may stand there."""
    if not targets:
        raise FacesynthError("a path search needs at least one position; got none")
    batch, device = len(targets[0]), targets[0].device
    lengths = torch.full((batch,), len(targets), device=device) if lengths is None else lengths.to(device)
    if targets[0].is_meta:  # it has no values to look at
        return lengths
    if lengths.shape != (batch,) or not 1 <= int(lengths.min()) <= int(lengths.max()) <= len(targets):
        raise FacesynthError(f"each of {batch} utterances needs a length from 1 to {len(targets)}; got {lengths.tolist()}")
    for t, target in enumerate(targets):
        forbidden = ~target.isfinite().any(dim=1) & (t < lengths)
        if forbidden.any():
            utterance = int(forbidden.nonzero()[0])
            raise FacesynthError(
                f"position {t} of utterance {utterance} has no candidate of finite cost; allow at least one there"
            )
    return lengths
