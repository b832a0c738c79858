"""Co-articulation as a graph and arrays: displacements to motion, key shapes, and the polynomials that blend them."""

import numpy as np

from facesynth.export.folder import Content
from facesynth.export.motion_graphs import decode_graph
from facesynth.inference.coarticulation.model import KEY_FIELDS, MODEL_FIELDS
from facesynth.methods.coarticulation.method import Coarticulation

LATENCY = {
    "look_ahead_s": None,
    "about": "an utterance at once; a pose depends on two phones to either side",
}


def coarticulation_content(model: Coarticulation) -> Content:
    """Everything that the runtime needs of a model; `inference.coarticulation.model` reads it."""
    unit = model.fitted_layout.unit
    basis = np.ascontiguousarray(model.basis.cpu().numpy().T)
    return Content(
        graphs=(decode_graph(basis, model.rest.cpu().numpy(), unit, model.fps, model.decode_array),),
        settings={"closed_gap": model.facts["closed_gap"]},
        latency=LATENCY,
        arrays={name: getattr(model, name).cpu().numpy() for name in (*KEY_FIELDS, *MODEL_FIELDS)}
        | {"triphone_keys": model.triphone_keys.cpu().numpy().astype(np.int32)},
        units=dict.fromkeys(KEY_FIELDS, f"principal components of {unit}") | {"usual_s": "s"},
    )
