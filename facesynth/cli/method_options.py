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

    def options_of_methods(self) -> tuple[dict[str, Option], list[str]]:
        """All methods' own options by name, and a line for each that is left out."""
        from facesynth.methods.registry import own_options

        flags = {flag.lstrip("-").replace("-", "_") for param in self.params for flag in (*param.opts, param.name or "")}
        return own_options({*flags, "help", "h"})

    def taken_apart(self, given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """What was given: the command's own options, and the methods' own that were given."""
        names = self.options_of_methods()[0]
        own = {name: value for name, value in given.items() if name in names and value is not None}
        return {name: value for name, value in given.items() if name not in names}, own

    def _brought(self) -> list[click.Option]:
        options = self.options_of_methods()[0].values()
        return [click.Option([option.flag], type=type_of(option), help=option.help) for option in options]


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
