"""Options of `speak` that the methods bring: every method's own, under its name in the help."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.types import type_of

if TYPE_CHECKING:
    from facesynth.methods.capabilities import Option


class WithMethodOptions(click.Command):
    """A command that has the own options of all known methods beside those that it states itself."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Its own, and the methods'."""
        return [*super().get_params(ctx), *self._brought()]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options of every model, then those that are one method's own."""
        brought = self._brought()
        own = {option.name: option.get_help_record(ctx) for option in brought}
        general = [record for p in super().get_params(ctx) if isinstance(p, click.Option) and (record := p.get_help_record(ctx))]
        for title, records in [("Options", general), *_by_method({k: v for k, v in own.items() if k and v})]:
            with formatter.section(title):
                formatter.write_dl(records)

    def _brought(self) -> list[click.Option]:
        taken = {name for p in self.params for name in (*p.opts, p.name)} | {"--help", "-h"}
        options, _ = own_options()
        return [
            click.Option([option.flag], type=type_of(option), help=option.help)
            for name, option in options.items()
            if not {name, option.flag} & taken
        ]


def own_options() -> tuple[dict[str, Option], list[str]]:
    """All methods' own options by name, and a line for each method that cannot say or contradicts another."""
    from facesynth.methods.registry import known_capabilities

    known, broken = known_capabilities()
    options: dict[str, Option] = {}
    for one in known:
        for option in one.options:
            if options.setdefault(option.name, option).type is not option.type:
                broken.append(f"{one.name} takes {option.flag} as another kind of value than another method; it is left out")
    return options, broken


def taken_apart(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What was given: the command's own options, and the methods' own that were given."""
    names = own_options()[0]
    own = {name: value for name, value in given.items() if name in names and value is not None}
    return {name: value for name, value in given.items() if name not in names}, own


def files_among(own: dict[str, Any]) -> list[str]:
    """Names of the methods' own options that are files, each of one recording."""
    return [name for name, value in own.items() if isinstance(value, Path)]


def _by_method(records: dict[str, tuple[str, str]]) -> list[tuple[str, list[tuple[str, str]]]]:
    from facesynth.methods.registry import known_capabilities

    rows = [
        (f"Options of {one.name}", [records[option.name] for option in one.options if option.name in records])
        for one in known_capabilities()[0]
    ]
    return [(title, own) for title, own in rows if own]
