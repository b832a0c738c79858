"""Which methods exist, what they can do, and how to make, save and load one by name.

Methods of other packages are found by entry points of the group `facesynth.methods`, each of which names an object of the
type `Capabilities`. Listing names imports none of them; asking what they can do imports what the entry point names.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Iterable, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, TypeVar

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.folder import open_folder
from facesynth.methods.capabilities import WORDS, Capabilities, Option
from facesynth.methods.trained import ExportedModel, TrainedModel, is_exported

if TYPE_CHECKING:
    from facesynth.corpus.checks.needs import Need
    from facesynth.inference.speech import PhoneTrack
    from facesynth.methods.method import Method

GROUP = "facesynth.methods"
BUILT_IN = {
    name: EntryPoint(name, f"facesynth.methods.{value}", GROUP)
    for name, value in {
        "mean_face": "baselines.capabilities:MEAN_FACE",
        "phone_mean": "baselines.capabilities:PHONE_MEAN",
        "viseme_table": "baselines.capabilities:VISEME_TABLE",
        "ridge": "baselines.capabilities:RIDGE",
        "head_rest": "baselines.capabilities:HEAD_REST",
        "head_ridge": "baselines.capabilities:HEAD_RIDGE",
        "head_sway": "baselines.capabilities:HEAD_SWAY",
        "eyes_random": "baselines.capabilities:EYES_RANDOM",
        "coarticulation": "coarticulation.capabilities:CAPABILITIES",
        "eyes": "eyes.capabilities:CAPABILITIES",
        "expression": "expression.capabilities:CAPABILITIES",
        "lds": "lds.capabilities:CAPABILITIES",
        "head_knn": "head_knn.capabilities:CAPABILITIES",
        "head_hmm": "head_hmm.capabilities:CAPABILITIES",
        "tcn": "baselines.capabilities:TCN",
        "network": "network.capabilities:CAPABILITIES",
        "anime_graph": "anime_graph.capabilities:CAPABILITIES",
        "efase": "efase.capabilities:CAPABILITIES",
    }.items()
}
"""Our own methods' entry points."""
DEFAULT = "efase"
"""The method of those who do not choose one."""
_CLASSES: dict[str, type[Method]] = {}

A = TypeVar("A")
M = TypeVar("M", bound="Method")


def register(capabilities: Capabilities) -> Callable[[type[M]], type[M]]:
    """Class decorator: make a method known by what it can do."""

    def add(cls: type[M]) -> type[M]:
        cls.name, cls.capabilities = capabilities.name, capabilities
        _CLASSES[capabilities.name] = cls
        return cls

    return add


def list_methods() -> list[str]:
    """Names that `create` knows; nothing is imported for it."""
    return sorted({*_entries(), *_CLASSES})


def capabilities_of(name: str) -> Capabilities:
    """What a method can do; FacesynthError with the nearest names where there is none, or where its package is broken."""
    if name in _CLASSES:
        return _CLASSES[name].capabilities
    if (entry := BUILT_IN.get(name) or _entries().get(name)) is None:  # reading what is installed takes a while
        raise unknown("method", name, list_methods())
    stated = _of_package(entry, entry.load)
    if not isinstance(stated, Capabilities) or stated.name != name:
        raise FacesynthError(f"{_said_by(entry)} must name the Capabilities of {name}; got {stated!r:.80}")
    return stated


def known_capabilities() -> tuple[list[Capabilities], list[str]]:
    """Of all methods, in the order of what they need to learn from; and a line for each that cannot say."""
    known, broken = (
        [],
        [
            f"{_said_by(entry)} is left out: {entry.name} is one of facesynth's own methods; give it another name"
            for entry in entry_points(group=GROUP)
            if entry.name in BUILT_IN
        ],
    )
    for name in [*BUILT_IN, *(name for name in list_methods() if name not in BUILT_IN)]:
        try:
            known.append(capabilities_of(name))
        except FacesynthError as error:
            broken.append(str(error))
    return sorted(known, key=lambda one: one.minutes), broken


def own_options(taken: Collection[str]) -> tuple[dict[str, Option], list[str]]:
    """All methods' own options of `speak` by name, ours first; and a line for each that is left out, or method that cannot say.

    An option is left out that is called as one that every model has (`taken`), or that is another kind of value elsewhere.
    """
    known, broken = known_capabilities()
    options: dict[str, Option] = {}
    owners: dict[str, str] = {}
    for one in sorted(known, key=lambda one: one.name not in BUILT_IN):
        for option in one.options:
            if option.name in taken:
                broken.append(f"{one.name}: {option.flag} is an option of every model and is left out; call it otherwise")
                continue
            owner = owners.setdefault(option.name, one.name)
            if options.setdefault(option.name, option).type is not option.type:
                broken.append(
                    f"{one.name} takes {option.flag} as a {option.type.__name__}, but {owner} as a"
                    f" {options[option.name].type.__name__}: it is left out; call it otherwise"
                )
    return options, broken


def needs() -> list[Need]:
    """What the methods need to learn from, for the check of a corpus."""
    from facesynth.corpus.checks.needs import Need

    return [Need(one.name, one.minutes, one.of_each_phone) for one in known_capabilities()[0] if one.minutes]


def able(ability: type) -> list[str]:
    """Names of the methods that have an ability."""
    return [one.name for one in known_capabilities()[0] if ability in one.abilities]


def ask(method: TrainedModel, ability: type[A]) -> A | None:
    """The method as one that has an ability; None where it has not."""
    able = method.model if isinstance(method, ExportedModel) else method
    return able if isinstance(able, ability) else None


def require(method: TrainedModel, ability: type[A]) -> A:
    """The same; FacesynthError, naming methods that have it, where it has not."""
    if (found := ask(method, ability)) is None:
        if isinstance(method, ExportedModel) and ability in method.capabilities.abilities:
            raise FacesynthError(f"{method.path} is an exported {method.name}, which {WORDS[ability][0]}; its own file does")
        without, others = WORDS[ability]
        raise FacesynthError(f"{method.name} {without}; {_joined(able(ability))} {others}")
    return found


def require_option(method: TrainedModel, name: str) -> Option:
    """A method's own option of `speak`; FacesynthError, naming methods that have it, where it has not."""
    if (own := method.capabilities.option(name)) is not None:
        return own
    having = {one.name: option for one in known_capabilities()[0] if (option := one.option(name))}
    if not having:
        raise unknown("option", name, [option.name for one in known_capabilities()[0] for option in one.options])
    flag = next(iter(having.values())).flag
    raise FacesynthError(f"{method.name} has no option {flag}; it is one of {_joined(having)}")


def read_option(method: TrainedModel, name: str, value: Any, phones: PhoneTrack) -> Any:
    """The value of a method's own option as `synthesize` takes it: a file is read, with the phones that are spoken."""
    option = require_option(method, name)
    if option.type is not Path:
        return option.checked(value)
    return resolve_name(option.reader)(Path(value), phones) if isinstance(value, str | Path) else value


def method_class(name: str) -> type[Method]:
    """The class behind a name; FacesynthError with the nearest names where there is none."""
    if name not in _CLASSES:
        home = capabilities_of(name).home
        _of_package(_entries()[name], lambda: importlib.import_module(home))
        if name not in _CLASSES:
            raise FacesynthError(f"{home} registers no method {name!r}, though {_said_by(_entries()[name])} says so")
    return _CLASSES[name]


def create(name: str, **config: Any) -> Method:
    """A new, untrained method; unknown config keys are answered with the nearest known one."""
    return method_class(name).from_config(config)


def of_table(name: str, table: str, config: Mapping[str, Any]) -> Method | None:
    """A model made of a table by hand, a CSV or one that comes with facesynth; None for what names no table.

    FacesynthError, naming methods that do, where the method learns from recordings alone.
    """
    stated = capabilities_of(name)
    if table not in stated.tables and Path(table).suffix.lower() != ".csv":
        return None
    if not stated.table_reader:
        having = [one.name for one in known_capabilities()[0] if one.table_reader]
        raise FacesynthError(f"{name} learns from recordings, not from a table such as {table}; {_joined(having)} takes one")
    made: Method = resolve_name(stated.table_reader)(table, config)
    return made


def load(path: str | Path) -> Method:
    """A trained method from a file that `Method.save` wrote; FacesynthError for anything else."""
    from facesynth.methods.model_file import read_header

    if is_exported(path):
        raise FacesynthError(f"{path} is an exported folder, which speaks and does nothing else; give the model's own file")
    method = method_class(read_header(path)["method"]).load(path)
    method.path = Path(path)
    return method


def load_trained(path: str | Path) -> TrainedModel:
    """A model that speaks: a trained method's file, or an exported folder, which needs no torch."""
    if not is_exported(path):
        return load(path)
    name = str(open_folder(path).manifest["method"])
    if name not in list_methods():
        raise FacesynthError(f"{path} holds {name}, which moves no face by itself; give a model that speaks")
    return ExportedModel(path, capabilities_of(name))


def _entries() -> Mapping[str, EntryPoint]:
    """Of other packages and our own; a name of ours cannot be taken over."""
    return {**{entry.name: entry for entry in entry_points(group=GROUP)}, **BUILT_IN}


def _of_package(entry: EntryPoint, import_it: Callable[[], A]) -> A:
    """What an import gives; whatever goes wrong in another package is told in one line and does not break the others."""
    if entry.name in BUILT_IN:
        return import_it()
    try:
        return import_it()
    except Exception as error:  # foreign code may raise anything; it is told, with the package to repair
        raise FacesynthError(f"{_said_by(entry)} cannot be imported ({error!r}); repair or remove it") from error


def _said_by(entry: EntryPoint) -> str:
    package = f" of the package {entry.dist.name}" if entry.dist else ""
    return f"the entry point {entry.name} = {entry.value}{package}"


def _joined(names: Iterable[str]) -> str:
    names = list(names)
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or "no method"
