"""What the channels of a motion are."""

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError, unknown

Kind = Literal["markers", "landmarks", "curves"]
DIMENSIONS: Mapping[str, int] = {"markers": 3, "landmarks": 2, "curves": 1}
UNITS: Mapping[str, str] = {"markers": "mm", "landmarks": "px", "curves": "weight"}


@dataclass(frozen=True)
class Layout:
    """Names and groups of K markers in 3-D (mm), K landmarks in 2-D (px) or K curves (0..1).

    Axes of points: x to the performer's left, y up, z out of the face.
    """

    kind: Kind
    names: tuple[str, ...]
    """K names of points or curves, unique."""
    groups: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Point indices by group: mouth, lower_lip, upper_lip, jaw, brows, eyelids, cheeks, rigid, …"""
    lip_pairs: tuple[tuple[int, int], ...] = ()
    """(upper, lower) points on the inner lips that face each other."""
    neutral: tuple[float, ...] | None = None
    """C channels of the rest pose (mouth closed), if it is known."""

    def __post_init__(self) -> None:
        if self.kind not in DIMENSIONS:
            raise unknown("layout kind", self.kind, DIMENSIONS)
        if not self.names or len(set(self.names)) != len(self.names):
            raise FacesynthError(
                f"a layout needs unique names, at least one; got {len(self.names)} with {len(set(self.names))} different"
            )
        used = [i for group in self.groups.values() for i in group] + [i for pair in self.lip_pairs for i in pair]
        if used and not 0 <= min(used) <= max(used) < len(self.names):
            raise FacesynthError(f"layout groups name point {max(used)}, but there are only {len(self.names)} points")
        if self.neutral is not None and len(self.neutral) != self.channels:
            raise FacesynthError(f"the neutral pose has {len(self.neutral)} values; the layout has {self.channels} channels")

    @property
    def dimension(self) -> int:
        """Channels of one point: 3, 2 or 1."""
        return DIMENSIONS[self.kind]

    @property
    def channels(self) -> int:
        """C, the width of a frame."""
        return len(self.names) * self.dimension

    @property
    def unit(self) -> str:
        """mm, px or weight."""
        return UNITS[self.kind]

    def group(self, name: str) -> NDArray[np.int64]:
        """Point indices of a group; FacesynthError where the layout has no such group."""
        if name not in self.groups:
            raise unknown("layout group", name, self.groups)
        return np.asarray(self.groups[name], np.int64)

    def columns(self, name: str) -> NDArray[np.int64]:
        """Channel indices of a group."""
        return (self.group(name)[:, None] * self.dimension + np.arange(self.dimension)).ravel()

    def points(self, frames: NDArray[Any]) -> NDArray[Any]:
        """View frames [..., C] as points [..., K, dimension]."""
        return frames.reshape(*frames.shape[:-1], len(self.names), self.dimension)

    def to_dict(self) -> dict[str, Any]:
        """Plain lists and strings, for YAML and JSON."""
        plain: dict[str, Any] = {
            "kind": self.kind,
            "names": list(self.names),
            "groups": {k: list(v) for k, v in self.groups.items()},
        }
        plain["lip_pairs"] = [list(pair) for pair in self.lip_pairs]
        plain["neutral"] = None if self.neutral is None else list(self.neutral)
        return plain

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of `to_dict`; points of groups and lip pairs may be given by number or by name."""
        if not isinstance(plain, Mapping):
            raise FacesynthError(f"a layout is a mapping of kind, names, …; got {type(plain).__name__}")
        if lacking := [field for field in ("kind", "names") if field not in plain]:
            raise FacesynthError(f"{lacking[0]!r} is missing in the layout")
        extra = set(plain) - {"kind", "names", "groups", "lip_pairs", "neutral"}
        if extra:
            raise unknown("layout field", sorted(extra)[0], ("kind", "names", "groups", "lip_pairs", "neutral"))
        names = tuple(map(str, _listed("names", plain["names"])))
        groups = plain.get("groups") or {}
        if not isinstance(groups, Mapping):
            raise FacesynthError(f"the layout's groups are a mapping from a name to points; got {type(groups).__name__}")
        pairs = [_listed("a pair of lip points", pair) for pair in _listed("lip_pairs", plain.get("lip_pairs") or ())]
        if odd := next((pair for pair in pairs if len(pair) != 2), None):
            raise FacesynthError(f"a pair of lip points is an upper and a lower one; got {odd}")
        return cls(
            str(plain["kind"]),  # type: ignore[arg-type]  # checked in __post_init__
            names,
            {str(name): tuple(_number(point, names) for point in _listed(name, group)) for name, group in groups.items()},
            tuple((_number(upper, names), _number(lower, names)) for upper, lower in pairs),
            _neutral(plain.get("neutral")),
        )


def _listed(what: Any, value: Any) -> list[Any]:
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise FacesynthError(f"{what} of a layout must be a list; got {type(value).__name__}")
    return list(value)


def _neutral(value: Any) -> tuple[float, ...] | None:
    if value is None:
        return None
    try:
        return tuple(float(number) for number in _listed("neutral", value))
    except (TypeError, ValueError) as error:
        raise FacesynthError(f"the neutral pose of a layout holds numbers; {error}") from None


def _number(point: Any, names: tuple[str, ...]) -> int:
    """The number of a point that is given by number or by name."""
    if isinstance(point, numbers.Integral) and not isinstance(point, bool):
        return int(point)
    if not isinstance(point, str):
        raise FacesynthError(f"a layout's points are given by number or by name; got {point!r}")
    if point not in names:
        raise unknown("point of a group", point, names)
    return names.index(point)
