"""Which models can be exported, and how a model file becomes a folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.weights import Weights, stored_as
from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.detector import EmotionDetector
from facesynth.methods.model_file import read_header
from facesynth.methods.registry import known_capabilities, load


@dataclass(frozen=True, eq=False)
class Exportable:
    """A trained model that can leave torch."""

    subject: Subject
    content: Callable[[], Content]
    """Makes the graphs and the arrays."""


def export_model(
    path: str | Path,
    folder: str | Path,
    weights: Weights = "float32",
    *,
    only: str | None = None,
    beside: tuple[Path, float] | None = None,
) -> dict[str, Any]:
    """Write a folder that runs without torch; returns its manifest. FacesynthError where a graph is not exact enough.

    only: the one method that is wanted; a model of another is refused. beside: the file of another model, whose motion counts
    that share (0..1) of the mean of both.
    """
    model = exportable(path, beside)
    if only not in (None, model.subject.method):
        raise FacesynthError(
            f"{path} holds a model of method {model.subject.method!r}; wanted {only}. `facesynth export` takes any"
        )
    return write_folder(folder, model.subject, stored_as(model.content(), weights))


def exportable(path: str | Path, beside: tuple[Path, float] | None = None) -> Exportable:
    """The model in a file, a method with an exporter of its own or an emotion detector."""
    if read_header(path)["method"] == EmotionDetector.name and beside is None:
        from facesynth.export.emotion import emotion_content

        detector = EmotionDetector.load(path)
        subject = Subject(detector.name, detector.provenance, None, None, detector.emotions)
        return Exportable(subject, lambda: emotion_content(detector))
    model = load(path)
    exporter = model.capabilities.exporter
    if not exporter:
        having = [one.name for one in known_capabilities()[0] if one.exporter]
        raise FacesynthError(f"{path} holds a model of method {model.name!r}; wanted one of {', '.join(having)}, or emotion")
    subject = Subject(model.name, model.provenance, model.fitted_layout.to_dict(), model.fps, model.emotions)
    if beside is None:
        return Exportable(subject, lambda: resolve_name(exporter)(model))
    from facesynth.export.beside import with_beside

    return Exportable(subject, lambda: with_beside(resolve_name(exporter)(model), model, *beside))
