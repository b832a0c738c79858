"""Steps between a speaker's pictures: staying on one, or going on to the one recorded next, is free."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from facesynth.motion.search.steps import Which, split_places


class PictureSteps(nn.Module):
    """Else a step costs the mean squared difference of what the two pictures look like. K candidates for each of T frames."""

    looks: Tensor
    clip_starts: Tensor
    candidates: Tensor

    def __init__(self, looks: Tensor, clip_starts: Tensor, candidates: Tensor, scale: float) -> None:
        """looks: [N, Q]; clip_starts: [N] true at the first picture of each clip; candidates: [T, K] numbers of pictures."""
        super().__init__()
        self.scale = scale
        self.register_buffer("looks", looks, persistent=False)
        self.register_buffer("clip_starts", clip_starts, persistent=False)
        self.register_buffer("candidates", candidates, persistent=False)

    def rows(self, t: int, most: int) -> Sequence[Tensor]:
        """See `Steps`; a difference of looks is Q numbers."""
        count = self.candidates.shape[1]
        return split_places(count, most // (count * self.looks.shape[1]), self.candidates.device)

    def cost(self, t: int, rows: Which, columns: Which) -> Tensor:
        """See `Steps`."""
        after, before = self.candidates[t + 1, rows][:, None], self.candidates[t, columns]
        free = (after == before) | ((after == before + 1) & ~self.clip_starts[after])
        apart = (self.looks[after] - self.looks[before]).square().mean(dim=-1)
        return torch.where(free, 0.0, self.scale * apart)[None]

    def captured(self, t: int) -> Tensor:
        """See `Steps`."""
        follows = self.candidates[t + 1, :, None] == self.candidates[t] + 1
        follows &= ~self.clip_starts[self.candidates[t + 1]][:, None]
        place, has = follows.int().argmax(dim=1), follows.any(dim=1)
        return torch.where(has, place, -1)[None]
