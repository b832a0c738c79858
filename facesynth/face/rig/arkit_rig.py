"""A head that 52 ARKit weights, a head pose and a gaze move."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.anny import PARTS, build_head, head_folder, head_key
from facesynth.face.rig.arkit import checked_weights, eye_rotations, gaze_weights
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_arrays
from facesynth.motion.arkit_names import ARKIT_NAMES

PIVOT_MM = np.array([0.0, -105.0, 35.0])
"""The head turns about this point, at the top of the neck."""

_TONGUE_LIFT_MM = 4.5


@dataclass(frozen=True, eq=False)
class Rig:
    """V vertices and Q quads in mm; x to the performer's left, y up, z out of the face, origin between the eyes."""

    rest_mm: NDArray[np.float32]
    """[V, 3] face at rest, mouth closed."""
    shapes_mm: NDArray[np.float32]
    """[52, V, 3] displacement at weight 1, in the order of `names`."""
    quads: NDArray[np.int32]
    """[Q, 4] counter-clockwise seen from outside; a triangle repeats its last corner."""
    part: NDArray[np.int32]
    """[V] index into PARTS."""
    quad_part: NDArray[np.int32]
    """[Q] index into PARTS."""
    corner_uv: NDArray[np.float32]
    """[Q, 4, 2] texture coordinates, v upwards; by corner, because the map has seams."""
    source_index: NDArray[np.int32]
    """[V] vertex number in the uncropped source mesh, increasing."""
    head_weight: NDArray[np.float32]
    """[V] share of the head's motion that a vertex follows."""

    @property
    def names(self) -> tuple[str, ...]:
        """The 52 shapes, in the column order of Live Link Face."""
        return ARKIT_NAMES

    def index(self, *names: str) -> list[int]:
        """Positions of shapes in `names`."""
        return [ARKIT_NAMES.index(name) for name in names]

    def vertices_of(self, *parts: str) -> NDArray[np.int64]:
        """Vertex indices of the named parts."""
        return np.nonzero(np.isin(self.part, [PARTS.index(name) for name in parts]))[0]

    def from_source(self, source_index: ArrayLike) -> NDArray[np.int64]:
        """Vertex indices of vertices given by their number in the source mesh."""
        wanted = np.asarray(source_index, np.int64)
        found = np.minimum(np.searchsorted(self.source_index, wanted), len(self.source_index) - 1)
        if (self.source_index[found] != wanted).any():
            raise FacesynthError(f"source vertices {wanted[self.source_index[found] != wanted].tolist()} are not on this head")
        return found

    def vertices(self, animation: FaceAnimation, k: int) -> NDArray[np.float32]:
        """[V, 3] mm at frame k of an animation; shapes that it lacks stay at rest."""
        weights = animation.weights_for(self.names)[k]
        return pose(self, weights, animation.head[k], animation.gaze[k], float(animation.tongue_up[k]))

    @cached_property
    def _eyeballs(self) -> tuple[tuple[NDArray[np.int64], NDArray[np.float64]], ...]:
        """Vertices and centre of the left and of the right eye."""
        return tuple((self.vertices_of(f"{side}_eye"), self.eye_centre_mm(side)) for side in ("left", "right"))

    def eye_centre_mm(self, side: str) -> NDArray[np.float64]:
        """[3] centre of the eyeball, `left` or `right`; the cornea bulges beyond its sphere to the front."""
        ball = self.rest_mm[self.vertices_of(f"{side}_eye")].astype(np.float64)
        low, high = ball.min(axis=0), ball.max(axis=0)
        radius = (high[0] - low[0]) / 2
        return np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] + radius])


def load_head() -> Rig:
    """The built-in head: 6,202 vertices, 6,030 quads; read from its package once, then from the user's cache."""
    folder = head_folder()
    path = cache_dir("head") / f"head-{head_key(folder)}.npz"
    if path.is_file():
        try:
            return Rig(**read_arrays(path, "a head", [field.name for field in fields(Rig)]))
        except FacesynthError:
            path.unlink(missing_ok=True)  # damaged: it can be built again
    arrays = build_head(folder)
    with atomic_path(path) as part:
        np.savez_compressed(part, allow_pickle=False, **arrays)
    return Rig(**arrays)


def pose(
    rig: Rig,
    weights: ArrayLike,
    head: ArrayLike | None = None,
    gaze: ArrayLike | None = None,
    tongue_up: float = 0.0,
    skin_mm: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Vertices [V, 3] in mm of one frame.

    Parameters
    ----------
    weights : [52], 0..1
    head : [6] rotation vector (rad) and translation (mm) about `PIVOT_MM`; None is at rest
    gaze : [2] rad to the performer's left and up; replaces the eyeLook weights. None follows those weights
    tongue_up : 0..1, lifts the tip of the tongue, for which ARKit has no shape
    skin_mm : [V, 3] displacements that are added to those of the weights, before the head turns
    """
    values = checked_weights(weights)[None]
    if gaze is not None:
        values = gaze_weights(values, np.asarray(gaze, np.float64)[None])
    active = np.nonzero(values[0])[0]
    vertices = rig.rest_mm + np.tensordot(values[0, active].astype(np.float32), rig.shapes_mm[active], 1)
    for (ball, centre), turn in zip(rig._eyeballs, eye_rotations(values[0]), strict=True):
        vertices[ball] = turn.apply(rig.rest_mm[ball] - centre) + centre
    if skin_mm is not None:
        vertices += np.asarray(skin_mm, np.float32)
    if tongue_up:
        _lift_tongue(rig, vertices, tongue_up)
    return vertices if head is None else _follow_head(vertices[None], rig.head_weight, np.asarray(head)[None])[0]


def pose_points(rig: Rig, vertex_indices: ArrayLike, weights: ArrayLike, head: ArrayLike | None = None) -> NDArray[np.float32]:
    """Tracks [T, K, 3] in mm of K skin vertices under weights [T, 52] and head [T, 6]; linear in the weights."""
    index = np.asarray(vertex_indices, np.int64)
    values = checked_weights(weights)
    basis = rig.shapes_mm[:, index].reshape(len(ARKIT_NAMES), -1).astype(np.float64)
    points = rig.rest_mm[index] + (values @ basis).reshape(-1, len(index), 3)
    if head is not None:
        points = _follow_head(points, rig.head_weight[index], np.asarray(head))
    return points.astype(np.float32)


def _lift_tongue(rig: Rig, vertices: NDArray[np.float32], amount: float) -> None:
    tongue = rig.vertices_of("tongue")
    along = np.clip((rig.rest_mm[tongue, 2] - 108) / 24, 0, 1)  # 0 at the root, 1 at the tip
    vertices[tongue, 1] += _TONGUE_LIFT_MM * amount * along**2 * (3 - 2 * along)
    vertices[tongue, 2] -= 1.5 * amount * along


def _follow_head(points: NDArray, head_weight: NDArray[np.float32], head: NDArray) -> NDArray:
    """Blend [T, K, 3] points between standing still and moving rigidly with head [T, 6]."""
    if head.shape != (len(points), 6):
        raise FacesynthError(f"head must have shape [{len(points)}, 6]: rotation vector and translation; got {head.shape}")
    turn = Rotation.from_rotvec(head[:, :3]).as_matrix()
    moved = (points - PIVOT_MM) @ np.swapaxes(turn, 1, 2) + PIVOT_MM + head[:, None, 3:]
    return (points + head_weight[:, None] * (moved - points)).astype(points.dtype)
