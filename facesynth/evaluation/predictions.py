"""Synthesised motion on disk, so that every table can be computed again, and any method be judged beside ours.

One NPZ file per utterance, without pickled objects, called `METHOD/ID.npz`:

========================  ===============  ==================================================
`frames`                  [T, C] float32   as in `Motion`, no NaN
`fps`                     number           frames per second
`layout` (optional)       text             JSON of `Layout.to_dict`; the corpus's where absent
`utterance` (optional)    text             id of the utterance; the file's name where absent
`head` (optional)         [T, 6] float32   rotation vector (rad) and translation (mm)
`eyes` (optional)         [T, 3] float32   opening 0..1, gaze to the left and up (rad)
========================  ===============  ==================================================

Beside it may lie `METHOD/ID.json`: `synthesis_s` and `speech_s` (the real-time factor), `synthesis_cpu_s` (the same by
the processor), `joins` (first frames of the pieces of a concatenative method) and `own` (figures that the method tells
of itself). Other motions of a method that draws them lie in `METHOD/samples/NUMBER/ID.npz`, in the same form.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from facesynth.atomic import atomic_path, write_text
from facesynth.evaluation.cost import Spent
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.npz import read_arrays
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Joining, Reporting
from facesynth.methods.method import Method
from facesynth.methods.registry import ask

SAMPLES = "samples"


@dataclass(frozen=True)
class Beside:
    """What is known of a prediction beside its motion."""

    synthesis_s: float
    """By the clock."""
    speech_s: float
    joins: tuple[int, ...] | None = None
    """First frames of the pieces; None for a method that joins none."""
    own: Mapping[str, float] = field(default_factory=dict)
    synthesis_cpu_s: float | None = None
    """Of the processor; None where nobody measured it."""

    @classmethod
    def of(cls, method: Method, speech: Speech, spent: Spent) -> Self:
        """Ask a method."""
        joining, reporting = ask(method, Joining), ask(method, Reporting)
        joins = tuple(map(int, joining.joins(speech))) if joining else None
        own = {name: float(value) for name, value in reporting.report(speech).items()} if reporting else {}
        return cls(spent.clock_s, speech.duration_s, joins, own, spent.processor_s)


def save_prediction(path: str | Path, utterance_id: str, motion: Motion) -> None:
    """Write one synthesised motion, atomically."""
    beside = {name: track for name in ("head", "eyes") if (track := getattr(motion, name)) is not None}
    layout = json.dumps(motion.layout.to_dict(), sort_keys=True)
    with atomic_path(path) as part, part.open("wb") as file:
        np.savez(file, frames=motion.frames, fps=motion.fps, layout=layout, utterance=utterance_id, **beside)


def load_prediction(path: str | Path, layout: Layout | None = None) -> tuple[str, Motion]:
    """Utterance id and motion of a file in this form; `layout` for files that state none. FacesynthError for others."""
    required = ("frames", "fps") if layout else ("frames", "fps", "layout")
    arrays = read_arrays(path, "a prediction in the documented form", required, ("layout", "utterance", "head", "eyes"))
    try:
        stated = Layout.from_dict(json.loads(str(arrays["layout"]))) if "layout" in arrays or layout is None else layout
        motion = Motion(arrays["frames"], float(arrays["fps"]), stated, arrays.get("head"), arrays.get("eyes"))
    except (ValueError, TypeError) as error:  # what is no JSON, no one rate, no motion
        raise FacesynthError(f"{path} is not a prediction in the documented form ({error})") from None
    return str(arrays.get("utterance", Path(path).stem)), motion


def sample_path(path: Path, number: int) -> Path:
    """Where another motion of the prediction `path` is kept."""
    return path.parent / SAMPLES / str(number) / path.name


def sample_paths(path: Path) -> list[Path]:
    """Other motions of the prediction `path`, in the order of their folders' names."""
    folders = sorted(folder for folder in (path.parent / SAMPLES).glob("*") if folder.is_dir())
    return [folder / path.name for folder in folders if (folder / path.name).is_file()]


def write_beside(path: Path, beside: Beside) -> None:
    """Write the JSON beside the prediction `path`, atomically."""
    write_text(path.with_suffix(".json"), json.dumps(asdict(beside), allow_nan=False) + "\n")


def read_beside(path: Path) -> Beside | None:
    """What lies beside the prediction `path`; None where nothing does."""
    beside = path.with_suffix(".json")
    if not beside.is_file():
        return None
    try:
        plain = json.loads(beside.read_text(encoding="utf-8"))
        joins = plain.get("joins")
        own = {str(name): float(value) for name, value in plain.get("own", {}).items()}
        processor_s = plain.get("synthesis_cpu_s")
        return Beside(
            float(plain["synthesis_s"]),
            float(plain["speech_s"]),
            None if joins is None else tuple(map(int, joins)),
            own,
            None if processor_s is None else float(processor_s),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FacesynthError(f"{beside} tells nothing of a prediction ({error}); remove it, or see the form it wants") from None
