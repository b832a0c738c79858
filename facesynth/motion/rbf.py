"""Smooth maps through scattered samples by radial basis functions."""

from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError, unknown

Kernel = Literal["exponential", "gaussian"]
KERNELS: tuple[Kernel, ...] = ("exponential", "gaussian")
CLOSEST_CENTRES = 1e-6
"""Centres nearer to each other than this are merged: the system would be singular."""
RIDGE = 1e-6
"""Share of the mean diagonal that is added to it: Gaussian systems reach condition numbers of 1e8."""


class RbfMap(nn.Module):
    """`y(x) = sum over r of coefficients_r * phi(|x - centre_r| / width)`, fading to 0 far from all centres.

    phi(z) is exp(-z) for the exponential kernel and exp(-z²) for the Gaussian one.
    """

    centres: Tensor
    """[R, D] float64."""
    coefficients: Tensor
    """[R, E] float64."""
    width: Tensor
    """[] distance at which the kernel has fallen to 1/e, in the unit of x."""

    def __init__(self, centres: Tensor, coefficients: Tensor, width: Tensor, kernel: Kernel) -> None:
        super().__init__()
        self.kernel: Kernel = kernel
        self.register_buffer("centres", centres)
        self.register_buffer("coefficients", coefficients)
        self.register_buffer("width", width)

    @classmethod
    def fit(cls, centres: NDArray[Any], values: NDArray[Any], *, width: float, kernel: Kernel, ridge: float = RIDGE) -> Self:
        """Pass through values [R, E] at centres [R, D], up to the ridge, by LU decomposition.

        ridge: share of the mean diagonal that is added to it; more of it smooths noisy values.
        """
        if kernel not in KERNELS:
            raise unknown("kernel", kernel, KERNELS)
        if not width > 0 or len(centres) == 0 or len(centres) != len(values):
            raise FacesynthError(
                f"an RBF map needs a positive width and a value for each of its centres; got width {width}, "
                f"{len(centres)} centres and {len(values)} values"
            )
        from scipy.linalg import lu_factor, lu_solve

        at, to = apart(np.asarray(centres, np.float64), np.asarray(values, np.float64))
        system = torch.cdist(torch.from_numpy(at), torch.from_numpy(at), compute_mode="donot_use_mm_for_euclid_dist")
        matrix = _phi(system / width, kernel).numpy()
        matrix[np.diag_indices(len(at))] += ridge * np.trace(matrix) / len(at)
        coefficients = lu_solve(lu_factor(matrix), to)
        return cls(torch.from_numpy(at), torch.from_numpy(coefficients), torch.tensor(width, dtype=torch.float64), kernel)

    def forward(self, x: Tensor) -> Tensor:
        """Values [..., E] at points [..., D], in the points' precision."""
        distance = torch.cdist(x.to(torch.float64).reshape(-1, x.shape[-1]), self.centres)
        values = _phi(distance / self.width, self.kernel) @ self.coefficients
        return values.reshape(*x.shape[:-1], -1).to(x.dtype)


def _phi(z: Tensor, kernel: Kernel) -> Tensor:
    return torch.exp(-z) if kernel == "exponential" else torch.exp(-z.square())


def apart(centres: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Leave out centres [R, D] that lie within 1e-6 of an earlier one; their values [R, E] are averaged into it."""
    from scipy.spatial import KDTree

    owner = np.arange(len(centres))
    for first, second in sorted(KDTree(centres).query_pairs(CLOSEST_CENTRES)):
        owner[second] = min(owner[second], owner[first])
    kept, member_of = np.unique(owner, return_inverse=True)
    sums = np.zeros((len(kept), values.shape[1]))
    np.add.at(sums, member_of, values)
    return centres[kept], sums / np.bincount(member_of)[:, None]


def cluster_means(
    points: NDArray[np.float64], values: NDArray[np.float64], count: int, *, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K-means of points [N, D]: at most `count` centres [R, D] and the mean value [R, E] of each one's members."""
    if len(points) <= count:
        return points, values
    from sklearn.cluster import KMeans

    clusters = KMeans(count, n_init=1, max_iter=50, random_state=seed).fit(points)
    members = np.bincount(clusters.labels_, minlength=count)
    sums = np.zeros((count, values.shape[1]))
    np.add.at(sums, clusters.labels_, values)
    kept = members > 0
    return clusters.cluster_centers_[kept], sums[kept] / members[kept, None]


def closest_distance(points: NDArray[np.float64]) -> float:
    """Distance between the two closest different points [N, D]; 1 where there are none."""
    from scipy.spatial import KDTree

    if len(points) < 2:
        return 1.0
    nearest = KDTree(points).query(points, k=2)[0][:, 1]
    nearest = nearest[nearest > CLOSEST_CENTRES]
    return float(nearest.min()) if len(nearest) else 1.0


def median_distance(points: NDArray[np.float64]) -> float:
    """Median distance over all pairs of points [N, D]; 1 where there are none."""
    from scipy.spatial.distance import pdist

    return float(np.median(pdist(points))) or 1.0 if len(points) > 1 else 1.0
