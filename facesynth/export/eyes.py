"""Eyes as arrays: patches that numpy grows. Nothing in them is a graph."""

from facesynth.export.folder import Content
from facesynth.methods.eyes.method import Eyes

LATENCY = {"look_ahead_s": None, "about": "an utterance at once; a patch depends on those before it and not on the speech"}


def eyes_content(model: Eyes) -> Content:
    """Everything that the runtime needs of a model; `inference.eyes` reads it."""
    names = ("joins", "patch", "boundary", "tolerance", "compensation")
    return Content(
        graphs=(),
        settings={name: model.facts[name] for name in names},
        latency=LATENCY,
        arrays={"frames": model.frames.cpu().numpy(), "starts": model.starts.cpu().numpy(), "roles": model.roles.cpu().numpy()},
        units={"frames": "opening 0..1; gaze to the left, up, rad"},
    )
