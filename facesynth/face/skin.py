"""A face whose skin follows the markers themselves, not the weights that were solved from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from facesynth.errors import FacesynthError, unknown
from facesynth.face.animation import BLINKS, FaceAnimation
from facesynth.face.deform import MeshDistanceDeformer
from facesynth.face.markers import marker_vertices
from facesynth.face.regions import RegionDeformer
from facesynth.face.rig import Rig, pose
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion
from facesynth.motion.resample import resample

DEFORMERS = {"distance": MeshDistanceDeformer, "regions": RegionDeformer}
"""Ways from markers to a mesh, by the name that people choose them with."""

Floats = NDArray[np.float64]


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
    """The skin of a rig under a motion of the head's own markers, deformed in one of `DEFORMERS`.

    Blinks that the animation adds, and that the eyelid markers do not show, come on top of the deformation.
    """
    if way not in DEFORMERS:
        raise unknown("way to deform", way, tuple(DEFORMERS))
    if motion.layout.kind != "markers":
        raise FacesynthError(f"a mesh is deformed by 3-D markers in mm; this model makes {motion.layout.kind}")
    frames = resample(motion, animation.fps).frames
    if len(frames) != len(animation):
        raise FacesynthError(f"motion and animation differ in length: {len(frames)} and {len(animation)} frames")
    deformer = DEFORMERS[way](rig, motion.layout)
    seen = shown_blinks(rig, motion.layout, frames)
    missing = np.maximum(animation.weights[:, _lids(rig)] - seen, 0.0)
    return MarkerSkin(rig, deformer, animation, np.ascontiguousarray(frames, np.float32), missing)


def shown_blinks(rig: Rig, layout: Layout, frames: NDArray[Any]) -> Floats:
    """[T, 2] 0..1 how far marker frames [T, 3K] show the left and the right eye shut, by projection on the blink shapes."""
    vertices = marker_vertices(rig, layout)
    rest = rig.rest_mm[vertices].ravel() if layout.neutral is None else np.asarray(layout.neutral)
    shapes = rig.shapes_mm[_lids(rig)][:, vertices].reshape(2, -1).astype(np.float64)
    energy = np.maximum(np.square(shapes).sum(axis=1), 1e-9)
    return np.clip((np.asarray(frames, np.float64) - rest) @ shapes.T / energy, 0.0, 1.0)


def _lids(rig: Rig) -> list[int]:
    return list(rig.index(*BLINKS))
