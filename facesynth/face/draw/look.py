"""Everything about the look of a head that does not change from frame to frame."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facesynth.face.draw.camera import Camera
from facesynth.face.draw.shading import Surface
from facesynth.face.draw.strands import Strands


class Eyeball(NamedTuple):
    """An eye with cornea and iris, which are drawn by rule on its vertices."""

    vertices: NDArray[np.int64]
    """[K]"""
    rest_mm: NDArray[np.float32]
    """[K, 3]"""
    centre_mm: NDArray[np.float64]
    """[3] about which it turns, at rest."""


class LitSphere(NamedTuple):
    """The part of space on which the key light throws shadows."""

    centre_mm: NDArray[np.float64]
    """[3]"""
    radius_mm: float


@dataclass(frozen=True, eq=False)
class Look:
    """What a renderer knows of a head with V posed and N drawn vertices; the parts that a head lacks are None."""

    surface: Surface
    lit: LitSphere
    camera: Camera
    """From where it is seen if nothing else is asked for."""
    refine: sparse.csr_matrix | None = None
    """[N, V] posed vertices to drawn ones; without it they are the same."""
    welded: NDArray[np.int64] | None = None
    """[N] the vertex whose normal each one takes: files split vertices at seams, which must not show in the light."""
    strands: Strands | None = None
    cap_mm: NDArray[np.float32] | None = None
    """[N] thickness of the hair over each vertex, for the shadow it throws."""
    eyes: tuple[Eyeball, Eyeball] | None = None
    """The performer's left and right one."""
    lips: NDArray[np.int64] | None = None
    """[2, P] facing vertices of the inner lips, upper and lower: between closed ones no light comes in."""

    furrows: bool = False
    """Whether places are those of the built-in head, on which lines of brow and forehead are drawn."""

    @property
    def vertex_count(self) -> int:
        """V."""
        return len(self.surface.rest) if self.refine is None else self.refine.shape[1]

    @property
    def normal_quads(self) -> NDArray[np.int32]:
        """[F, 4] the quads over which normals are averaged."""
        quads = self.surface.quads
        return quads if self.welded is None else self.welded[quads].astype(np.int32)
