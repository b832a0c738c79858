"""Kinds of values that options have."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.methods.capabilities import Option
    from facesynth.stage.request import Part

FILE = click.Path(path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)
BROADCAST = {"23.976": Fraction(24000, 1001), "29.97": Fraction(30000, 1001), "59.94": Fraction(60000, 1001)}


class PartType(click.ParamType):
    """Who moves a part of the face: `off`, `recorded`, a factor, or a model of that part."""

    name = "off|recorded|factor|model"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Part:
        """The part as it was asked for."""
        from facesynth.stage.request import Part

        try:
            part = value if isinstance(value, Part) else Part.of(str(value))
            if part.model is not None and not part.model.is_file():
                raise FacesynthError("there is no such file")
        except (ValueError, FacesynthError) as error:
            self.fail(f"wanted off, recorded, a factor such as 0.5 or a model's file; got {value!r} ({error})", param, ctx)
        return part


class Intensity(click.ParamType):
    """A number from 0 to 1, or a file of intensities over time."""

    name = "0..1|file"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | Path:
        """The number; a path where it is none."""
        try:
            strength = float(value)
        except (TypeError, ValueError):
            return Path(value)
        if not 0 <= strength <= 1:
            self.fail(f"wanted a number from 0 to 1, or a CSV of time_s,intensity; got {value!r}", param, ctx)
        return strength


class Fps(click.ParamType):
    """A frame rate; 23.976, 29.97 and 59.94 mean the broadcast fractions."""

    name = "fps"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Fraction:
        """An exact fraction."""
        from facesynth.stage.request import RATES_HZ

        try:
            fps = BROADCAST.get(str(value)) or Fraction(str(value)).limit_denominator(100000)
        except (ValueError, ZeroDivisionError):
            fps = Fraction(0)
        if not RATES_HZ[0] <= fps <= RATES_HZ[1]:
            self.fail(f"wanted a rate from 1 to 1000 such as 30, 23.976 or 30000/1001; got {value!r}", param, ctx)
        return fps


class Size(click.ParamType):
    """Width and height in pixels."""

    name = "widthxheight"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[int, int]:
        """Two numbers; the request says which it can be."""
        if isinstance(value, tuple):
            return value
        width, _, height = str(value).partition("x")
        if not (width.isdigit() and height.isdigit()):
            self.fail(f"wanted WIDTHxHEIGHT such as 1280x720; got {value!r}", param, ctx)
        return int(width), int(height)


def type_of(option: Option) -> click.ParamType:
    """What a method's own option is given as."""
    if option.type is Path:
        return FILE
    bounded = option.least is not None or option.most is not None
    if option.type is int:
        return click.IntRange(_whole(option.least), _whole(option.most)) if bounded else click.INT
    if option.type is float:
        return click.FloatRange(option.least, option.most) if bounded else click.FLOAT
    return click.BOOL if option.type is bool else click.STRING


def _whole(bound: float | None) -> int | None:
    return None if bound is None else int(bound)
