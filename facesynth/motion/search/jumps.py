"""Steps of the anime graph: what was recorded in a row is free, all else is a jump (Cao 2005, eq. 2).

step(i, j) = jump + jump_cost · ‖last frame of i - first frame of j‖
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from facesynth.motion.search.steps import LOWERED, Which, lower_distances, split_places, squared_distances


class JumpSteps(nn.Module):
    """Between the candidates of T positions, B utterances padded to like sizes; frames in the metric of the distance."""

    def __init__(
        self,
        first: Sequence[Tensor],
        last: Sequence[Tensor],
        links: Sequence[Tensor],
        jump: float | Tensor,
        jump_cost: float | Tensor,
    ) -> None:
        """first, last: T of [B, n_t, D] the frames that meet; links: T of [B, n_t], see `Steps.captured`; both costs ≥ 0."""
        super().__init__()
        self.jump, self.jump_cost = jump, jump_cost
        # Distances stay when everything is moved; near the origin they lose less to rounding.
        centre = torch.cat([frames.flatten(0, 1) for frames in first]).double().mean(dim=0)
        for t, (arriving, leaving, link) in enumerate(zip(first, last, links, strict=True)):
            self.register_buffer(f"first_{t}", arriving.double() - centre, persistent=False)
            self.register_buffer(f"last_{t}", leaving.double() - centre, persistent=False)
            self.register_buffer(f"link_{t}", link, persistent=False)

    def rows(self, t: int, most: int) -> Sequence[Tensor]:
        """See `Steps`."""
        last, first = self._of("last", t), self._of("first", t + 1)
        return split_places(first.shape[1], most // (len(last) * last.shape[1]), last.device)

    def cost(self, t: int, rows: Which, columns: Which) -> Tensor:
        """See `Steps`; differentiable in jump and jump_cost."""
        apart = squared_distances(self._of("first", t + 1)[:, rows], self._of("last", t)[:, columns]).sqrt()
        return self._linked(t, self.jump + self.jump_cost * apart, rows, columns)

    def lower(self, t: int, rows: Tensor, columns: Tensor) -> Tensor:
        """See `BoundedSteps`."""
        apart = lower_distances(self._of("first", t + 1)[:, rows], self._of("last", t)[:, columns]).sqrt()
        return self._linked(t, LOWERED * (self.jump + self.jump_cost * apart), rows, columns)

    def _linked(self, t: int, cost: Tensor, rows: Which, columns: Which) -> Tensor:
        places = torch.arange(self._of("last", t).shape[1], device=cost.device)[columns]
        return torch.where(self.captured(t)[:, rows, None] == places, 0.0, cost)

    def pairs(self, t: int, utterance: Tensor, after: Tensor, before: Tensor) -> Tensor:
        """See `BoundedSteps`."""
        apart = self._of("first", t + 1)[utterance, after] - self._of("last", t)[utterance, before]
        cost = self.jump + self.jump_cost * apart.square().sum(dim=1).sqrt()
        return torch.where(self.captured(t)[utterance, after] == before, 0.0, cost)

    def captured(self, t: int) -> Tensor:
        """See `Steps`."""
        return self._of("link", t + 1)

    def _of(self, name: str, t: int) -> Tensor:
        return self.get_buffer(f"{name}_{t}")
