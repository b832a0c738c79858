"""Emotion maps: from the components of a motion in one emotion to those of another (Cao 2005, §5)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.motion.rbf import Kernel, RbfMap


@dataclass(frozen=True, eq=False)
class FittedMap:
    """What was learned from the sentences that two emotions share."""

    source: int
    """Index of the emotion that it leads from."""
    target: int
    rbf: RbfMap
    """Displacement of the emotional components."""
    shifts: NDArray[np.float64]
    """[D] lasting shift of the other components; of all, where emotion and speech are mixed in them."""
    dropped: NDArray[np.float64]
    """[C] lasting shift of what the components do not hold."""


class EmotionMaps(nn.Module):
    """One map for each ordered pair of emotions, `e_j = e_i + sum_r c_r phi(‖e_i - e_r‖)` (eq. 10)."""

    pairs: Tensor
    """[M, 2] indices of the emotions that each map leads from and to."""
    emotional: Tensor
    """[E] the components that the maps change, in ascending order."""
    centres: Tensor
    """[M, R, E] float64; maps with fewer than R centres have zero coefficients for the rest."""
    coefficients: Tensor
    """[M, R, E] float64."""
    widths: Tensor
    """[M] float64."""
    gaussian: Tensor
    """[M] whether phi(z) is exp(-z²) or exp(-z)."""

    shifts: Tensor
    """[M, D] what a map adds to every frame, beside what depends on the pose: `FittedMap.shifts`."""

    dropped: Tensor
    """[M, C] what it adds to every frame outside the components."""

    def __init__(self) -> None:
        super().__init__()
        self.fill([], np.zeros(0, np.int64))

    def fill(self, fitted: Sequence[FittedMap], emotional: NDArray[np.int64]) -> None:
        """Take fitted maps."""
        maps = {(m.source, m.target): m.rbf for m in fitted}
        most = max((len(m.centres) for m in maps.values()), default=0)
        width = len(emotional)
        centres, coefficients = torch.zeros(2, len(maps), most, width, dtype=torch.float64)
        for number, rbf in enumerate(maps.values()):
            centres[number, : len(rbf.centres)] = rbf.centres
            coefficients[number, : len(rbf.centres)] = rbf.coefficients
        self.register_buffer("pairs", torch.tensor(list(maps), dtype=torch.int64).reshape(-1, 2))
        self.register_buffer("emotional", torch.from_numpy(emotional))
        for name in ("shifts", "dropped"):
            rows = [getattr(m, name) for m in fitted]
            self.register_buffer(name, torch.from_numpy(np.stack(rows) if rows else np.zeros((0, 0))))
        self.register_buffer("centres", centres.clone())
        self.register_buffer("coefficients", coefficients.clone())
        self.register_buffer("widths", torch.tensor([float(m.width) for m in maps.values()], dtype=torch.float64))
        self.register_buffer("gaussian", torch.tensor([m.kernel == "gaussian" for m in maps.values()], dtype=torch.bool))

    def find(self, source: int, target: int) -> int | None:
        """The number of the map between two emotions, if there is one."""
        found = torch.nonzero((self.pairs[:, 0] == source) & (self.pairs[:, 1] == target))
        return int(found[0]) if len(found) else None

    def rbf(self, number: int) -> RbfMap:
        """The displacement of the emotional components that a map gives."""
        kernel: Kernel = "gaussian" if bool(self.gaussian[number]) else "exponential"
        return RbfMap(self.centres[number], self.coefficients[number], self.widths[number], kernel)

    def forward(self, components: Tensor, number: int, intensity: Tensor | float = 1.0) -> Tensor:
        """Components [..., D] in the map's first emotion to [..., D] in its second; intensity [...] 0 leaves them."""
        change = self.shifts[number].expand(components.shape).clone()
        change[..., self.emotional] += self.rbf(number)(components[..., self.emotional])
        return components + torch.as_tensor(intensity, dtype=components.dtype)[..., None] * change

    def apply_array(self, components: NDArray[np.float64], number: int) -> NDArray[np.float64]:
        """The same as `forward`, fully and for arrays."""
        with torch.no_grad():
            return self(torch.from_numpy(components).to(self.shifts.device), number).cpu().numpy()
