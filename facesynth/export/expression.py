"""Expressions as a graph and arrays: signals to motion, and the recorded signals that new ones are grown from."""

from dataclasses import asdict

import numpy as np

from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph
from facesynth.methods.expression.method import Expression

LATENCY = {"look_ahead_s": None, "about": "a signal is grown from its start on; lips are held shut over an utterance at once"}


def expression_content(model: Expression) -> Content:
    """Everything that the runtime needs of a model; `inference.expression` reads it."""
    unit, parts = model.fitted_layout.unit, model.speaker().parts
    basis = np.ascontiguousarray(model.basis.cpu().numpy().T)
    return Content(
        graphs=(decode_graph(basis, model.mean.cpu().numpy(), unit, model.fps, model.decode_array),),
        settings={"expressions": list(parts.emotions), "patches": asdict(parts.settings), "variety": parts.variety},
        latency=LATENCY,
        arrays={
            "rest": model.rest.cpu().numpy(),
            "weights": model.weights.cpu().numpy(),
            "constants": model.constants.cpu().numpy(),
            "signals": model.signals.cpu().numpy(),
            "starts": parts.starts.astype(np.int32),
            "owners": parts.owners.astype(np.int32),
        },
        units={"rest": unit} | dict.fromkeys(("weights", "constants", "signals"), f"principal components of {unit}"),
    )
