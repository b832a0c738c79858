"""Options that several verbs have, and how a verb prints what came out."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from facesynth.corpus.workers import Engine, Workers

as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
seeded = click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)


def show(as_json: bool, facts: Any, lines: Iterable[str]) -> None:
    """Print what a verb found: all facts as JSON, or lines for people."""
    text = json.dumps(facts, ensure_ascii=False, indent=2) if as_json else "\n".join(lines)
    click.echo(text, nl=bool(text))


def grouped(name: str, made: Callable[..., Any], **options: Any) -> Callable[[Any], Any]:
    """Options that a command gets as one argument `name`: what `made` makes of their values."""

    def decorated(command: Any) -> Any:
        @wraps(command)
        def with_group(**given: Any) -> None:
            command(**{name: made(**{option: given.pop(option) for option in options})}, **given)

        for option in reversed(options.values()):
            with_group = option(with_group)
        return with_group

    return decorated


def _workers(jobs: int, engine: Engine, address: str) -> Workers:
    from facesynth.corpus.workers import Workers

    return Workers(jobs, engine, address)


def spread_over(
    flag: str = "--jobs", default: int = os.cpu_count() or 1, help: str = "Tasks at once; all cores otherwise."
) -> Callable[[Any], Any]:
    """Who does the work: how many at once, --engine and --address, which the command gets as `workers`."""
    engine = click.Choice(["processes", "ray"])
    return grouped(
        "workers",
        _workers,
        jobs=click.option(flag, "jobs", type=click.IntRange(min=1), default=default, help=help),
        engine=click.option("--engine", type=engine, default="processes", show_default=True, help="Who works."),
        address=click.option("--address", default="", help="Of a Ray cluster that sees the same files; this computer otherwise."),
    )
