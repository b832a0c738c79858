"""The network of poses as graphs: sound to bands, and what is told of them to frames."""

from dataclasses import asdict

from facesynth.export.expectation import expectation_graph, hearing_graphs, predictor_arrays, predictor_settings, residual_arrays
from facesynth.export.folder import Content
from facesynth.methods.network.method import Network
from facesynth.speech.mel import LogMel


def network_content(model: Network) -> Content:
    """Everything that the runtime needs of a trained network; `inference.network.load_network` reads it."""
    speaker, unit = model.speaker(), model.fitted_layout.unit
    return Content(
        graphs=(expectation_graph(model.predictor, unit), *hearing_graphs(model.predictor.hearing)),
        settings={
            "expectation": predictor_settings(model.predictor),
            "unsaid": model.config["unsaid"] > 0,
            "sharpening": model.config["sharpening"],
            "residual": model.config["residual"] if model.residual and model.residual.any else 0.0,
            "closed_gap": model.facts["closed_gap"] if model.config["close_lips"] else None,
            "openings": asdict(model.openings) if model.openings else None,
        },
        latency={
            "look_ahead_s": speaker.look_ahead_s,
            "about": "frame t is final when the sound up to t / fps + look_ahead_s is known; a stream, for which the network "
            "must be trained with phones=false or with a share unsaid, gives what the whole gives without sharpening and closing "
            "of lips; with phone_net through windows of 0.2 s that look back 4 s and ahead 0.4 s",
        },
        sample_rate=LogMel().sample_rate,
        arrays=predictor_arrays(model.predictor) | residual_arrays(model.residual),
    )
