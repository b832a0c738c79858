"""What a person says of files that do not say it themselves: what their channels are, and how they are written."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout

LAYOUT = "layout.yaml"
"""Beside recordings, or in their corpus."""
FILES = "files"
"""The key of a layout file under which it says how files are written."""
UNITS_MM = {"mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0, "um": 1e-3, "in": 25.4, "ft": 304.8}
_SPELLED = {
    **{"um": ("µm", "μm", "micron", "microns"), "in": ("inch", "inches", '"', "''"), "ft": ("foot", "feet", "'")},
    **{"mm": ("mms",), "cm": ("cms",), "m": ("mtr", "mtrs")},
}
_PREFIXES = {
    **{
        "um": ("micro",),
        "mm": ("milli", "mili", "milí"),
        "cm": ("centi", "zenti", "centí"),
        "dm": ("deci", "dezi", "decí"),
        "m": ("",),
    }
}
_METRES = ("metre", "meter", "mètre", "metro", "metr")
SPELLINGS = {spelled: unit for unit, spellings in _SPELLED.items() for spelled in spellings} | {
    f"{prefix}{metre}{many}": unit
    for unit, prefixes in _PREFIXES.items()
    for prefix in prefixes
    for metre in _METRES
    for many in ("", "s", "i")
}
"""Other ways to write the units."""
AXES = "xyz"
ORDER = ("time", "points", "axes")
DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " ", "\\t": "\t"}


@dataclass(frozen=True)
class Written:
    """How files are written; what is empty they say themselves, or it is as usual."""

    array: str = ""
    """Name of the variable of NPZ or MAT that holds the motion; fields of structs after dots."""
    rate: str = ""
    """Frames per second: a number, or the name of a variable."""
    unit: str = ""
    """Of points."""
    axes: str = ""
    """Which of the files' axes run to the performer's left, up, and out of the face, such as `x,z,-y`."""
    order: str = ""
    """The array's dimensions in order, such as `points,axes,time`."""
    columns: str = ""
    """Which of a frame's values are used, counted from 1, in the layout's order, such as `1-3,7-9`; the others are left out."""
    delimiter: str = ""
    """Between the cells of a CSV; the name or the sign."""
    decimal: str = ""
    """`,` in CSV with decimal commas."""
    time: str = ""
    """The column of a CSV that holds seconds."""

    def __post_init__(self) -> None:
        if self.unit and unit_mm(self.unit) is None:
            raise unknown("unit", self.unit, (*UNITS_MM, *SPELLINGS))
        if self.axes:
            axis_turns(self.axes)
        if self.order and (set(self.dimensions) - set(ORDER) or len(set(self.dimensions)) != len(self.dimensions)):
            raise FacesynthError(f"order lists {', '.join(ORDER)} (or time and points) in the array's order; got {self.order!r}")
        self.picked_from(0)
        if self.decimal not in ("", ".", ","):
            raise FacesynthError(f"decimal is . or , ; got {self.decimal!r}")
        if len(self.separator) > 1:
            raise FacesynthError(f"delimiter is one sign, or one of {', '.join(DELIMITERS)}; got {self.delimiter!r}")

    @property
    def dimensions(self) -> tuple[str, ...]:
        """`order` as a tuple."""
        return tuple(part.strip().lower() for part in self.order.split(",")) if self.order else ()

    def picked_from(self, count: int) -> list[int]:
        """Places of the values that are used, of `count`; all where `columns` says nothing. count 0: whatever there are."""
        if not self.columns:
            return list(range(count))
        places: list[int] = []
        for part in self.columns.split(","):
            span = re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", part)
            first, last = (int(span[1]), int(span[2] or span[1])) if span else (0, 0)
            if not 1 <= first <= last:
                raise FacesynthError(f"columns are numbers from 1 on, or ranges such as 1-3,7-9; got {self.columns!r}")
            places += range(first - 1, last)
        if count and max(places) >= count:
            raise FacesynthError(f"columns name value {max(places) + 1} of a frame, but there are only {count}")
        return places

    @property
    def separator(self) -> str:
        """The sign between the cells of a CSV; empty where the file shows it."""
        return DELIMITERS.get(self.delimiter.lower(), self.delimiter)

    def placed(self, points: NDArray[Any], unit: str = "mm") -> NDArray[np.float64]:
        """Points [..., 3] (or [..., 2]) in mm and with our axes."""
        scaled = np.asarray(points, np.float64) * (unit_mm(self.unit or unit) or 1.0)
        return turned(scaled, self.axes) if self.axes and points.shape[-1] == len(AXES) else scaled

    def over(self, other: "Written") -> "Written":
        """These words, and the other's where these say nothing."""
        return replace(other, **{f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name)})


@dataclass(frozen=True)
class Description:
    """What is known of files beside what they hold."""

    layout: Layout | None = None
    """None: the files name their channels."""
    written: Written = field(default_factory=Written)


def unit_mm(unit: str) -> float | None:
    """Millimetres of a unit, in any of its usual spellings; None for what is none."""
    words = [word for word in re.split(r"[\s\[\](){}.,;|]+", unit.lower().replace("(s)", "s")) if word]
    known = {SPELLINGS.get(word, word) for word in words}
    return UNITS_MM.get(known.pop()) if len(known) == 1 else None


def turned(points: NDArray[np.float64], axes: str) -> NDArray[np.float64]:
    """Points [T, K, 3] with other axes, said as three signed letters."""
    places, signs = axis_turns(axes)
    return points[..., places] * signs


def axis_turns(axes: str) -> tuple[list[int], list[float]]:
    """Place and sign of each of our axes in a file's."""
    parts = [part.strip().lower() for part in axes.split(",")]
    letters = [part.lstrip("+-") for part in parts]
    if sorted(letters) != list(AXES):
        raise FacesynthError(f"axes are three different signed letters such as x,z,-y; got {axes!r}")
    return [AXES.index(letter) for letter in letters], [-1.0 if part.startswith("-") else 1.0 for part in parts]


def read_description(path: Path) -> Description:
    """A layout file (YAML or JSON, or a corpus.yaml): kind, names, groups …, and under `files` how files are written."""
    import yaml

    try:
        plain = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise FacesynthError(f"{path}: no such layout file") from None
    except (yaml.YAMLError, OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} is not a layout: {' '.join(str(error).split())}") from None
    inner = plain.get("layout", plain) if isinstance(plain, dict) else plain
    if not isinstance(inner, dict) or not isinstance(inner.get(FILES) or {}, dict):
        raise FacesynthError(f"{path} is not a layout: wanted a mapping of kind, names … and {FILES}")
    try:
        written = _written(path, inner.pop(FILES, None) or {})
        return Description(Layout.from_dict(inner) if inner else None, written)
    except FacesynthError as error:
        raise FacesynthError(f"{path} is not a layout: {' '.join(str(error).split())}; it needs kind and names") from None


def description_beside(path: Path) -> Description | None:
    """What the `layout.yaml` in the folder of a file says, if there is one."""
    beside = path.with_name(LAYOUT)
    return read_description(beside) if beside.is_file() else None


def description_text(description: Description) -> str:
    """YAML that `read_description` reads."""
    import yaml

    plain = description.layout.to_dict() if description.layout else {}
    said = {f.name: value for f in fields(Written) if (value := getattr(description.written, f.name))}
    plain |= {FILES: said} if said else {}
    return str(yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120))


def _written(path: Path, plain: Mapping[str, Any]) -> Written:
    known = tuple(f.name for f in fields(Written))
    for name in plain:
        if name not in known:
            raise unknown(f"key under {FILES} in {path}", str(name), known)
    return Written(**{name: _text(value) for name, value in plain.items()})


def _text(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, list) else "" if value is None else str(value)
