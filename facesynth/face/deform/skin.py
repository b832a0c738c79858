"""A face whose skin follows the markers themselves, not the weights that were solved from them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from facesynth.face.animation import FaceAnimation
from facesynth.face.deform.mesh_distance import MeshDistanceDeformer
from facesynth.face.deform.regions import RegionDeformer
from facesynth.face.rig.arkit import BLINKS
from facesynth.face.rig.arkit_rig import Rig, pose
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.face.solve.fitting import fit_layout, is_of_the_head, rest_of
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.resample import resample

DEFORMERS = {"distance": MeshDistanceDeformer, "regions": RegionDeformer}
"""Ways from markers to a mesh, by the name that people choose them with."""


@dataclass(frozen=True, eq=False)
class MarkerSkin:
    """Vertices of a rig under a motion of markers, one frame after the other; made by `marker_skin`."""

    rig: Rig
    deformer: nn.Module
    animation: FaceAnimation
    """Gives head, gaze, tongue and blinks."""
    frames: NDArray[np.float32]
    """[T, 3K] markers at the animation's rate, mm."""
    blinks: Floats
    """[T, 2] left and right: what of the animation's blinks the markers do not show."""

    def vertices(self, k: int) -> NDArray[np.float32]:
        """[V, 3] mm at frame k."""
        a = self.animation
        with torch.no_grad():
            moved = self.deformer(torch.from_numpy(self.frames[k : k + 1]))[0].numpy()
        lids = np.zeros(len(self.rig.names))
        lids[_lids(self.rig)] = self.blinks[k]
        return pose(self.rig, lids, a.head[k], a.gaze[k], float(a.tongue_up[k]), skin_mm=moved)


def marker_skin(way: str, rig: Rig, motion: Motion, animation: FaceAnimation) -> MarkerSkin:
    """The skin of a rig under a motion of markers, deformed in one of `DEFORMERS`.

    Points of a performer's own layout count where they are known to lie on one of the head's markers. Blinks that the
    animation adds, and that the eyelid markers do not show, come on top of the deformation.
    """
    if way not in DEFORMERS:
        raise unknown("way to deform", way, tuple(DEFORMERS))
    if motion.layout.kind != "markers":
        raise FacesynthError(f"a mesh is deformed by 3-D markers in mm; this model makes {motion.layout.kind}")
    motion = on_head_markers(rig, motion)
    frames = resample(motion, animation.fps).frames
    if len(frames) != len(animation):
        raise FacesynthError(f"motion and animation differ in length: {len(frames)} and {len(animation)} frames")
    deformer = DEFORMERS[way](rig, motion.layout)
    seen = shown_blinks(rig, motion.layout, frames)
    missing = np.maximum(animation.weights[:, _lids(rig)] - seen, 0.0)
    return MarkerSkin(rig, deformer, animation, np.ascontiguousarray(frames, np.float32), missing)


def on_head_markers(rig: Rig, motion: Motion) -> Motion:
    """A motion of any points as one of those of the head's markers that the points are known to lie on, mm."""
    if is_of_the_head(motion.layout):
        return motion
    fit = fit_layout(rig, motion.layout, rest_of(motion))
    own = marker_layout(rig)
    marker_at = {vertex: number for number, vertex in enumerate(marker_vertices(rig, own).tolist())}
    point_of = {marker_at[v]: k for k, v in enumerate(fit.vertices.tolist()) if v in marker_at}
    if not fit.named:
        raise FacesynthError(
            f"too few of these points have names of known places ({', '.join(motion.layout.names[:3])} …) to move the skin "
            "by them; let the solved shapes move it"
        )
    kept = sorted(point_of)
    placed = fit.on_head(rig, motion.frames)[:, [point_of[marker] for marker in kept]]
    return Motion(placed.reshape(len(motion), -1).astype(np.float32), motion.fps, _only(own, kept))


def _only(layout: Layout, kept: list[int]) -> Layout:
    """A layout of some of its points."""
    place = {old: new for new, old in enumerate(kept)}
    groups = {name: tuple(place[k] for k in members if k in place) for name, members in layout.groups.items()}
    pairs = tuple((place[a], place[b]) for a, b in layout.lip_pairs if a in place and b in place)
    neutral = np.asarray(layout.neutral).reshape(-1, 3)[kept]
    names = tuple(layout.names[k] for k in kept)
    return Layout(layout.kind, names, {name: g for name, g in groups.items() if g}, pairs, tuple(neutral.ravel().tolist()))


def shown_blinks(rig: Rig, layout: Layout, frames: NDArray[Any]) -> Floats:
    """[T, 2] 0..1 how far marker frames [T, 3K] show the left and the right eye shut, by projection on the blink shapes."""
    vertices = marker_vertices(rig, layout)
    rest = rig.rest_mm[vertices].ravel() if layout.neutral is None else np.asarray(layout.neutral)
    shapes = rig.shapes_mm[_lids(rig)][:, vertices].reshape(2, -1).astype(np.float64)
    energy = np.maximum(np.square(shapes).sum(axis=1), 1e-9)
    return np.clip((np.asarray(frames, np.float64) - rest) @ shapes.T / energy, 0.0, 1.0)


def _lids(rig: Rig) -> list[int]:
    return list(rig.index(*BLINKS))
