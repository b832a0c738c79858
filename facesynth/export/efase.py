"""eFASE as graphs and arrays: components, the path search over given candidates, and the database for the runtime."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.expectation import (
    expectation_graph,
    hearing_graphs,
    predictor_arrays,
    predictor_settings,
    residual_arrays,
    sound_arrays,
)
from facesynth.export.folder import Content
from facesynth.export.graph import Graph
from facesynth.export.motion_graphs import decode_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.exported import stored_nodes
from facesynth.inference.efase.nodes import COLUMNS
from facesynth.inference.efase.stream import GUARD_S
from facesynth.methods.efase.method import Efase
from facesynth.speech.mel import LogMel

LATENCY = {
    "look_ahead_s": None,
    "phones_after": 1,
    "guard_s": GUARD_S,
    "about": "a stretch between silences is searched as a whole; with look_ahead=n a node is settled n phones later. A "
    "frame is final when n + phones_after more phones are known and guard_s of motion, as far as smoothing reaches",
}


def efase_content(model: Efase) -> Content:
    """Everything that the runtime needs of a trained database; `inference.efase.exported` reads it."""
    nodes, weights, unit = model.nodes(), model.weights(), model.fitted_layout.unit
    arrays: dict[str, NDArray[Any]] = {name: getattr(nodes, name).astype(np.int32) for name in COLUMNS}
    arrays |= residual_arrays(model.residual)
    arrays |= {
        "node_frames": nodes.frames,
        "rest": model.rest.cpu().numpy(),
        "names": np.frombuffer("\n".join(model.facts["names"]).encode(), np.uint8),
    }
    if model.shares is not None:
        arrays["shares"] = model.shares.astype(np.float32)
    heard, graphs = _hearing(model)
    told = {} if model.audio.predictor is None else {"expectation": predictor_settings(model.audio.predictor)}
    mean, basis = model.pca.mean.cpu().numpy(), model.pca.basis.cpu().numpy()

    def decoded(coordinates: NDArray[Any]) -> NDArray[Any]:
        return model.pca.decode(torch.from_numpy(coordinates)).numpy()

    def bounds(kept: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        return step_bounds(stored_nodes(kept), weights)

    def encoded(frames: NDArray[Any]) -> NDArray[Any]:
        return model.pca.encode(torch.from_numpy(frames)).numpy()

    fps, (sound_weight, pose_weight) = model.config["database_fps"], model.audio_weights()
    return Content(
        graphs=(
            decode_graph(basis.T, mean, unit, fps, decoded),
            encode_graph(basis, mean, unit, fps, encoded),
            path_search_graph(),
            *graphs,
        ),
        settings={
            "weights_of_cost": asdict(weights),
            "speaking": asdict(model.settings()),
            "sound_weight": sound_weight,
            "pose_weight": pose_weight,
            "residual": model.config["residual"] if model.residual and model.residual.any else 0.0,
        }
        | told,
        sample_rate=LogMel().sample_rate if graphs else None,
        latency=LATENCY,
        arrays=arrays | heard,
        derived=bounds,
        units={
            "node_frames": f"principal components of {unit}",
            "rest": f"principal components of {unit}",
            "bounds_in": "cost, logarithmic",
            "bounds_out": "cost, logarithmic",
            "bounds_scale": "cost, ratio",
        },
    )


def _hearing(model: Efase) -> tuple[dict[str, NDArray[Any]], list[Graph]]:
    """Arrays and graphs of a model that hears; none for others."""
    arrays: dict[str, NDArray[Any]] = {}
    graphs = []
    if model.audio.sound is not None:
        arrays |= sound_arrays(model.audio.sound)
    if model.audio.predictor is not None:
        arrays |= predictor_arrays(model.audio.predictor)
        graphs.append(expectation_graph(model.audio.predictor, model.fitted_layout.unit))
    if (learned := model.audio.sound or model.audio.predictor) is not None:
        graphs += hearing_graphs(learned.hearing)
    return arrays, graphs
