"""The anime graph as graphs and arrays: what it hears, components, emotion maps, the path search, and the recorded nodes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.export.expectation import expectation_graph, predictor_parts
from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph, emotion_maps_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.export.speech_graphs import log_mel_graph, rasta_plp_stream_graph
from facesynth.methods.anime_graph.features import RATE
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.speech.mel import LogMel

COLUMNS = (
    "phones", "emotions", "starts", "stops", "feature_starts", "feature_stops", "run_starts", "run_stops", "before", "after",
)  # fmt: skip


def anime_graph_content(model: AnimeGraph) -> Content:
    """Everything that the runtime needs of a trained graph."""
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
    more: dict[str, Any] = {}
    if model.predictor is not None:
        more, learned = predictor_parts(model.predictor)
        arrays |= learned
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
            **more,
        },
        latency={
            "look_ahead_s": None,
            "about": "synthesize searches the whole utterance, or look_ahead=n phones; a stream looks n ahead. Frames follow "
            "0.8 s after the second node after theirs is settled",
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
