"""The pose of the head: taken out of points that move with it, and put back.

A pose [6] is a rotation vector (rad; the rotation acts on column vectors, about the centroid of the neutral rigid
points) followed by a translation (mm).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.gaps import LONGEST_S, missing_in, runs

FEWEST_POINTS = 3
_THIN = 1e-4
"""Points whose second spread is under this share of the first lie on a line, which can turn unseen."""


def rigid_points(layout: Layout) -> NDArray[np.int64]:
    """The points that a pose is measured on: the layout's group `rigid`, or all where it has none."""
    return layout.group("rigid") if "rigid" in layout.groups else np.arange(len(layout.names))


def remove_head(
    points: NDArray[np.floating], neutral: ArrayLike, rigid: ArrayLike
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Take the head's motion out of points [T, K, 3]; returns the stabilised points [T, K, 3] and the poses [T, 6].

    neutral: [K, 3] the rest pose; rigid: indices of the points that move with the skull alone. Frames in which fewer
    than three rigid points are present, or only some on one line, have no pose: they are NaN in both results.
    """
    neutral, rigid = np.asarray(neutral, np.float64), np.asarray(rigid, np.int64)
    world = np.asarray(points, np.float64)
    if world.ndim != 3 or world.shape[1:] != neutral.shape or neutral.shape[1:] != (3,):
        raise FacesynthError(f"points must have shape [T, K, 3] and neutral [K, 3]; got {world.shape} and {neutral.shape}")
    if len(rigid) < FEWEST_POINTS or not _spans_a_plane(neutral[rigid]):
        raise FacesynthError(f"a pose needs at least three rigid points that are not on one line; got {len(rigid)}")
    head = _poses(world[:, rigid], neutral[rigid])
    stabilised = _moved_back(world, head, neutral[rigid].mean(axis=0))
    return stabilised.astype(np.float32), head.astype(np.float32)


def apply_head(
    points: NDArray[np.floating], head: NDArray[np.floating], neutral: ArrayLike, rigid: ArrayLike
) -> NDArray[np.float32]:
    """Put poses [T, 6] back on stabilised points [T, K, 3]: the inverse of `remove_head`."""
    centre = np.asarray(neutral, np.float64)[np.asarray(rigid, np.int64)].mean(axis=0)
    turns = _matrices(head)
    moved = (points - centre) @ turns.transpose(0, 2, 1) + centre + np.asarray(head, np.float64)[:, None, 3:]
    return moved.astype(np.float32)


def fill_head(head: NDArray[np.float32], fps: float) -> NDArray[np.float32]:
    """Fill short gaps of poses [T, 6]: rotations on the great arc, translations by cubic splines."""
    missing = missing_in(head)
    known = np.flatnonzero(~missing)
    inner = [g for g in runs(missing) if g.start > 0 and g.stop < len(head) and len(g) <= LONGEST_S * fps + 1e-6]
    filled = np.where(missing[:, None], np.float32(np.nan), head)
    if inner:
        wanted = np.concatenate([np.arange(gap.start, gap.stop) for gap in inner])
        filled[wanted, :3] = Slerp(known, Rotation.from_rotvec(head[known, :3]))(wanted).as_rotvec()
        filled[wanted, 3:] = CubicSpline(known, head[known, 3:].astype(np.float64))(wanted)
    return filled


def _poses(world: NDArray[np.float64], neutral: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kabsch for every frame over the rigid points that are present in it: world [T, R, 3], neutral [R, 3] → [T, 6].

    Deng 2008, equations 1 and 2, with both shapes centred on the same points and reflections excluded:
    `X_0^T X_i = U S V^T`, `R = V diag(1, 1, det(V U^T)) U^T`. The translation refers to the centroid of all rigid
    points, so that it does not jump where one of them is missing.
    """
    present = ~missing_in(world)
    enough = present.sum(axis=1) >= FEWEST_POINTS
    weights = (
        np.where(enough[:, None], present, True)[..., None] / np.where(enough, present.sum(axis=1), len(neutral))[:, None, None]
    )
    known = np.where(present[..., None], world, 0.0)
    world_centre = (weights * known).sum(axis=1)
    neutral_centre = (weights * neutral).sum(axis=1)
    spread = weights * (neutral - neutral_centre[:, None])
    U, S, Vt = np.linalg.svd(spread.transpose(0, 2, 1) @ (known - world_centre[:, None]))
    V, Ut = Vt.transpose(0, 2, 1), U.transpose(0, 2, 1)
    proper = np.ones_like(S)
    proper[:, 2] = np.linalg.det(V @ Ut)
    R = (V * proper[:, None]) @ Ut
    centre = neutral.mean(axis=0)
    shift = world_centre - centre + np.einsum("tij,tj->ti", R, centre - neutral_centre)
    poses = np.concatenate([Rotation.from_matrix(R).as_rotvec(), shift], axis=1)
    poses[~enough | (S[:, 1] <= _THIN * S[:, 0])] = np.nan
    return poses


def _moved_back(world: NDArray[np.float64], head: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    return (world - centre - head[:, None, 3:]) @ _matrices(head) + centre


def _matrices(head: NDArray[np.floating]) -> NDArray[np.float64]:
    """[T, 3, 3] rotations of poses [T, 6]; NaN where a pose is missing."""
    rotvecs = np.asarray(head, np.float64)[:, :3]
    missing = missing_in(rotvecs)
    matrices = Rotation.from_rotvec(np.where(missing[:, None], 0.0, rotvecs)).as_matrix()
    matrices[missing] = np.nan
    return matrices


def _spans_a_plane(points: NDArray[np.float64]) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > np.sqrt(_THIN) * spread[0])
