"""Every path counts, the cheaper the more: the recursion of `cheapest` with its minimum replaced by a soft one.

At temperature tau a path of the cost C has the probability exp(-C / tau) / Z, and with s = -target / tau

    alpha_1(j) = s_1(j),   alpha_t(j) = log sum_i exp[alpha_t-1(i) - step(i, j) / tau] + s_t(j)
    beta_T(i) = 0,         beta_t(i) = log sum_j exp[-step(i, j) / tau + s_t+1(j) + beta_t+1(j)]

and alpha + beta - log Z is the logarithm of each candidate's posterior. tau -> 0 is the cheapest path. All of it is
differentiable in targets, steps and temperature. Blocks are made again on the way back, in place of being kept.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from facesynth.inference.errors import FacesynthError
from facesynth.motion.search.steps import ALL, Steps, block_size, lengths_of, split_places

NEVER = -1e30
"""Score of what is forbidden: its exponential is 0, and gradients stay finite."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Logarithms of sums over the paths of B utterances through T positions with n_t candidates each."""

    nodes: list[Tensor]
    """T of [B, n_t] probabilities; 0 after an utterance's end."""
    log_z: Tensor
    """[B] logarithm of the sum of exp(-C / tau) over all paths."""
    forward: list[Tensor]
    """T of [B, n_t] alpha."""
    onward: list[Tensor]
    """T of [B, n_t] s + beta."""
    lengths: Tensor
    """[B]"""
    steps: Steps
    temperature: float | Tensor

    def of_steps(self, t: int) -> Tensor:
        """[B, n_t, n_t+1] probabilities of all pairs, in memory at once: for few candidates."""
        move = -self.steps.cost(t, ALL, ALL).mT / self.temperature
        pairs = (self.forward[t][:, :, None] + move + self.onward[t + 1][:, None] - self.log_z[:, None, None]).exp()
        return torch.where((t + 1 < self.lengths)[:, None, None], pairs, 0.0)

    def captured(self, t: int) -> Tensor:
        """[B] probability that the step from position t to the next was recorded so."""
        link = self.steps.captured(t).expand(len(self.log_z), -1)
        has = (link >= 0) & (t + 1 < self.lengths)[:, None]
        score = self.forward[t].gather(1, link.clamp(min=0)) + self.onward[t + 1] - self.log_z[:, None]
        return torch.where(has, score, NEVER).exp().sum(dim=1)


def posterior(targets: Sequence[Tensor], steps: Steps, temperature: float | Tensor, lengths: Tensor | None = None) -> Posterior:
    """Forward and backward, float64.

    targets: T of [B, n_t], infinite where a candidate is forbidden or missing; lengths: [B] positions of each utterance,
    all T unless given. Raises FacesynthError at a temperature that is not above 0, or where a position has no candidate.
    """
    if isinstance(temperature, float | int) and not temperature > 0:
        raise FacesynthError(f"a soft search needs a temperature above 0; got {temperature:g}: search the cheapest path instead")
    lengths = lengths_of(targets, lengths)
    scores = [_score(target.double(), temperature, (t < lengths)[:, None]) for t, target in enumerate(targets)]
    forward, backward = [scores[0]], [torch.zeros_like(scores[-1])]
    for t, score in enumerate(scores[1:]):
        forward.append(_forth(t, forward[-1], steps, temperature) + score)
    for t in range(len(scores) - 2, -1, -1):
        after = _back(t, scores[t + 1] + backward[-1], scores[t].shape[1], steps, temperature)
        backward.append(torch.where((t + 1 < lengths)[:, None], after, 0.0))
    backward.reverse()
    sums = torch.stack([torch.logsumexp(alpha, dim=1) for alpha in forward])
    log_z = sums.gather(0, (lengths - 1)[None])[0]
    nodes = [torch.softmax(a + b, dim=1) * (t < lengths)[:, None] for t, (a, b) in enumerate(zip(forward, backward, strict=True))]
    onward = [score + beta for score, beta in zip(scores, backward, strict=True)]
    return Posterior(nodes, log_z, forward, onward, lengths, steps, temperature)


def _score(target: Tensor, temperature: float | Tensor, within: Tensor) -> Tensor:
    """-target / tau; after an utterance's end all candidates are alike."""
    allowed = target.isfinite()
    score = torch.where(allowed, -target.masked_fill(~allowed, 0.0) / temperature, NEVER)
    return torch.where(within, score, 0.0)


def _forth(t: int, alpha: Tensor, steps: Steps, temperature: float | Tensor) -> Tensor:
    """[B, m] log sum_i exp[alpha(i) - step(i, j) / tau]; a block is some of the next candidates."""

    def block(alpha: Tensor, rows: Tensor) -> Tensor:
        return torch.logsumexp(alpha[:, None] - steps.cost(t, rows, ALL) / temperature, dim=2)

    blocks = steps.rows(t, block_size(alpha.device) // len(alpha))
    return torch.cat(_block_by_block(block, alpha, blocks), dim=1)[:, torch.cat(list(blocks)).argsort()]


def _back(t: int, onward: Tensor, count: int, steps: Steps, temperature: float | Tensor) -> Tensor:
    """[B, n] log sum_j exp[-step(i, j) / tau + onward(j)]; a block is some of the `count` previous candidates."""

    def block(onward: Tensor, columns: Tensor) -> Tensor:
        return torch.logsumexp(onward[:, :, None] - steps.cost(t, ALL, columns) / temperature, dim=1)

    blocks = split_places(count, block_size(onward.device) // onward.numel(), onward.device)
    return torch.cat(_block_by_block(block, onward, blocks), dim=1)


def _block_by_block(block: Callable[[Tensor, Tensor], Tensor], values: Tensor, which: Sequence[Tensor]) -> list[Tensor]:
    """Blocks; if there are several, they are computed again where gradients are asked for, so that none is kept."""
    if len(which) == 1:
        return [block(values, which[0])]
    return [checkpoint(block, values, some, use_reentrant=False, preserve_rng_state=False) for some in which]
