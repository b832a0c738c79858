"""Folders of graphs without a trained model: what is heard in a sound, and what moves the built-in head."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.graph import Arrays, Graph, Port
from facesynth.export.weights import Weights, stored_as
from facesynth.face.deform.mesh_distance import MeshDistanceDeformer
from facesynth.face.deform.regions import RegionDeformer
from facesynth.face.rig.arkit_rig import Rig
from facesynth.graph_builder import Builder
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


SAMPLE_RATE = 16000


def export_features(folder: str | Path, weights: Weights = "float32") -> dict[str, Any]:
    """RASTA-PLP, real cepstrum, log-mel bands and mel cepstra of sound at 16 kHz."""
    from facesynth.export.speech_graphs import cepstrum_graph, log_mel_graph, mel_cepstra_graph, rasta_plp_graph
    from facesynth.speech.cepstrum import RealCepstrum
    from facesynth.speech.mel import LogMel
    from facesynth.speech.mel_cepstra import MelCepstra
    from facesynth.speech.rasta_plp import RastaPlp

    graphs = (
        rasta_plp_graph(RastaPlp(SAMPLE_RATE)),
        cepstrum_graph(RealCepstrum(), SAMPLE_RATE),
        log_mel_graph(LogMel(sample_rate=SAMPLE_RATE)),
        mel_cepstra_graph(MelCepstra()),
    )
    latency = {"look_ahead_s": 0.0125, "about": "half a window after the frame's centre; the cepstrum is of a whole sound"}
    content = Content(graphs, {}, latency, SAMPLE_RATE)
    data = {"performer": "none", "licences": ["none: no data"], "consents": ["none: no data"]}
    return write_folder(folder, Subject("graphs", data, None, None, ()), stored_as(content, weights))


def export_face(folder: str | Path, weights: Weights = "float32") -> dict[str, Any]:
    """Deformation of the built-in head by its 90 markers, ARKit weights from them, and the warp of pictures."""
    from facesynth.export.solve import arkit_weights_graph
    from facesynth.export.warp import warp_graph
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.face.rig.markers import marker_layout

    rig = load_head()
    layout = marker_layout(rig)
    graphs = (
        mesh_deformation_graph(rig, layout),
        region_deformation_graph(rig, layout),
        arkit_weights_graph(rig, layout),
        warp_graph(),
    )
    latency = {"look_ahead_s": 0.0, "about": "frame by frame; the weights of a frame lean a little on its neighbours"}
    content = Content(graphs, {"shapes": list(rig.names), "vertices": len(rig.rest_mm)}, latency)
    data = {"performer": "none: the built-in head", "licences": ["CC0-1.0"], "consents": ["nobody was recorded"]}
    return write_folder(folder, Subject("graphs", data, layout.to_dict(), None, ()), stored_as(content, weights))
