"""The anime graph as graphs and arrays: what it hears, components, emotion maps, the path search, and the recorded nodes."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.export.expectation import expectation_graph, hearing_graphs, predictor_arrays, predictor_settings
from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph, emotion_maps_graph, encode_graph
from facesynth.export.path_search import path_search_graph
from facesynth.export.speech_graphs import rasta_plp_stream_graph
from facesynth.inference.anime_graph.graph import Graph
from facesynth.inference.anime_graph.hearing import RATE
from facesynth.inference.closures import LONGEST_CLOSING_S
from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.method import AnimeGraph


def anime_graph_content(model: AnimeGraph) -> Content:
    """Everything that the runtime needs of a trained graph."""
    if missing := [name for name in ("closed_gap", "no_map") if name not in model.facts]:
        raise FacesynthError(f"this anime graph is of an older version: it does not say {', '.join(missing)}; train it again")
    parts, unit = model.components, model.fitted_layout.unit
    mean, mixing, analysis = parts.mean.numpy(), parts.mixing.numpy(), parts.analysis.numpy()
    tensors = {name: tensor.cpu().numpy() for name, tensor in model.nodes.named_buffers()}
    arrays: dict[str, NDArray[Any]] = {f.name: tensors[f.name] for f in fields(Graph)}
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
    told: dict[str, Any] = {}
    if model.predictor is not None:
        told = {"expectation": predictor_settings(model.predictor)}
        arrays |= predictor_arrays(model.predictor)
        graphs += [expectation_graph(model.predictor, unit), *hearing_graphs(model.predictor.hearing)]
    return Content(
        graphs=tuple(graphs),
        settings={
            "parameters": model.config["parameters"],
            "bands": model.audio.plp.bands.shape[1],
            "feature_fps": model.audio.fps,
            "weights": {name: float(value) for name, value in asdict(model.weights).items()},
            "utterances": model.facts["utterances"],
            "help_pairs": model.config["help_pairs"],
            "closed_gap": model.facts["closed_gap"],
            "maps": maps.pairs.tolist(),
            "no_map": model.facts["no_map"],
            "temperature": model.config["temperature"],
            "sharpening": model.config["sharpening"],
        }
        | told,
        latency={
            "look_ahead_s": None,
            "look_ahead_phones": 4,
            "phones_after": 2,
            "guard_s": (model.runtime().low_pass.settles_frames + 5) / model.fps + 2 * LONGEST_CLOSING_S,
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
