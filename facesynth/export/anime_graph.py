"""The anime graph as graphs and arrays: what it hears, components, emotion maps, the path search, and the recorded nodes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.export.expectation import expectation_graph, predictor_arrays
from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph, emotion_maps_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.export.speech_graphs import log_mel_graph, rasta_plp_stream_graph
from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.features import RATE
from facesynth.methods.anime_graph.lowpass import low_pass
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.speech.mel import LogMel

FORGETS = 1e-5
"""Share of a step that is left of it where a filter no longer feels it."""
LIPS_S = 0.15
"""Lips that close touch at most as much motion, and a frame or two, on either side."""
COLUMNS = (
    "phones", "emotions", "starts", "stops", "feature_starts", "feature_stops", "run_starts", "run_stops", "before", "after",
)  # fmt: skip


def settles_frames(cutoffs_hz: NDArray[np.float64], fps: float) -> int:
    """Frames to either side at which the low-pass filter no longer feels a step."""
    slowest = float(cutoffs_hz.min(initial=fps))
    far = int(np.ceil(40 * fps / slowest)) + int(fps)
    step = np.repeat([0.0, 1.0], far)[:, None].repeat(len(cutoffs_hz), axis=1)
    felt = np.abs(low_pass(step, cutoffs_hz, fps)[:far]).max(axis=1) > FORGETS
    return far - int(felt.argmax()) if felt.any() else 0


def anime_graph_content(model: AnimeGraph) -> Content:
    """Everything that the runtime needs of a trained graph."""
    if missing := [name for name in ("closed_gap", "no_map") if name not in model.facts]:
        raise FacesynthError(f"this anime graph is of an older version: it does not say {', '.join(missing)}; train it again")
    parts, unit = model.components, model.fitted_layout.unit
    mean, mixing, analysis = parts.mean.numpy(), parts.mixing.numpy(), parts.analysis.numpy()
    tensors = {name: tensor.cpu().numpy() for name, tensor in model.nodes.named_buffers()}
    arrays: dict[str, NDArray[Any]] = {name: tensors[name] for name in (*COLUMNS, "frames", "features")}
    arrays |= {"mixing": mixing, "metric": parts.metric.numpy(), "cutoffs_hz": model.cutoffs_hz.numpy()}
    maps = model.maps
    graphs = [
        rasta_plp_stream_graph(model.audio.plp),
        decode_graph(np.ascontiguousarray(mixing.T), mean, unit, model.fps, parts.decode_array),
        encode_graph(np.ascontiguousarray(analysis.T), mean, unit, model.fps, parts.encode_array),
        path_search_graph(),
    ]
    if len(maps.pairs):
        graphs.append(emotion_maps_graph(maps, model.fps))
        arrays["dropped"] = maps.dropped.numpy()
    if model.predictor is not None:
        arrays |= predictor_arrays(model.predictor)
        graphs += [expectation_graph(model.predictor, unit), log_mel_graph(LogMel())]
    return Content(
        graphs=tuple(graphs),
        settings={
            "parameters": model.config["parameters"],
            "bands": model.audio.plp.bands.shape[1],
            "feature_fps": model.audio.fps,
            "weights": {name: float(getattr(model.weights, name)) for name in ("jump", "jump_cost", "audio", "pose")},
            "help_pairs": model.config["help_pairs"],
            "closed_gap": model.facts["closed_gap"],
            "maps": maps.pairs.tolist(),
            "no_map": model.facts["no_map"],
            "temperature": model.config["temperature"],
            "sharpening": model.config["sharpening"],
        },
        latency={
            "look_ahead_s": None,
            "look_ahead_phones": 4,
            "phones_after": 2,
            "guard_s": (settles_frames(model.cutoffs_hz.numpy(), model.fps) + 4) / model.fps + 2 * LIPS_S,
            "about": "synthesize searches the whole utterance, or look_ahead=n phones; a stream looks n ahead (4 unless told). A "
            "frame is final when n + phones_after more phones are known and guard_s of motion, as far as the low-pass filter and "
            "closing lips reach; near a p, b or m the length of that phone more",
        },
        sample_rate=RATE,
        arrays=arrays,
        units={
            "frames": f"components of {unit}",
            "features": "RASTA-PLP cepstra",
            "cutoffs_hz": "Hz",
            "mixing": unit,
            "dropped": unit,
        },
    )
