"""What speaks: a trained method, or the same without torch, from an exported folder."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import MANIFEST
from facesynth.inference.layout import Layout
from facesynth.inference.loading import load as load_folder
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Capabilities


class TrainedModel(Protocol):
    """A trained model that turns speech into motion; every `Method` is one."""

    path: Path | None
    fps: float
    emotions: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of its method."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """What its method can do."""
        ...

    @property
    def needs_phones(self) -> bool:
        """Whether it must be told what is said."""
        ...

    @property
    def fitted_layout(self) -> Layout:
        """Of its motion."""
        ...

    def synthesize(self, speech: Speech, *, seed: int = 0) -> Motion:
        """Motion for new speech, as long as its phone track; with its own options."""
        ...


class ExportedModel:
    """A method in a folder that `facesynth export` wrote: numpy and onnxruntime run it, on the processor.

    FacesynthError where the folder holds nothing that moves a face.
    """

    def __init__(self, folder: str | Path, capabilities: Capabilities) -> None:
        self.path: Path | None = Path(folder)
        self.capabilities, self.name = capabilities, capabilities.name
        self.model = load_folder(folder)
        if not hasattr(self.model, "synthesize"):
            raise FacesynthError(f"{folder} holds {self.name}, which moves no face by itself; give a model that speaks")
        self.fps: float = self.model.fps
        self.emotions: tuple[str, ...] = tuple(self.model.emotions)

    @property
    def fitted_layout(self) -> Layout:
        """Of its motion."""
        layout: Layout = self.model.layout
        return layout

    @property
    def needs_phones(self) -> bool:
        """Whether it must be told what is said: the exported model says so, where its settings decide."""
        return bool(getattr(self.model, "needs_phones", self.capabilities.needs_phones))

    @cached_property
    def provenance(self) -> Mapping[str, Any]:
        """Whose recordings it learned from, with licences and consents, as the corpus stated them."""
        stated: Mapping[str, Any] = self.model.manifest["training_data"]
        return stated

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion for new speech; FacesynthError for an option that works with torch alone, or not at all."""
        motion: Motion = self.model.synthesize(speech, seed=seed, **options)
        return motion

    def stream(self, **options: Any) -> Any:
        """A stream (docs/runtime.md says of what, by method); FacesynthError where the model must have the whole."""
        if not hasattr(self.model, "stream"):
            raise FacesynthError(f"{self.name} has no stream; give it whole utterances: model.synthesize(speech)")
        return self.model.stream(**options)


def on_device(trained: Any, device: str) -> TrainedModel:
    """A model where a person wants it: auto, cpu, cuda or mps; FacesynthError where that is not there."""
    if isinstance(trained, ExportedModel):
        if device not in ("auto", "cpu"):
            raise FacesynthError(
                f"{trained.path} is an exported model and runs on the processor; take --device cpu, not {device}"
            )
        return trained
    from facesynth.device import device_of

    placed: TrainedModel = trained.to(device_of(device))
    return placed


def is_exported(path: str | Path) -> bool:
    """Whether a path is a folder that `facesynth export` wrote."""
    return (Path(path) / MANIFEST).is_file()
