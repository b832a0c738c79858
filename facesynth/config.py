"""Method settings from YAML files and from `key=value` on the command line."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from facesynth.inference.errors import FacesynthError


def load_config(path: str | Path) -> dict[str, Any]:
    """The settings of a flat YAML file; `include: other.yaml`, beside it, gives what it does not say itself.

    One level only: an included file may not include another.
    """
    settings = _read(Path(path))
    included = settings.pop("include", None)
    if included is None:
        return settings
    base = _read(Path(path).parent / str(included))
    if "include" in base:
        raise FacesynthError(f"{path}: {included} includes another file; only one level of include is read")
    return {**base, **settings}


def parse_settings(pairs: Sequence[str]) -> dict[str, Any]:
    """`["components=20", "phi=0.1"]` to a dictionary; values are read as YAML."""
    settings = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise FacesynthError(f"{pair!r} is no setting; wanted key=value, such as components=20")
        settings[key.strip()] = yaml.safe_load(value)
    return settings


def training_parser(about: str | None, config: Path) -> argparse.ArgumentParser:
    """What a script that trains takes; the model is called as its file of settings is, unless -o says otherwise.

    `parse_intermixed_args` lets settings stand anywhere; `settings_of` reads them.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("settings", nargs="*", metavar="KEY=VALUE")
    parser.add_argument("-o", "--output", type=Path, default=Path(f"{config.stem}.safetensors"))
    parser.add_argument("--config", type=Path, default=config)
    parser.add_argument("--device", help="auto, cpu, cuda or mps; as the settings say otherwise")
    parser.add_argument("--seed", type=int, default=0)
    return parser


def settings_of(options: argparse.Namespace) -> dict[str, Any]:
    """The file's settings, and before them those that were given one by one."""
    return {**load_config(options.config), **parse_settings(options.settings)}


def _read(path: Path) -> dict[str, Any]:
    try:
        loaded = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FacesynthError(f"{path}: cannot read settings ({error})") from None
    if not isinstance(loaded, Mapping):
        raise FacesynthError(f"{path}: wanted lines of `key: value`; got {type(loaded).__name__}")
    return dict(loaded)
