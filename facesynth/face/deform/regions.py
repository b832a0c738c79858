"""Marker motion spread over a mesh by radial basis functions, region by region (Cao 2005, §7)."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import KDTree
from torch import nn

from facesynth.face.deform.mesh_distance import LASHES, MeshDistanceDeformer, marker_spacing_mm, surface_distances
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import marker_vertices
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

REGIONS: Mapping[str, tuple[str, ...]] = {
    "lower jaw": ("lower_lip", "jaw"),
    "upper jaw": ("upper_lip", "nose", "cheeks"),
    "right eyelid": ("eyelids",),
    "left eyelid": ("eyelids",),
    "upper face": ("forehead", "brows"),
}
"""Regions of the face and the layout groups whose markers alone move them; eyelids by side."""
WIDTH = 3.0
"""Reach of a basis function, in median distances of a marker to its nearest neighbour."""
BORDER = 0.8
"""How far two regions are blended on either side of their border, in the same measure."""


class RegionDeformer(nn.Module):
    """Markers to vertices, like `MeshDistanceDeformer`, but each region of the skin follows its own markers only.

    Between the lips there is no border along the surface except at the corners of the mouth, so that neither lip
    pulls the other. Teeth, tongue and lashes follow as they do there.
    """

    rest: torch.Tensor
    spread: torch.Tensor
    skin: torch.Tensor
    lashes: torch.Tensor
    lash_owner: torch.Tensor

    def __init__(self, rig: Rig, layout: Layout) -> None:
        super().__init__()
        self.inside = MeshDistanceDeformer(rig, layout)
        vertices = marker_vertices(rig, layout)
        skin, lashes = rig.vertices_of("skin"), rig.vertices_of(*LASHES)
        spread = skin_spread(rig, vertices, region_markers(rig, layout, vertices))
        self.register_buffer("spread", torch.from_numpy(spread[skin].astype(np.float32)))
        self.register_buffer("skin", torch.from_numpy(skin))
        self.register_buffer("lashes", torch.from_numpy(lashes))
        owner = KDTree(rig.rest_mm[skin]).query(rig.rest_mm[lashes])[1] if len(lashes) else np.zeros(0, np.int64)
        self.register_buffer("lash_owner", torch.from_numpy(skin[owner]))

    def forward(self, frames: torch.Tensor) -> torch.Tensor:
        """Vertex displacements [T, V, 3] in mm for marker frames [T, 3K] in mm, head motion removed."""
        moved = self.inside(frames)
        offsets = (frames - self.inside.rest).to(self.spread.dtype).reshape(len(frames), -1, 3)  # [T, K, 3]
        moved[:, self.skin] = torch.einsum("vk,tkc->tvc", self.spread, offsets)
        moved[:, self.lashes] = moved[:, self.lash_owner]
        return moved


def region_markers(rig: Rig, layout: Layout, vertices: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """Marker indices of each region; FacesynthError where one has none. Markers [K] sit on `vertices`."""
    side = rig.rest_mm[vertices, 0]
    members = {}
    for region, groups in REGIONS.items():
        found = [layout.group(g) for g in groups if g in layout.groups]
        markers = np.unique(np.concatenate([np.zeros(0, np.int64), *found]))
        if "eyelid" in region:
            markers = markers[side[markers] < 0 if region.startswith("right") else side[markers] > 0]
        if not len(markers):
            raise FacesynthError(
                f"the layout has no markers for the region {region!r} (groups {', '.join(groups)}); name them in the layout, "
                "or deform by mesh distance"
            )
        members[region] = markers
    return members


def region_shares(
    rig: Rig, vertices: NDArray[np.int64], members: Mapping[str, NDArray[np.int64]], border_mm: float
) -> NDArray[np.float64]:
    """[regions, V] how much each vertex belongs to each region, 1 in all.

    A vertex belongs to the region of the marker that is nearest along the surface; where another region's nearest
    marker is less than `border_mm` farther, both have a share, smoothly.
    """
    distance = np.array([surface_distances(rig, vertices[markers]).min(axis=0) for markers in members.values()])
    nearest = distance.min(axis=0)
    behind = np.where(np.isfinite(nearest), distance - np.where(np.isfinite(nearest), nearest, 0), np.inf)
    closeness = np.clip(1 - behind / border_mm, 0, 1)
    share = closeness**2 * (3 - 2 * closeness)
    return share / np.maximum(share.sum(axis=0), 1e-12)


def skin_spread(rig: Rig, vertices: NDArray[np.int64], members: Mapping[str, NDArray[np.int64]]) -> NDArray[np.float64]:
    """[V, K] linear map from marker displacements to vertex displacements.

    In each region the displacement is `sum over markers of c_m exp(-|x - x_m| / width)`, with the coefficients that
    give every marker of the region its own displacement; regions are blended by their shares. The scalp and the neck
    stay with the head.
    """
    spacing_mm = marker_spacing_mm(rig, vertices)
    shares = region_shares(rig, vertices, members, BORDER * spacing_mm)
    spread = np.zeros((len(rig.rest_mm), len(vertices)))
    for share, markers in zip(shares, members.values(), strict=True):
        at = rig.rest_mm[vertices[markers]].astype(np.float64)
        touched = np.flatnonzero(share)
        basis = _kernel(rig.rest_mm[touched].astype(np.float64), at, WIDTH * spacing_mm)
        spread[touched[:, None], markers] += (
            share[touched, None] * np.linalg.solve(_kernel(at, at, WIDTH * spacing_mm), basis.T).T
        )
    return spread * rig.head_weight[:, None]


def _kernel(x: NDArray[np.float64], centres: NDArray[np.float64], width_mm: float) -> NDArray[np.float64]:
    return np.exp(-np.linalg.norm(x[:, None] - centres, axis=-1) / width_mm)
