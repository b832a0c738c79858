"""Folders of graphs without a trained model: what is heard in a sound, and what moves the built-in head."""

from pathlib import Path
from typing import Any

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.weights import Weights, stored_as

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
    from facesynth.export.face import mesh_deformation_graph, region_deformation_graph
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
