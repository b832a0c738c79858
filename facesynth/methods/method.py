"""What every method of the zoo is: an `nn.Module` that learns from a corpus and turns speech into motion."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self, get_type_hints

import torch
from torch import nn

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError, reject_options, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Capabilities
from facesynth.methods.model_file import KINDS, Kinds, read_header, read_tensors, write_model

_FITTING: dict[type, tuple[type, ...]] = {float: (float, int), int: (int,), bool: (bool,), str: (str,)}
_KINDS: Kinds = {**KINDS, "layout": dict, "fps": (float, int), "facts": dict}
"""What the header of a method's file holds, and of what kind."""


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
        """Make one from a dictionary whose keys are checked against the constructor's arguments.

        `device` is where a method is trained, and no setting of it: `facesynth.methods.training.train` reads that.
        """
        config = {key: value for key, value in config.items() if key != "device"}
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

        A method adds options of its own as keywords; whatever else is given it hands to `refuse`.
        """
        raise NotImplementedError

    def refuse(self, options: Mapping[str, Any]) -> None:
        """FacesynthError where a caller gives options of `synthesize` that the method does not have."""
        reject_options(self.name, options, ("seed", *(option.name for option in self.capabilities.options)))

    @property
    def needs_phones(self) -> bool:
        """Whether it must be told what is said, as it is set; see `Capabilities`."""
        return self.capabilities.needs_phones

    @property
    def device(self) -> torch.device:
        """Where its tensors are, and where `fit` leaves what it learns."""
        return next(iter(self.state_dict(keep_vars=True).values())).device

    @property
    def fitted_layout(self) -> Layout:
        """The layout learned from; FacesynthError before `fit`."""
        if self.layout is None:
            raise FacesynthError(
                f"this {self.name} model is not trained; call fit(corpus) or load(path) first (every `fit` begins with"
                " self.learned_from(corpus))"
            )
        return self.layout

    def learned_from(self, corpus: Corpus, *, silent: bool = False) -> None:
        """Remember layout, rate, emotions and origin of the corpus, which a saved model states: the first line of every `fit`.

        FacesynthError where nothing is in it to learn from, or a layout that the method does not learn. silent: recordings
        without sound, which are of no use for speech, teach the method as well.
        """
        if not (corpus.records if silent else corpus.usable_records):
            raise FacesynthError(
                f"{corpus.path} has no usable utterance to learn from; record more, or see `facesynth corpus check`"
            )
        if self.needs_phones and not silent:
            require_phones(corpus, self.name)
        kind, known = corpus.layout.kind, self.capabilities.layouts
        if kind not in known:
            raise FacesynthError(f"{self.name} learns {' or '.join(known)}; {corpus.path} holds {kind}")
        self.layout, self.fps, self.emotions = corpus.layout, corpus.fps, corpus.emotions
        self.provenance = corpus.provenance()

    def save(self, path: str | Path) -> None:
        """Write one safetensors file, atomically; config, layout and provenance are its metadata."""
        header = {
            "method": self.name,
            "config": self.config,
            "layout": self.fitted_layout.to_dict(),
            "fps": self.fps,
            "emotions": list(self.emotions),
            "facts": self.facts,
            "provenance": self.provenance,
        }
        write_model(path, self, header)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; a truncated, foreign or other-version file is a FacesynthError."""
        header = read_header(path, _KINDS)
        if header["method"] != cls.name:
            raise FacesynthError(f"{path} holds a model of method {header['method']!r}, not {cls.name!r}")
        method = cls.from_config(header["config"])
        method.layout = Layout.from_dict(header["layout"])
        method.fps, method.emotions = float(header["fps"]), tuple(header["emotions"])
        method.facts, method.provenance = header["facts"], header["provenance"]
        read_tensors(path, method, header)
        return method.eval()


def require_phones(corpus: Corpus, name: str) -> None:
    """FacesynthError where a method that must be told what is said would learn from recordings of which nobody knows it."""
    unknown = corpus.without_phones()
    if unknown:
        count = f"{len(unknown)} of {len(corpus)} recordings of {corpus.path}" if len(unknown) > 1 else unknown[0]
        raise FacesynthError(
            f"{name} learns from phones, and nobody knows those of {count}; `facesynth corpus align` places them,"
            " or take a method that hears the sound alone (ridge, lds, network phones=false)"
        )
