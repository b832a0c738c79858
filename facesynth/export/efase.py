"""eFASE as graphs and arrays: components, the path search over given candidates, and the database for the runtime."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.errors import FacesynthError
from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.export.step_bounds import class_order, sorted_nodes, step_bounds
from facesynth.methods.efase.method import Efase

BEYOND_THE_PAPER = ("temperature", "audio_weight", "pose_weight", "sharpening")
"""Settings with which more than the cheapest path is asked for; the runtime has no such search."""
COLUMNS = ("starts", "stops", "phones", "visemes", "emotions", "before")


def efase_content(model: Efase) -> Content:
    """Everything that the runtime needs of a trained database; FacesynthError where its search is another one."""
    used = [name for name in BEYOND_THE_PAPER if model.config[name] > 0]
    if used:
        raise FacesynthError(
            f"this eFASE model uses {', '.join(used)}, which cannot be exported; train with {' '.join(f'{n}=0' for n in used)}"
        )
    weights, unit = model.weights(), model.fitted_layout.unit
    order = class_order(model.nodes())
    nodes, names = sorted_nodes(model.nodes(), order), [model.facts["names"][node] for node in order]
    arrays: dict[str, NDArray[Any]] = {name: getattr(nodes, name).astype(np.int32) for name in COLUMNS}
    arrays |= {
        "node_frames": model.node_frames.cpu().numpy(),
        "rest": model.rest.cpu().numpy(),
        "names": np.frombuffer("\n".join(names).encode(), np.uint8),
    }
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
        },
        latency={
            "look_ahead_s": None,
            "about": "a stretch between silences is searched as a whole; with look_ahead=n a node is settled n phones later. "
            "Frames follow 0.4 s after the node that comes after theirs is settled",
        },
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


def weights_names() -> tuple[str, ...]:
    """Of the weights of eq. 3-12, PNT left out."""
    return ("alpha", "beta", "eta", "gamma", "delta", "phi")
