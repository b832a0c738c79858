"""C3D files field by field: header, groups and parameters by name, for every processor, with whole or floating-point numbers."""

import struct
from dataclasses import dataclass, field, replace

import numpy as np

INTEL, DEC, MIPS = 84, 85, 86
BLOCK = 512
TEXT, BYTE, WHOLE, FLOAT = -1, 1, 2, 4
"""Types of parameters."""
NAMES = ["brow_l", "brow_r", "lip_upper", "lip_lower", "chin", "nose"]
REST = np.array([[40, 60, 50], [-40, 60, 50], [0, -30, 70], [0, -32, 69], [0, -70, 60], [0, 10, 90.0]])
PLACES = {"parameters": (0, "B"), "key": (1, "B"), "points": (2, "H"), "analog": (4, "H"), "first": (6, "H"), "last": (8, "H")}
PLACES |= {"gap": (10, "H"), "scale": (12, "f"), "data": (16, "H"), "per_frame": (18, "H"), "rate": (20, "f")}
"""Fields of the header: byte and type."""


def face(count=300, seed=0):
    """[count, 6, 3] markers of a face that moves, mm."""
    return REST + np.random.default_rng(seed).normal(0, 2, (count, 6, 3))


@dataclass(frozen=True)
class Parameter:
    group: int
    name: str
    kind: int
    dimensions: tuple[int, ...]
    value: tuple

    @classmethod
    def texts(cls, group, name, texts):
        width = max([len(text) for text in texts] + [1])
        return cls(group, name, TEXT, (width, len(texts)), tuple(text.ljust(width) for text in texts))


@dataclass(frozen=True, eq=False)
class File:
    """Everything that stands in a file."""

    points: np.ndarray
    """[T, K, 3]"""
    parameters: tuple[Parameter, ...]
    processor: int = INTEL
    whole_numbers: bool = False
    header: dict = field(default_factory=dict)
    """Fields that are written otherwise than they should be."""
    residuals: np.ndarray | None = None
    """[T, K]; those of gaps are -1 otherwise."""
    groups: tuple[str, ...] = ("POINT", "ANALOG")

    @property
    def scale(self):
        return float(np.nanmax(np.abs(self.points), initial=1.0)) / 32000

    def with_parameter(self, number, parameter):
        return replace(self, parameters=(*self.parameters[:number], parameter, *self.parameters[number + 1 :]))


def file(points, labels=NAMES, fps=120.0, unit="mm", more=(), without=(), **others):
    """A file that says what is usual."""
    made = File(points, (), **others)
    usual = [
        Parameter(1, "USED", WHOLE, (), (points.shape[1],)),
        Parameter(1, "FRAMES", WHOLE, (), (min(len(points), 65535),)),
        Parameter(1, "SCALE", FLOAT, (), (made.scale if made.whole_numbers else -1.0,)),
        Parameter(1, "RATE", FLOAT, (), (fps,)),
        Parameter(1, "DATA_START", WHOLE, (), (0,)),
        Parameter.texts(1, "LABELS", labels),
        Parameter.texts(1, "UNITS", [unit]),
        Parameter(2, "USED", WHOLE, (), (0,)),
        Parameter(2, "RATE", FLOAT, (), (0.0,)),
        Parameter(2, "GEN_SCALE", FLOAT, (), (1.0,)),
    ]
    kept = (parameter for parameter in usual if (parameter.group, parameter.name) not in without)
    return replace(made, parameters=(*kept, *more))


def content(made, data_start=None):
    """The bytes of a file."""
    blocks = -(-len(_parameters(made, 0)) // BLOCK)
    start = 2 + blocks if data_start is None else data_start
    section = _parameters(made, start)
    head = bytes([1, 80, len(section) // BLOCK & 255, made.processor])
    return _header(made, start) + head + section[4:] + _samples(made)


def write(path, made):
    path.write_bytes(content(made))
    return path


def _order(made):
    return ">" if made.processor == MIPS else "<"


def _floats(made, values):
    values = np.asarray(values, "<f4")
    if made.processor == DEC:
        return np.ascontiguousarray((values * 4).view("<u2").reshape(-1, 2)[:, ::-1]).tobytes()
    return values.astype(f"{_order(made)}f4").tobytes()


def _parameters(made, start):
    parts = [bytes(4)]
    for number, name in enumerate(made.groups, start=1):
        parts.append(struct.pack("bb", len(name), -number) + name.encode() + struct.pack(f"{_order(made)}h", 3) + b"\0")
    for parameter in made.parameters:
        value = (start,) if parameter.name == "DATA_START" and parameter.value == (0,) else parameter.value
        body = struct.pack("bB", parameter.kind, len(parameter.dimensions)) + bytes(parameter.dimensions)
        body += _value(made, parameter.kind, value) + b"\0"
        name = parameter.name.encode()
        parts.append(struct.pack("bb", len(name), parameter.group) + name)
        parts.append(struct.pack(f"{_order(made)}h", len(body) + 2) + body)
    whole = b"".join(parts) + bytes(2)
    return whole + bytes(-len(whole) % BLOCK)


def _value(made, kind, value):
    if kind == TEXT:
        return "".join(value).encode("latin-1")
    if kind == FLOAT:
        return _floats(made, value)
    return np.array(value, np.int64).astype("u1" if kind == BYTE else f"{_order(made)}u2").tobytes()


def _header(made, start):
    count, points, _ = made.points.shape
    scale = made.scale if made.whole_numbers else -1.0
    rate = next((p.value[0] for p in made.parameters if (p.group, p.name) == (1, "RATE")), 120.0)
    fields = {"parameters": 2, "key": 80, "points": points, "first": 1, "last": min(count, 65535), "gap": 10}
    fields |= {"scale": scale, "data": start, "rate": rate, **made.header}
    header = bytearray(BLOCK)
    for name, value in fields.items():
        place, kind = PLACES[name]
        size = {"B": 1, "H": 2, "f": 4}[kind]
        header[place : place + size] = _floats(made, [value]) if kind == "f" else struct.pack(_order(made) + kind, value)
    return bytes(header)


def _samples(made):
    gaps = np.isnan(made.points).any(axis=2)
    residuals = np.where(gaps, -1.0, 0.0) if made.residuals is None else made.residuals
    numbers = np.concatenate([np.nan_to_num(made.points), residuals[..., None]], axis=2)
    if made.whole_numbers:
        numbers[..., :3] /= made.scale
        written = np.rint(numbers).astype(f"{_order(made)}i2").tobytes()
    else:
        written = _floats(made, numbers.ravel())
    return written + bytes(-len(written) % BLOCK)
