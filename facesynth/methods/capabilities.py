"""What a method can do, stated apart from what does it, so that one may ask without importing torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus.journal import Edits
    from facesynth.inference.motion import Motion
    from facesynth.inference.speech import PhoneTrack, Speech
    from facesynth.motion.maps.phone_map import Kind, PhoneMap

Part = Literal["mouth", "expression", "head", "eyes"]
"""Of the face: what a method moves."""
OptionType = type[bool] | type[int] | type[float] | type[str] | type[Path]


@dataclass(frozen=True)
class Option:
    """A keyword of a method's own in `synthesize`; `look_ahead` is --look-ahead on the command line."""

    name: str
    type: OptionType
    """What it is given as; a Path is a file, which `reader` reads."""
    help: str
    least: float | None = None
    most: float | None = None
    reader: str = ""
    """`module:function` that makes the value of a file and of the phones that are spoken: (Path, PhoneTrack) -> value."""

    @property
    def flag(self) -> str:
        """As it is written on the command line."""
        return "--" + self.name.replace("_", "-")

    def checked(self, value: Any) -> Any:
        """A value that fits; FacesynthError for any other."""
        fitting = (int, float) if self.type is float else (self.type,)
        low, high = (-inf if self.least is None else self.least), (inf if self.most is None else self.most)
        if type(value) not in fitting or (self.type in (int, float) and not low <= value <= high):
            bounds = f" from {low:g} to {high:g}" if self.type in (int, float) else ""
            raise FacesynthError(f"{self.flag} must be a {self.type.__name__}{bounds}; got {value!r}")
        return value


@dataclass(frozen=True)
class Account:
    """What a method says of the motion that it found."""

    facts: Mapping[str, Any]
    """As JSON can hold it."""
    warnings: Sequence[str] = ()
    remarks: Sequence[str] = ()


@runtime_checkable
class Explaining(Protocol):
    """Tells why it chose what."""

    def explain(self, speech: Speech, **options: Any) -> list[dict[str, Any]]:
        """One entry for each phone, as JSON can hold it."""
        ...


@runtime_checkable
class Accounting(Protocol):
    """Tells how well its search went."""

    def account(self, speech: Speech, **options: Any) -> Account:
        """Of the motion for a speech."""
        ...


@runtime_checkable
class Reporting(Protocol):
    """Has figures of its own, averaged into columns of their own."""

    def report(self, speech: Speech) -> Mapping[str, float]:
        """Figures (1) of what it makes of a speech."""
        ...


@runtime_checkable
class Joining(Protocol):
    """Joins pieces of recorded motion."""

    def joins(self, speech: Speech) -> Sequence[int]:
        """First frames of the pieces that it joins for a speech, without frame 0."""
        ...


@runtime_checkable
class MappingEmotions(Protocol):
    """Maps any motion of its layout, its own or another method's, to another emotion."""

    def map_along(self, motion: Motion, speech: Speech, target: str, *, intensity: float = 1.0) -> Motion:
        """From the speech's emotions to the target; an intensity of 0 leaves the motion as it is."""
        ...


@runtime_checkable
class Looking(Protocol):
    """Moves eyes that know of the head."""

    def look(self, motion: Motion, *, seed: int = 0, phones: PhoneTrack | None = None, turning: float = 1.0) -> Motion:
        """The motion with eyes that go with its head and with what is said; the head turns with wide looks, if it may."""
        ...


@runtime_checkable
class Expressing(Protocol):
    """Adds emotions to any neutral motion of its layout."""

    def express(self, motion: Motion, speech: Speech, *, seed: int = 0) -> Motion:
        """With the speech's emotions at their intensities; one of 0 leaves the motion as it is, to the byte."""
        ...


@runtime_checkable
class Streaming(Protocol):
    """Makes motion while the phones arrive."""

    def open_stream(self, *, look_ahead: int) -> Any:
        """Something to push phones into and take frames from."""
        ...


class Draft(Protocol):
    """What was found for a speech while it is edited; its motion is made when it is asked for."""

    @property
    def changed_s(self) -> tuple[float, float] | None:
        """From where to where its motion may look otherwise than that of the editor's draft before it; None: nowhere."""
        ...

    def motion(self, start_s: float = 0.0, stop_s: float | None = None) -> Motion:
        """The whole, as `synthesize` makes it, or the frames of a window, first shown while the whole is awaited."""
        ...

    def choices(self) -> list[dict[str, Any]]:
        """An entry for each phone of what was chosen for it, as `explain` has it; none where nothing was chosen."""
        ...


class Editor(Protocol):
    """Keeps what it found, so that a change of the speech or of an option costs little."""

    def change(self, speech: Speech, *, seed: int = 0, **options: Any) -> Draft:
        """The draft of a speech; options are the method's own, as of `synthesize`."""
        ...


@runtime_checkable
class Editing(Protocol):
    """Is quick after small changes; `facesynth.methods.editing.editor_of` makes an editor of every other method."""

    def edit(self) -> Editor:
        """A new editor, which knows nothing yet."""
        ...


@runtime_checkable
class Browsing(Protocol):
    """Chooses among recorded nodes, which can be looked at on maps."""

    def mapped_phones(self) -> tuple[str, ...]:
        """Phones that have nodes."""
        ...

    def phone_map(self, phone: str, kind: Kind = "isomap") -> PhoneMap:
        """The frames of one phone's nodes on a plane."""
        ...

    def edited(self, edits: Edits | None) -> Browsing:
        """The same without nodes that were removed, and with those that were drawn."""
        ...


WORDS: Mapping[type, tuple[str, str]] = {
    Explaining: ("tells nothing of its choices", "explain them"),
    Accounting: ("gives no account of its search", "give one"),
    Reporting: ("has no figures of its own", "have some"),
    Joining: ("joins no pieces", "join them"),
    MappingEmotions: ("learns no emotion maps", "learn them"),
    Looking: ("knows nothing of the head", "do"),
    Expressing: ("adds no expression to other motion", "add one"),
    Streaming: ("makes no motion while the phones arrive", "do"),
    Browsing: ("has no nodes to look at", "have some"),
    Editing: ("makes everything anew after each change", "keep what they found"),
}
"""What a method without an ability does not do, and what those with it do."""


@dataclass(frozen=True)
class Capabilities:
    """A method's entry: its name, what it can do, and where its code is."""

    name: str
    summary: str = ""
    """One line, for those who choose."""
    home: str = ""
    """The module that registers the class when it is imported; empty for a class that registered itself already."""
    part: Part = "mouth"
    """What it moves. A method of the head or the eyes leaves the frames at rest and moves `Motion.head` or `Motion.eyes`."""
    options: tuple[Option, ...] = ()
    """Its own options of `speak`."""
    abilities: frozenset[type] = field(default_factory=frozenset)
    """Of the protocols above."""
    needs_phones: bool = True
    """Whether it must be told what is said; one that hears the sound alone is asked for none, but may use given ones."""
    by_sound: Mapping[str, Any] = field(default_factory=dict)
    """Settings with which it hears the sound alone, where its defaults must be told what is said."""
    layouts: tuple[str, ...] = ("markers", "landmarks", "curves")
    """Kinds of motion that it learns."""
    minutes: float = 0.0
    """Of speech that it should have to learn from; a rule of thumb."""
    of_each_phone: int = 0
    """So many recordings of each phone in each emotion it should have."""
    reference: str = ""
    """Label of the row that every table of an evaluation has for it; empty for a method that is compared when asked."""
    nearest: Mapping[str, Any] = field(default_factory=dict)
    """Settings with which it is nearest to recordings, where its defaults are a paper's: those of `facesynth train CORPUS`."""
    tables: tuple[str, ...] = ()
    """Names of the tables by hand that come with facesynth, each of which is a model without a recording."""
    table_reader: str = ""
    """`module:function` that makes a trained model of such a table, or of a CSV by its path, and of settings."""
    exporter: str = ""
    """`module:function` that turns a trained model into what runs without torch."""
    tuner: str = ""
    """`module:function` that searches its settings on sentences held out."""

    def option(self, name: str) -> Option | None:
        """Its own option of this name."""
        return next((option for option in self.options if option.name == name), None)
