"""eFASE as graphs and arrays: components, the path search over given candidates, and the database for the runtime."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.expectation import expectation_graph, predictor_parts, sound_parts
from facesynth.export.folder import Content
from facesynth.export.graph import Graph
from facesynth.export.motion_graphs import decode_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.export.speech_graphs import log_mel_graph
from facesynth.export.step_bounds import class_order, sorted_nodes, step_bounds
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.nodes import Ints
from facesynth.speech.mel import LogMel

COLUMNS = ("starts", "stops", "phones", "visemes", "emotions", "before")
GUARD_S = 0.4
"""Of settled motion after a frame, beyond which nothing changes it."""


LATENCY = {
    "look_ahead_s": None,
    "phones_after": 1,
    "guard_s": GUARD_S,
    "about": "a stretch between silences is searched as a whole; with look_ahead=n a node is settled n phones later. A "
    "frame is final when n + phones_after more phones are known and guard_s of motion, as far as smoothing reaches",
}


def efase_content(model: Efase) -> Content:
    """Everything that the runtime needs of a trained database."""
    weights, unit = model.weights(), model.fitted_layout.unit
    order = class_order(model.nodes())
    nodes, names = sorted_nodes(model.nodes(), order), [model.facts["names"][node] for node in order]
    arrays: dict[str, NDArray[Any]] = {name: getattr(nodes, name).astype(np.int32) for name in COLUMNS}
    arrays |= {
        "node_frames": model.node_frames.cpu().numpy(),
        "numbers": order.astype(np.int32),
        "rest": model.rest.cpu().numpy(),
        "names": np.frombuffer("\n".join(names).encode(), np.uint8),
    }
    soft, heard, graphs = _beyond_the_paper(model, order)
    arrays |= heard
    mean, basis = model.pca.mean.cpu().numpy(), model.pca.basis.cpu().numpy()

    def decoded(coordinates: NDArray[Any]) -> NDArray[Any]:
        return model.pca.decode(torch.from_numpy(coordinates)).numpy()

    def bounds(kept: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        frames = kept["node_frames"].astype(np.float32) * kept.get("node_frames_scale", np.float32(1))
        return step_bounds(replace(nodes, frames=frames.astype(np.float64)), weights)

    def encoded(frames: NDArray[Any]) -> NDArray[Any]:
        return model.pca.encode(torch.from_numpy(frames)).numpy()

    fps = model.config["database_fps"]
    return Content(
        graphs=(
            decode_graph(basis.T, mean, unit, fps, decoded),
            encode_graph(basis, mean, unit, fps, encoded),
            path_search_graph(),
            *graphs,
        ),
        settings={
            "database_fps": fps,
            "bridge_pauses": model.config["bridge_pauses"],
            "weights_of_cost": {name: float(getattr(weights, name)) for name in ("pnt", *weights_names())},
            "smoothing": {
                "firm": model.smoothing.firm,
                "loose": model.smoothing.loose,
                "reach_s": model.smoothing.reach_s,
                "stiffness": model.smoothing.stiffness,
            },
            **soft,
        },
        sample_rate=LogMel().sample_rate if graphs else None,
        latency=LATENCY,
        arrays=arrays,
        derived=bounds,
        units={
            "node_frames": f"principal components of {unit}",
            "rest": f"principal components of {unit}",
            "bounds_in": "cost, logarithmic",
            "bounds_out": "cost, logarithmic",
            "bounds_scale": "cost, ratio",
        },
    )


def _beyond_the_paper(model: Efase, order: Ints) -> tuple[dict[str, Any], dict[str, NDArray[Any]], list[Graph]]:
    """Settings, arrays and graphs of a model that takes means over paths or hears; settings of 0 for others."""
    sound_weight, pose_weight = model.audio_weights()
    settings: dict[str, Any] = {
        "temperature": model.temperature,
        "candidates": model.config["candidates"],
        "sharpening": model.config["sharpening"],
        "sound_weight": sound_weight,
        "pose_weight": pose_weight,
    }
    arrays: dict[str, NDArray[Any]] = {}
    graphs = []
    if model.audio.sound is not None:
        more, parts = sound_parts(model.audio.sound, order)
        settings, arrays = settings | more, arrays | parts
    if model.audio.predictor is not None:
        more, parts = predictor_parts(model.audio.predictor)
        settings, arrays = settings | more, arrays | parts
        graphs.append(expectation_graph(model.audio.predictor, model.fitted_layout.unit))
    if not model.audio.empty:
        graphs.append(log_mel_graph(LogMel()))
    return settings, arrays, graphs


def weights_names() -> tuple[str, ...]:
    """Of the weights of eq. 3-12, PNT left out."""
    return ("alpha", "beta", "eta", "gamma", "delta", "phi")
