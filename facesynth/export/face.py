"""Markers to the vertices of the head, as graphs."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.builder import Builder
from facesynth.export.graph import Arrays, Graph, Port
from facesynth.face.deform.mesh_distance import MeshDistanceDeformer
from facesynth.face.deform.regions import RegionDeformer
from facesynth.face.rig.arkit_rig import Rig
from facesynth.inference.layout import Layout


def mesh_deformation_graph(rig: Rig, layout: Layout) -> Graph:
    """Markers [B, T, 3K] to vertex displacements [B, T, V, 3], by distance along the surface."""
    deformer = MeshDistanceDeformer(rig, layout)
    return _graph("deform_mesh", deformer, deformer, skin_shares(deformer))


def region_deformation_graph(rig: Rig, layout: Layout) -> Graph:
    """The same, each region of the skin by radial basis functions of its own markers."""
    deformer = RegionDeformer(rig, layout)
    shares = skin_shares(deformer.inside)
    shares[deformer.skin.numpy()] = deformer.spread.numpy()
    shares[deformer.lashes.numpy()] = shares[deformer.lash_owner.numpy()]
    return _graph("deform_regions", deformer, deformer.inside, shares)


def skin_shares(deformer: MeshDistanceDeformer) -> NDArray[np.float32]:
    """[V, K] how much each vertex follows each marker."""
    shares = np.zeros((deformer.vertex_count, len(deformer.rest) // 3), np.float32)
    shares[deformer.rows.numpy(), deformer.columns.numpy()] = deformer.values.numpy()
    return shares


def _graph(name: str, module: torch.nn.Module, inside: MeshDistanceDeformer, shares: NDArray[np.float32]) -> Graph:
    vertices, markers = shares.shape
    inner = inside.inner.numpy()
    outer = np.setdiff1d(np.arange(vertices), inner)
    b = Builder(name)
    frames = b.input("frames", "float32", ("batch", "frames", 3 * markers))
    offsets = b.op("Sub", frames, b.constant(inside.rest.numpy()))
    points = b.op("Transpose", b.op("Reshape", offsets, b.ints(0, 0, markers, 3)), perm=[0, 1, 3, 2])
    skin = b.op("Transpose", b.op("MatMul", points, b.constant(shares[outer].T)), perm=[0, 1, 3, 2])
    shapes = inside.jaw_shapes.numpy().reshape(len(inside.jaw_shapes), -1)
    mouth = b.op("MatMul", b.op("MatMul", offsets, b.constant(inside.jaw_reader.numpy())), b.constant(shapes))
    both = b.op("Concat", skin, b.op("Reshape", mouth, b.ints(0, 0, len(inner), 3)), axis=2)
    place = np.argsort(np.concatenate([outer, inner]))
    port = Port("displacements", "float32", ("batch", "frames", vertices, 3), "mm")
    b.output(b.op("Gather", both, b.constant(place, "int64"), axis=2), port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        moved = inside.rest.numpy() + 5 * rng.standard_normal((batch, count, 3 * markers))
        return {"frames": moved.astype(np.float32)}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        return [np.stack([module(torch.from_numpy(row)).numpy() for row in arrays["frames"]])]

    source = Port("frames", "float32", ("batch", "frames", 3 * markers), "mm")
    return Graph(name, "markers to displacements of the head's vertices", b.model(), (source,), (port,), example, reference)
