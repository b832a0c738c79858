"""A performer's points on the built-in head: which vertex each belongs to, and how large its movement is there.

Points whose names are known (those of the head's own markers, of the 468 landmarks that video gives, of usual sensors) say
so themselves. Others are laid on the head by a rigid fit with one scale, bent onto it by radial basis functions, and take
the nearest vertex of their part of the face.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import HEAD_MARKERS, INNER_LIPS, marker_layout
from facesynth.face.solve.landmark_names import KNOWN_POINTS, LANDMARKS
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion
from facesynth.motion.arkit_names import ARKIT_NAMES

ENOUGH_NAMES = 12
"""From so many known points on, the others are left out: they would not move as surely."""
FEWEST_FOR_SHAPE = 6
"""From so many known points on, their shape tells turn and scale; below, axes and millimetres are taken at their word."""
SCALES = (0.6, 1.6)
"""A face in mm is at most so much smaller or larger than the head."""
FARTHEST_MM = 25.0
"""Points that lie farther from the skin after the fit belong to something else."""
REST_SHARE = 0.1
ROUNDS = 15
GROUPS = ("upper_lip", "lower_lip", "jaw", "brows", "eyelids", "cheeks", "forehead", "nose")
HELD = 5
"""The middle of a group counts as so many points."""
FEWEST_GROUPS = 4
FRONT_MM = 60.0
"""Skin in front of this depth is the face."""
JAW_MM = 2.0
"""The lower lip moves more than this under a full jawOpen, the upper one less."""
INNER = ("tongue", "teeth")
LIPS = ("upper_lip", "lower_lip")


@dataclass(frozen=True, eq=False)
class LayoutFit:
    """M of a layout's K points on the head."""

    points: NDArray[np.int64]
    """[M] numbers of the points that were placed."""
    vertices: NDArray[np.int64]
    """[M] vertex of the head under each."""
    linear: Floats
    """[D, 3] from movements in the layout's axes and unit to millimetres on the head."""
    neutral: Floats
    """[K, D] the performer's rest."""
    shift_mm: Floats
    """[3] where the layout's origin lies on the head."""
    distance_mm: Floats
    """[M] from each placed point to its vertex after the fit without bending."""
    named: bool
    """Whether names, not nearness, placed the points."""
    lip_pairs: NDArray[np.int64]
    """[P, 2] places among the M points of the inner lips that face each other: upper, lower."""

    def on_head(self, rig: Rig, frames: ArrayLike) -> Floats:
        """[T, M, 3] mm: the vertices of the head, moved as the points of frames [T, C] moved from their rest.

        The performer's rest is shut lips, however far apart their points then are: under a moustache 6 mm. Points of
        pressed lips come nearer still; on the head lips that have met stay so, and do not pass through each other.
        """
        values = np.asarray(frames, np.float64).reshape(len(np.asarray(frames)), *self.neutral.shape)
        placed = rig.rest_mm[self.vertices] + (values[:, self.points] - self.neutral[self.points]) @ self.linear
        upper, lower = self.lip_pairs.T
        crossed_mm = np.maximum(placed[:, lower, 1] - placed[:, upper, 1], 0.0)
        placed[:, upper, 1] += crossed_mm / 2
        placed[:, lower, 1] -= crossed_mm / 2
        return placed

    def placed_mm(self) -> Floats:
        """[K, 3] the performer's rest in the head's axes."""
        return self.neutral @ self.linear + self.shift_mm


def fit_layout(rig: Rig, layout: Layout, neutral: ArrayLike | None = None) -> LayoutFit:
    """Place a layout of points on the head. neutral: [C] the rest pose, where the layout has none."""
    rest = layout.neutral if neutral is None else neutral
    if layout.dimension < 2 or rest is None:
        raise FacesynthError(
            "points are placed on the head by their rest pose: give the layout `neutral`, or a motion to take it from"
        )
    shape = np.asarray(rest, np.float64).reshape(len(layout.names), layout.dimension)
    if not np.isfinite(shape).all():
        lost = [name for name, point in zip(layout.names, shape, strict=True) if not np.isfinite(point).all()]
        raise FacesynthError(f"the rest pose lacks the points {', '.join(lost[:5])}; leave them out of the layout, or fill them")
    named, vertices = _by_names(rig, layout)
    if layout.kind == "landmarks" and len(named) < 3:
        raise FacesynthError("2-D points are placed on the head by their names: call at least three as in docs/capture.md")
    linear, shift = _aligned(rig, layout, shape, named, vertices)
    placed = shape @ linear + shift
    if len(named) >= ENOUGH_NAMES or (len(named) and len(named) >= len(layout.names) // 2):
        off = np.linalg.norm((placed[named] - rig.rest_mm[vertices])[:, : layout.dimension], axis=1)
        return LayoutFit(named, vertices, linear, shape, shift, off, True, _facing(layout, named))
    points, nearest = _nearest(rig, layout, _bent(rig, placed, named, vertices))
    if len(points) < 3:
        raise FacesynthError(
            f"only {len(points)} of {len(layout.names)} points lie on the face: are its axes left, up, out of the face?"
        )
    off = np.linalg.norm(placed[points] - rig.rest_mm[nearest], axis=1)
    return LayoutFit(points, nearest, linear, shape, shift, off, False, _facing(layout, points))


def _facing(layout: Layout, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """[P, 2] pairs of the layout's inner lips of which both points were placed, as places among those."""
    place = {int(point): number for number, point in enumerate(points)}
    pairs = [(place[upper], place[lower]) for upper, lower in layout.lip_pairs if upper in place and lower in place]
    return np.array(pairs, np.int64).reshape(-1, 2)


def rest_of(motion: Motion) -> Floats:
    """[C] the rest pose: the layout's, else the median of the frames in which the lips are nearest, else of all."""
    if motion.layout.neutral is not None:
        return np.asarray(motion.layout.neutral, np.float64)
    frames = motion.frames
    if motion.layout.lip_pairs:
        gap = lip_gap(motion)
        frames = frames[gap <= np.nanquantile(gap, REST_SHARE)]
    return np.nanmedian(frames, axis=0).astype(np.float64)


def is_of_the_head(layout: Layout) -> bool:
    """Whether every point is one of the head's own markers."""
    own = {name for region in HEAD_MARKERS.values() for name, _ in region}
    return layout.kind == "markers" and set(layout.names) <= own


def _by_names(rig: Rig, layout: Layout) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the points whose names are known, and their vertices."""
    source = {name: vertex for region in HEAD_MARKERS.values() for name, vertex in region}
    meant = {name: LANDMARKS.get(name) or KNOWN_POINTS.get(_folded(name), name) for name in layout.names}
    known = [(number, source[meant[name]]) for number, name in enumerate(layout.names) if meant[name] in source]
    points, vertices = np.array(known, np.int64).reshape(-1, 2).T
    return points, rig.from_source(vertices)


def _folded(name: str) -> str:
    return "".join(letter for letter in name.rpartition(":")[2].lower() if letter.isalnum())


def _aligned(
    rig: Rig, layout: Layout, shape: Floats, named: NDArray[np.int64], vertices: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """The linear map [D, 3] and the shift [3] that lay the rest [K, D] on the head."""
    target = rig.rest_mm[vertices].astype(np.float64)
    if layout.kind == "landmarks":
        turn, scale, shift = similarity(shape[named], target[:, :2])
        linear = np.zeros((2, 3))
        linear[:, :2] = scale * turn
        return linear, np.append(shift, target[:, 2].mean())
    if len(named) >= FEWEST_FOR_SHAPE:
        turn, scale, shift = similarity(shape[named], target)
        return np.clip(scale, *SCALES) * turn, shift if SCALES[0] <= scale <= SCALES[1] else _shift(
            shape[named], target, turn, scale
        )
    if len(named):
        return np.eye(3), target.mean(axis=0) - shape[named].mean(axis=0)
    return _closest(rig, layout, shape)


def _shift(points: Floats, target: Floats, turn: Floats, scale: float) -> Floats:
    return target.mean(axis=0) - points.mean(axis=0) @ turn * np.clip(scale, *SCALES)


def similarity(points: Floats, target: Floats) -> tuple[Floats, float, Floats]:
    """Rotation R, scale s and shift t with `s points R + t` closest to target, both [N, D] (Umeyama 1991, equations 39-42)."""
    a, b = points - points.mean(axis=0), target - target.mean(axis=0)
    U, S, Vt = np.linalg.svd(a.T @ b)
    proper = np.ones(len(S))
    proper[-1] = np.sign(np.linalg.det(U @ Vt))
    R = U @ np.diag(proper) @ Vt
    s = float((S * proper).sum() / max(np.square(a).sum(), 1e-12))
    return R, s, target.mean(axis=0) - s * points.mean(axis=0) @ R


def _closest(rig: Rig, layout: Layout, shape: Floats) -> tuple[Floats, Floats]:
    """Without known names: the axes at their word, then nearest points in turns with the best similarity.

    Middles of groups that both have (mouth, brows, …) keep the face from sliding along itself.
    """
    from scipy.spatial import KDTree

    face = rig.rest_mm[_face(rig)].astype(np.float64)
    tree = KDTree(face)
    middles, places = _middles(rig, layout, shape)
    held, towards = np.repeat(middles, HELD, axis=0), np.repeat(places, HELD, axis=0)
    scale = float(np.clip(np.ptp(face, axis=0)[:2].mean() / max(np.ptp(shape, axis=0)[:2].mean(), 1e-9), *SCALES))
    R, s, t = (
        np.eye(3),
        scale,
        (np.ptp(face, axis=0) / 2 + face.min(axis=0)) - scale * (np.ptp(shape, axis=0) / 2 + shape.min(axis=0)),
    )
    if len(middles) >= FEWEST_GROUPS:
        R, s, t = similarity(middles, places)
    for _ in range(ROUNDS):
        points, target = np.concatenate([shape, held]), np.concatenate([face[tree.query(s * shape @ R + t)[1]], towards])
        R, s, _ = similarity(points, target)
        s = float(np.clip(s, *SCALES))
        t = _shift(points, target, R, s)
    return s * R, t


def _middles(rig: Rig, layout: Layout, shape: Floats) -> tuple[Floats, Floats]:
    """[G, 3] middles of the layout's groups, and of the head's markers in the same groups."""
    own = marker_layout(rig)
    rest = own.points(np.asarray(own.neutral))
    shared = [group for group in GROUPS if group in layout.groups]
    middles = [shape[layout.group(group)].mean(axis=0) for group in shared]
    places = [rest[own.group(group)].mean(axis=0) for group in shared]
    return np.reshape(middles, (-1, 3)), np.reshape(places, (-1, 3))


def _bent(rig: Rig, placed: Floats, named: NDArray[np.int64], vertices: NDArray[np.int64]) -> Floats:
    """Placed points [K, 3], pulled so that the known ones among them lie on their vertices."""
    if len(named) < 2:
        return placed
    import torch

    from facesynth.motion.rbf import RbfMap, median_distance

    pull = rig.rest_mm[vertices] - placed[named]
    bend = RbfMap.fit(placed[named], pull, width=median_distance(placed[named]), kernel="exponential", ridge=1e-3)
    return placed + bend(torch.from_numpy(placed)).numpy()


def _face(rig: Rig) -> NDArray[np.int64]:
    """Vertices of the face's skin."""
    skin = rig.vertices_of("skin")
    return skin[
        (rig.rest_mm[skin, 2] > FRONT_MM)
        & (rig.head_weight[skin] > 0.99)
        & (np.abs(rig.shapes_mm[:, skin]).max(axis=(0, 2)) > 0.05)
    ]


def _nearest(rig: Rig, layout: Layout, placed: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Points that lie on the face, and the vertex of each: lips that touch must not be taken for each other."""
    from scipy.spatial import KDTree

    face = _face(rig)
    falls = -rig.shapes_mm[ARKIT_NAMES.index("jawOpen"), face, 1] > JAW_MM
    vertices = face[KDTree(rig.rest_mm[face]).query(placed)[1]]
    for lip, lower in zip(LIPS, (False, True), strict=True):
        members = np.asarray(layout.groups.get(lip, ()), np.int64)
        own = face[falls == lower]
        if len(members):
            vertices[members] = own[KDTree(rig.rest_mm[own]).query(placed[members])[1]]
    upper_lower = rig.from_source(np.array(INNER_LIPS)).reshape(-1, 2)
    for pair in layout.lip_pairs:
        across = placed[list(pair), 0].mean()
        vertices[list(pair)] = upper_lower[np.abs(rig.rest_mm[upper_lower[:, 0], 0] - across).argmin()]
    near = np.linalg.norm(placed - rig.rest_mm[vertices], axis=1) <= FARTHEST_MM
    for group in INNER:
        near[list(layout.groups.get(group, ()))] = False
    return np.flatnonzero(near), vertices[near]
