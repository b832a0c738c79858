"""Markers to the channels of a head whose shapes are unknown, learned from a few frames that somebody posed by hand.

Deng 2006, §5.2.3: motion frames are reduced by PCA, an artist poses the head like some of them, and radial basis functions
carry these pairs over to all other frames.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from facesynth.face.animation import FaceAnimation
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.pca import Pca
from facesynth.motion.rbf import RbfMap, median_distance

FEWEST_PAIRS = 2
VARIANCE = 0.999
"""Share of the recorded movement that the components keep."""
LINEAR_RIDGE = 0.03
"""Share of the mean squared length of a pose that is added to the diagonal of the linear part."""
WIDTH = 2.0
"""Width of the Gaussians, in median distances of two poses."""
RBF_RIDGE = 0.1
"""Share of the mean diagonal that is added to it: weights set by hand are off by a tenth, and are not met exactly."""
SAME_POSE = 1e-3
"""Frames are the same pose where they are nearer than this share of the median distance."""


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """K frames of a performer, each beside the weights with which somebody posed a head like it."""

    layout: Layout
    """What the C channels of the frames are."""
    names: tuple[str, ...]
    """N channels of the head."""
    frames: Floats
    """[K, C] in the layout's unit, head motion removed."""
    weights: Floats
    """[K, N] in the channels' own ranges."""

    def __post_init__(self) -> None:
        frames, weights = np.asarray(self.frames, np.float64), np.asarray(self.weights, np.float64)
        if len(frames) != len(weights) or len(frames) < FEWEST_PAIRS:
            raise FacesynthError(
                f"at least {FEWEST_PAIRS} key poses with their weights are needed, ten to twenty are good;"
                f" got {len(frames)} frames and {len(weights)} rows of weights"
            )
        if frames.shape[1:] != (self.layout.channels,) or weights.shape[1:] != (len(self.names),):
            raise FacesynthError(
                f"key poses need frames [K, {self.layout.channels}] and weights [K, {len(self.names)}];"
                f" got {list(frames.shape)} and {list(weights.shape)}"
            )
        for what, values in (("frames", frames), ("weights", weights)):
            if not np.isfinite(values).all():
                number = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0]) + 1
                raise FacesynthError(f"key pose {number}: its {what} hold missing or infinite values; choose another frame")
        object.__setattr__(self, "frames", frames)
        object.__setattr__(self, "weights", weights)
        _check_different(frames)


def _check_different(frames: Floats) -> None:
    from scipy.spatial.distance import pdist, squareform

    apart = squareform(pdist(frames))
    same = np.argwhere(np.triu(apart <= SAME_POSE * median_distance(frames), k=1))
    if len(same):
        one, other = (same[0] + 1).tolist()
        raise FacesynthError(f"key poses {one} and {other} are the same pose of the performer; leave one of them out")


# With z the components of a frame's displacement from rest, the weights are those of the linear map that is nearest to
# the K pairs and to 0 (ridge), and what it misses of the pairs, spread by Gaussians:
#   w(z) = z A + sum_k c_k exp(-|z - z_k|² / width²),   A = Z' (Z Z' + lambda I)^-1 W.
# The rest pose with weights 0 is a pair that nobody need give. Without the linear part few poses would fade into rest
# between each other.
class KeyPoseMap(nn.Module):
    """Weights [T, N] of a head from frames [T, C] of a performer."""

    rest: Tensor
    """[C]"""
    basis: Tensor
    """[C, D] components of the displacement."""
    linear: Tensor
    """[D, N]"""
    ranges: Tensor
    """[N, 2] within which the weights stay."""

    def __init__(self, layout: Layout, names: tuple[str, ...], tensors: dict[str, Tensor], residual: RbfMap) -> None:
        super().__init__()
        self.layout, self.names, self.residual = layout, names, residual
        for name, tensor in tensors.items():
            self.register_buffer(name, tensor)

    @classmethod
    def fit(cls, poses: KeyPoses, rest: ArrayLike, recorded: ArrayLike | None = None) -> Self:
        """Learn from key poses.

        Parameters
        ----------
        rest : [C] the performer's rest pose, at which all weights are 0
        recorded : [T, C] more of the performer's frames, from which the components are then learned
        """
        at_rest = np.asarray(rest, np.float64)
        moved = poses.frames - at_rest
        seen = moved if recorded is None else np.asarray(recorded, np.float64) - at_rest
        basis = Pca.fit(np.concatenate([seen, -seen]), VARIANCE).basis.to(torch.float64)  # about the rest, not the mean
        Z = np.concatenate([np.zeros((1, basis.shape[1])), moved @ basis.numpy()])
        W = np.concatenate([np.zeros((1, len(poses.names))), poses.weights])
        gram = Z @ Z.T
        A = Z.T @ np.linalg.solve(gram + LINEAR_RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram)), W)
        residual = RbfMap.fit(Z, W - Z @ A, width=WIDTH * median_distance(Z), kernel="gaussian", ridge=RBF_RIDGE)
        ranges = np.stack([np.minimum(W.min(axis=0), 0), np.maximum(W.max(axis=0), 1)], axis=1)
        arrays = {"rest": at_rest, "linear": A, "ranges": ranges}
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()} | {"basis": basis}
        return cls(poses.layout, poses.names, tensors, residual)

    def forward(self, frames: Tensor) -> Tensor:
        """Weights [..., N] within their ranges of frames [..., C], in the frames' precision."""
        z = (frames.to(self.rest.dtype) - self.rest) @ self.basis
        weights = z @ self.linear + self.residual(z)
        return weights.clamp(self.ranges[:, 0], self.ranges[:, 1]).to(frames.dtype)

    def animation(self, motion: Motion) -> FaceAnimation:
        """A motion of the same performer as an animation of the head's channels; head and gaze are the motion's own."""
        if motion.layout.names != self.layout.names or motion.layout.kind != self.layout.kind:
            raise FacesynthError(
                f"the key poses are of {len(self.layout.names)} {self.layout.kind}, the motion has"
                f" {len(motion.layout.names)} {motion.layout.kind} or others; take both from one performer"
            )
        with torch.no_grad():
            weights = self(torch.as_tensor(motion.frames, dtype=self.rest.dtype, device=self.rest.device)).cpu().numpy()
        count = len(motion)
        head = np.zeros((count, 6)) if motion.head is None else motion.head
        gaze = np.zeros((count, 2)) if motion.eyes is None else motion.eyes[:, 1:]
        return FaceAnimation(self.names, weights, head, gaze, np.zeros(count), motion.fps, ranges=self.ranges.cpu().numpy())


def worth_posing(frames: ArrayLike, rest: ArrayLike, count: int) -> NDArray[np.int64]:
    """[count] numbers of frames [T, C] that differ most from rest and from each other: each is the farthest from those before."""
    moved = np.asarray(frames, np.float64) - np.asarray(rest, np.float64)
    if not 1 <= count <= len(moved):
        raise FacesynthError(f"of {len(moved)} frames, 1 to {len(moved)} can be worth posing; got {count}")
    apart, chosen = np.linalg.norm(moved, axis=1), []
    for _ in range(count):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.linalg.norm(moved - moved[chosen[-1]], axis=1))
    return np.array(chosen)
