"""Markers to the channels of any head, learned from key poses, as a graph."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.graph import Arrays, Graph, Port
from facesynth.face.solve.key_poses import KeyPoseMap
from facesynth.graph_builder import TYPES, Builder


def export_key_poses(folder: str | Path, found: KeyPoseMap, training_data: dict[str, Any]) -> dict[str, Any]:
    """Write the folder of one graph; training_data: what the performer's corpus states of itself (`Corpus.provenance`)."""
    latency = {"look_ahead_s": 0.0, "about": "frame by frame"}
    content = Content((key_pose_graph(found),), {"channels": list(found.names)}, latency)
    return write_folder(folder, Subject("graphs", training_data, found.layout.to_dict(), None, ()), content)


# As in `KeyPoseMap`, with |z - z_k|² = |z|² - 2 z z_k + |z_k|².
def key_pose_graph(found: KeyPoseMap) -> Graph:
    """Frames [B, T, C] to weights [B, T, N]."""
    rest, basis, linear = (tensor.cpu().numpy() for tensor in (found.rest, found.basis, found.linear))
    centres, width = found.residual.centres.cpu().numpy(), float(found.residual.width)
    low, high = found.ranges.cpu().numpy().T
    channels, names = len(rest), len(low)
    b = Builder("key_poses")
    frames = b.input("frames", "float32", ("batch", "frames", channels))
    z = b.op("MatMul", b.op("Sub", b.op("Cast", frames, to=TYPES["float64"]), b.constant(rest)), b.constant(basis))
    own = b.op("ReduceSum", b.op("Mul", z, z), b.ints(-1), keepdims=1)
    total = b.op("Add", own, b.constant(np.square(centres).sum(axis=1)))
    inner = b.op("MatMul", z, b.constant(2 * centres.T))
    squared = b.op("Max", b.op("Sub", total, inner), b.constant(0.0))
    spread = b.op("Exp", b.op("Mul", squared, b.constant(-1 / width**2)))
    near = b.op("MatMul", spread, b.constant(found.residual.coefficients.cpu().numpy()))
    free = b.op("Add", b.op("MatMul", z, b.constant(linear)), near)
    within = b.op("Min", b.op("Max", free, b.constant(low)), b.constant(high))
    port = Port("weights", "float32", ("batch", "frames", names), "the head's channels, in their ranges")
    b.output(b.op("Cast", within, to=TYPES["float32"]), port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        posed = centres[rng.integers(len(centres), size=(batch, count))] @ basis.T
        return {"frames": (rest + posed + 0.1 * np.abs(posed).mean() * rng.standard_normal(posed.shape)).astype(np.float32)}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        return [found(torch.from_numpy(arrays["frames"])).numpy()]

    source = Port("frames", "float32", ("batch", "frames", channels), "the performer's layout and unit, head motion removed")
    return Graph("key_poses", "markers to the channels of a head", b.model(), (source,), (port,), example, reference)
