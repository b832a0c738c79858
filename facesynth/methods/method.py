"""What every method of the zoo is: an `nn.Module` that learns from a corpus and turns speech into motion."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from errno import EIO
from pathlib import Path
from typing import Any, ClassVar, Self, get_type_hints

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import nn

from facesynth import __version__
from facesynth.atomic import atomic_path
from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Capabilities

FORMAT = 2
"""Version of the model file; a file of another version is refused."""

_FITTING: dict[type, tuple[type, ...]] = {float: (float, int), int: (int,), bool: (bool,), str: (str,)}
_HEADER: dict[str, type | tuple[type, ...]] = {
    "method": str,
    "config": dict,
    "layout": dict,
    "fps": (float, int),
    "emotions": list,
    "facts": dict,
    "provenance": dict,
    "tensors": dict,
}
"""What the header of a model file holds, and of what kind."""


@dataclass(frozen=True)
class Prepared:
    """What was learned before `fit`."""

    config: Mapping[str, Any]
    """The config to fit with."""
    account: Mapping[str, Any] = field(default_factory=dict)
    """What the trained model remembers of it, as JSON can hold it; empty where nothing was learned."""


class Method(nn.Module):
    """Base of all methods: config in, `fit`, `synthesize`, one safetensors file on disk.

    A subclass takes its config as arguments of `__init__`, keeps learned arrays in buffers
    and everything else that it learned in `facts`, a dictionary that JSON can hold.
    """

    name: ClassVar[str]
    capabilities: ClassVar[Capabilities]
    config: dict[str, Any]
    """Every argument of the constructor, those left out at their defaults."""

    def __new__(cls, *args: Any, **config: Any) -> Self:
        """Keep the constructor's arguments as the config, so that no method repeats their names."""
        method = super().__new__(cls)
        given = inspect.signature(cls.__init__).bind_partial(method, *args, **config)
        given.apply_defaults()
        method.config = dict(list(given.arguments.items())[1:])
        return method

    def __init__(self) -> None:
        super().__init__()
        self.path: Path | None = None
        """Where it was loaded from."""
        self.layout: Layout | None = None
        self.fps: float = 0.0
        self.emotions: tuple[str, ...] = ()
        self.facts: dict[str, Any] = {}
        self.provenance: dict[str, Any] = {}

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> Self:
        """Make one from a dictionary whose keys are checked against the constructor's arguments."""
        known = [p for p in inspect.signature(cls.__init__).parameters if p != "self"]
        for key in config:
            if key not in known:
                raise unknown(f"{cls.name} setting", key, known)
        hints = get_type_hints(cls.__init__)
        for key, value in config.items():
            if (kind := hints.get(key)) in _FITTING and type(value) not in _FITTING[kind]:
                raise FacesynthError(f"{cls.name} setting {key} must be a {kind.__name__}; got {value!r}")
        return cls(**config)

    @classmethod
    def prepared(cls, config: Mapping[str, Any], corpus: Corpus, seed: int) -> Prepared:
        """Learn, before `fit`, what config to fit with; here the one given.

        A method that learns numbers of its own config overrides this: it may train what it likes on parts of the corpus.
        """
        return Prepared(config)

    def remember(self, account: Mapping[str, Any]) -> None:
        """Keep, after `fit`, the account of `prepared`; an override may also put it to use."""
        if account:
            self.facts["learned"] = dict(account)

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from a corpus; returns self. It takes the config as it is; `facesynth.methods.training.train` prepares it."""
        raise NotImplementedError

    def synthesize(self, speech: Speech, *, seed: int = 0) -> Motion:
        """Motion for new speech, as long as its phone track, at the rate the method learned.

        A method adds options of its own as keywords.
        """
        raise NotImplementedError

    @property
    def fitted_layout(self) -> Layout:
        """The layout learned from; FacesynthError before `fit`."""
        if self.layout is None:
            raise FacesynthError(f"this {self.name} model is not trained; call fit(corpus) or load(path) first")
        return self.layout

    def learned_from(self, corpus: Corpus) -> None:
        """Remember what every saved model states of its training data."""
        self.layout, self.fps, self.emotions = corpus.layout, corpus.fps, corpus.emotions
        self.provenance = corpus.provenance()

    def save(self, path: str | Path) -> None:
        """Write one safetensors file, atomically; config, layout and provenance are its metadata."""
        tensors = {key: value.detach().cpu().contiguous() for key, value in self.state_dict().items()}
        header = {
            "method": self.name,
            "config": self.config,
            "layout": self.fitted_layout.to_dict(),
            "fps": self.fps,
            "emotions": list(self.emotions),
            "facts": self.facts,
            "provenance": self.provenance,
            "tensors": {key: list(value.shape) for key, value in tensors.items()},
            "facesynth": __version__,
            "format": FORMAT,
        }
        with atomic_path(path) as part:
            try:
                save_file(tensors, part, metadata={"facesynth": json.dumps(header, sort_keys=True)})
            except SafetensorError as error:  # a full disk, a limit on file sizes
                raise OSError(EIO, f"the model cannot be written ({error})") from error

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; a truncated, foreign or other-version file is a FacesynthError."""
        header = read_header(path)
        if header["method"] != cls.name:
            raise FacesynthError(f"{path} holds a model of method {header['method']!r}, not {cls.name!r}")
        method = cls.from_config(header["config"])
        method.layout = Layout.from_dict(header["layout"])
        method.fps, method.emotions = float(header["fps"]), tuple(header["emotions"])
        method.facts, method.provenance = header["facts"], header["provenance"]
        modules = dict(method.named_modules())
        for key, tensor in _read_tensors(path, header["tensors"]).items():
            owner, _, leaf = key.rpartition(".")
            if owner not in modules:
                raise FacesynthError(f"{path} was written by another version of {cls.name}, which had a {owner}; train it again")
            _set_buffer(modules[owner], leaf, tensor)
        return method.eval()


def read_header(path: str | Path) -> dict[str, Any]:
    """The metadata of a model file; FacesynthError says what is wrong with a file that has none."""
    if not Path(path).is_file():
        raise FacesynthError(f"{path}: no such model file; train one with `facesynth train`")
    try:
        with safe_open(path, "pt") as file:
            text = (file.metadata() or {}).get("facesynth")
    except (SafetensorError, OSError) as error:
        raise FacesynthError(f"{path} is not a facesynth model, or is truncated ({error})") from None
    if text is None:
        raise FacesynthError(f"{path} is a safetensors file without a facesynth header; it was not written by facesynth")
    try:
        header = json.loads(text)
    except ValueError:
        raise FacesynthError(f"{path} has a damaged facesynth header; train the model again") from None
    if not isinstance(header, dict):
        raise FacesynthError(f"{path} has a damaged facesynth header; train the model again")
    if header.get("format") != FORMAT:
        raise FacesynthError(f"{path} has model format {header.get('format')}; this facesynth reads {FORMAT}: train it again")
    if wrong := [key for key, kind in _HEADER.items() if not isinstance(header.get(key), kind)]:
        raise FacesynthError(f"{path} has a damaged facesynth header without {', '.join(wrong)}; train the model again")
    return header


def _read_tensors(path: str | Path, stated: Mapping[str, Any]) -> dict[str, torch.Tensor]:
    """The tensors of a model file, which must be those that its header states, in name and shape."""
    with safe_open(path, "pt") as file:
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - safe_open is no mapping
    found = {key: list(tensor.shape) for key, tensor in tensors.items()}
    for key in sorted({*stated, *found}):
        if found.get(key) != stated.get(key):
            raise FacesynthError(
                f"{path} is damaged: {key} has the shape {found.get(key)}, the header says {stated.get(key)}; train it again"
            )
    return tensors


def _set_buffer(module: nn.Module, name: str, value: torch.Tensor) -> None:
    if name in module._parameters:
        module._parameters[name] = nn.Parameter(value, requires_grad=False)
    else:
        module.register_buffer(name, value)
