"""Mapping files: what each channel of a head of one's own follows, in YAML."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.face.rig.channel_map import Channel, arkit_name
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.motion.arkit_names import ARKIT_NAMES

FIELDS = ("from", "gain", "offset", "limit", "mute", "turn")
SECTIONS = ("channels", "head", "mm_per_unit")


@dataclass(frozen=True)
class HeadMapping:
    """What a mapping file says about a head."""

    channels: Mapping[str, Channel]
    head: str = ""
    """Name of the node that turns with the head; empty: one called head, else everything."""
    mm_per_unit: float | None = None
    """Size of the file's unit; None: metres in glTF if the face is then as large as a face, else by the face's size."""


def read_mapping(path: str | Path) -> HeadMapping:
    """Read a mapping file (YAML): own channels under `channels`, and if need be `head` and `mm_per_unit`.

    A channel is an ARKit name, or `{from: NAME or {NAME: share, …}, gain, offset, limit: [low, high], mute}`;
    with `turn: [x, y, z]` it is a joint, which turns by so many degrees about the head's axes at 1.
    """
    import yaml

    path = Path(path)
    try:
        plain = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FacesynthError(f"{path} cannot be read as YAML ({' '.join(str(error).split())})") from None
    if not isinstance(plain, dict) or not isinstance(plain.get("channels"), dict):
        raise FacesynthError(f"{path} is no mapping: wanted `channels:` and below it lines such as `Mouth_Open: jawOpen`")
    for section in plain:
        if section not in SECTIONS:
            raise unknown("section of a mapping", str(section), SECTIONS)
    channels = {str(name): _channel(str(name), value, path) for name, value in plain["channels"].items()}
    unit = plain.get("mm_per_unit")
    mm_per_unit = None if unit is None else _number(unit, f"{path}: mm_per_unit")
    if mm_per_unit is not None and not mm_per_unit > 0:
        raise FacesynthError(f"{path}: mm_per_unit must be positive, such as 10 for centimetres; got {mm_per_unit:g}")
    return HeadMapping(channels, str(plain.get("head") or ""), mm_per_unit)


def _channel(name: str, value: Any, path: Path) -> Channel:
    where = f"{path}, channel {name}"
    if isinstance(value, str):
        return Channel({_arkit(value): 1.0})
    if not isinstance(value, dict):
        raise FacesynthError(f"{where}: wanted an ARKit name, or {{from: …, gain: …}}; got {value!r}")
    for field in value:
        if field not in FIELDS:
            raise unknown(f"field in {where}", str(field), FIELDS)
    source = value.get("from", {})
    if not isinstance(source, (str, dict)):
        raise FacesynthError(f"{where}: `from` is an ARKit name or names with shares; got {source!r}")
    shares = {source: 1.0} if isinstance(source, str) else source
    limit = value.get("limit", [0.0, 1.0])
    if not isinstance(limit, list) or len(limit) != 2:
        raise FacesynthError(f"{where}: limit is [low, high]; got {limit!r}")
    low, high = (_number(end, f"{where}, limit") for end in limit)
    if low > high:
        raise FacesynthError(f"{where}: the lower limit {low:g} is above the upper one {high:g}")
    return Channel(
        {_arkit(str(key)): _number(share, f"{where}, share of {key}") for key, share in shares.items()},
        _number(value.get("gain", 1.0), f"{where}, gain"),
        _number(value.get("offset", 0.0), f"{where}, offset"),
        low,
        high,
        bool(value.get("mute", False)),
        _turn(value.get("turn"), where),
    )


def _turn(value: Any, where: str) -> tuple[float, float, float] | None:
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3:
        raise FacesynthError(f"{where}: turn is degrees about the axes [left, up, out of the face]; got {value!r}")
    left, up, out = (_number(angle, f"{where}, turn") for angle in value)
    return left, up, out


def _arkit(name: str) -> str:
    found = arkit_name(name)
    if found is None:
        raise unknown("ARKit name", name, ARKIT_NAMES)
    return found


def _number(value: Any, what: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise FacesynthError(f"{what} must be a number; got {value!r}")
    return number
