"""The one loop by which networks of motion are trained; what is made small, and at what rate, is their own."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from facesynth.progress import track


class Learning(NamedTuple):
    """How a network learns."""

    steps: int
    optimiser: torch.optim.Optimizer
    schedule: torch.optim.lr_scheduler.LRScheduler
    """Of the optimiser's rate, step by step."""
    largest_gradient: float = float("inf")
    """Norm that a gradient is shortened to."""


def train(
    network: nn.Module, missed: Callable[[np.random.Generator], Tensor], learning: Learning, seed: int, what: str
) -> Iterator[float]:
    """Train a network; after each step comes its loss.

    missed: draws what is learned from by a generator, and says the loss. The same seed gives the same weights on the same machine
    with the same number of threads; torch's own generator, from which dropout draws, stays as it was. `what` is told beside
    the progress.
    """
    device, rng = next(network.parameters()).device, np.random.default_rng(seed)
    network.train()
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        torch.manual_seed(seed)
        for _ in track(range(learning.steps), what, learning.steps):
            loss = missed(rng)
            learning.optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
            nn.utils.clip_grad_norm_(network.parameters(), learning.largest_gradient)
            learning.optimiser.step()
            learning.schedule.step()
            yield loss.detach().item()
    network.eval()
