"""Marker motion spread over a mesh by distance along its surface (Deng, Neumann 2008, §7.1)."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree
from torch import nn

from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import marker_vertices
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

SIGMA = 0.55
"""Standard deviation of a marker's influence, in median distances of a marker to its nearest neighbour."""
REACH = 3.0
"""Distance at which influence has faded to 0, in standard deviations."""
REST_WEIGHT = 0.02
"""Weight of staying at rest, which joins the sum: near a marker it hardly counts, at the edge it wins."""
JAW_SHAPES = ("jawOpen", "jawForward", "jawLeft")
JAW_RIDGE = 1e-2
"""Share of the mean squared shape length that an unbounded weight pays when the jaw is read off the markers."""
INNER_PARTS = ("lower_teeth", "tongue")
LASHES = tuple(part for part in PARTS if part.endswith("lashes"))


class MeshDistanceDeformer(nn.Module):
    """Markers to vertices; everything that does not depend on the motion is computed once.

    The skin follows by distance along the surface. Lower teeth and tongue follow the jaw, which is read off the
    markers by least squares on the rig's jaw shapes. Lashes follow the nearest lid. Eyes and upper teeth stay.

    >>> deformer = MeshDistanceDeformer(rig, layout)          # doctest: +SKIP
    >>> displacements = deformer(torch.from_numpy(motion.frames))  # doctest: +SKIP
    """

    rest: torch.Tensor
    rows: torch.Tensor
    columns: torch.Tensor
    values: torch.Tensor
    jaw_reader: torch.Tensor
    inner: torch.Tensor
    jaw_shapes: torch.Tensor

    def __init__(self, rig: Rig, layout: Layout, *, sigma: float = SIGMA) -> None:
        super().__init__()
        if layout.kind != "markers":
            raise FacesynthError(f"a mesh is deformed by 3-D markers in mm; got a layout of {layout.kind}")
        vertices = marker_vertices(rig, layout)
        skin = surface_weights(rig, vertices, sigma=sigma)
        rest = rig.rest_mm[vertices].ravel() if layout.neutral is None else np.asarray(layout.neutral, np.float32)
        jaw_reader, jaw_shapes = _jaw(rig, vertices)
        self.register_buffer("rest", torch.as_tensor(rest, dtype=torch.float32))
        self.register_buffer("rows", torch.from_numpy(skin.row.astype(np.int64)))
        self.register_buffer("columns", torch.from_numpy(skin.col.astype(np.int64)))
        self.register_buffer("values", torch.from_numpy(skin.data.astype(np.float32)))
        self.register_buffer("jaw_reader", torch.from_numpy(jaw_reader))
        self.register_buffer("inner", torch.from_numpy(rig.vertices_of(*INNER_PARTS)))
        self.register_buffer("jaw_shapes", torch.from_numpy(jaw_shapes))
        self.vertex_count = len(rig.rest_mm)

    def forward(self, frames: torch.Tensor) -> torch.Tensor:
        """Vertex displacements [T, V, 3] in mm for marker frames [T, 3K] in mm, head motion removed."""
        offsets = (frames - self.rest).to(self.values.dtype)  # [T, 3K]
        points = offsets.reshape(len(offsets), -1, 3).permute(1, 0, 2).flatten(1)  # [K, 3T]
        weights = torch.sparse_coo_tensor(
            torch.stack([self.rows, self.columns]),
            self.values,
            (self.vertex_count, len(points)),
            check_invariants=False,
        )
        moved = torch.sparse.mm(weights, points).reshape(self.vertex_count, -1, 3).permute(1, 0, 2).contiguous()
        opening = offsets @ self.jaw_reader  # [T, 3] amounts of the jaw shapes
        moved[:, self.inner] = torch.einsum("tj,jvc->tvc", opening, self.jaw_shapes)
        return moved


def edge_lengths(rig: Rig) -> csr_array:
    """[V, V] lengths in mm of the edges of the quads, both ways."""
    start, end = rig.quads, np.roll(rig.quads, -1, axis=1)
    edges = np.unique(np.sort(np.stack([start, end], axis=-1).reshape(-1, 2), axis=1), axis=0)
    edges = edges[edges[:, 0] != edges[:, 1]]  # a triangle repeats its last corner
    length = np.linalg.norm(rig.rest_mm[edges[:, 0]].astype(np.float64) - rig.rest_mm[edges[:, 1]], axis=1)
    both = np.concatenate([edges, edges[:, ::-1]])
    count = len(rig.rest_mm)
    return coo_array((np.tile(length, 2), (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()


def surface_distances(rig: Rig, sources: NDArray[np.int64], limit_mm: float = np.inf) -> NDArray[np.float64]:
    """[K, V] length in mm of the shortest path along edges from each source vertex; infinite beyond `limit_mm`.

    Paths go round the corner of the mouth and the ends of the lids, never across the gap.
    """
    return dijkstra(edge_lengths(rig), directed=True, indices=sources, limit=limit_mm)


@dataclass(frozen=True)
class SkinWeights:
    """Sparse weights of K markers on V vertices, as coordinates."""

    row: NDArray[np.int64]
    """[E] vertex."""
    col: NDArray[np.int64]
    """[E] marker."""
    data: NDArray[np.float64]
    """[E] share; the shares of a vertex sum to less than 1, the rest stays still."""


# Equation of §7.1: w_ki = exp(-d_ki² / (2 sigma²)), motion of a vertex = sum_k w_ki m_k / sum_k w_ki. Normalised like
# this, a vertex just inside the threshold follows its marker fully and its neighbour just outside not at all. So the
# Gaussian is shifted to reach 0 at the threshold, and a small rest weight joins the sum below the line.
def surface_weights(rig: Rig, vertices: NDArray[np.int64], *, sigma: float = SIGMA) -> SkinWeights:
    """How much each vertex of the skin follows each marker; sigma in median marker spacings."""
    if sigma <= 0:
        raise FacesynthError(f"sigma must be positive; got {sigma}")
    sigma_mm = sigma * marker_spacing_mm(rig, vertices)
    distance = surface_distances(rig, vertices, limit_mm=REACH * sigma_mm)
    floor = np.exp(-(REACH**2) / 2)
    influence = np.maximum(np.exp(-((distance / sigma_mm) ** 2) / 2) - floor, 0.0) / (1 - floor)
    share = (influence / (influence.sum(axis=0) + REST_WEIGHT)).T  # [V, K]
    share[rig.vertices_of("skin")] *= rig.head_weight[rig.vertices_of("skin"), None]
    share = _lashes_follow_lids(rig, share)
    row, col = np.nonzero(share)
    return SkinWeights(row, col, share[row, col])


def marker_spacing_mm(rig: Rig, vertices: NDArray[np.int64]) -> float:
    """Median over the markers of the straight distance to the nearest other one, mm."""
    if len(vertices) < 2:
        raise FacesynthError("a face needs at least two markers to be deformed")
    return float(np.median(KDTree(rig.rest_mm[vertices]).query(rig.rest_mm[vertices], k=2)[0][:, 1]))


def _lashes_follow_lids(rig: Rig, share: NDArray[np.float64]) -> NDArray[np.float64]:
    skin, lashes = rig.vertices_of("skin"), rig.vertices_of(*LASHES)
    share[lashes] = share[skin[KDTree(rig.rest_mm[skin]).query(rig.rest_mm[lashes])[1]]]
    return share


def _jaw(rig: Rig, vertices: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(reader [3K, 3] from marker offsets to jaw shapes, those shapes [3, inner vertices, 3] in mm).

    All shapes are fitted together, so that lips which move by themselves are not taken for the jaw.
    """
    seen = rig.shapes_mm[:, vertices].reshape(len(rig.names), -1).astype(np.float64)
    gram = seen @ seen.T
    fitted = seen.T @ np.linalg.inv(gram + JAW_RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram)))
    jaw = rig.index(*JAW_SHAPES)
    return fitted[:, jaw].astype(np.float32), np.ascontiguousarray(rig.shapes_mm[jaw][:, rig.vertices_of(*INNER_PARTS)])
