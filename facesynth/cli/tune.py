"""`facesynth tune`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import click

from facesynth.cli.options import as_json, seeded, show, spread_over
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError


@click.command("tune")
@click.argument("corpora", nargs=-1, required=True, type=FILE, metavar="CORPUS...")
@click.option("--method", help="Whose settings; the one whose settings can be searched, where there is one.")
@click.option("--settings", "given", type=FILE, help="Settings that all trials start from, as for train.")
@click.option("-o", "--output", type=FILE, help="Settings file; METHOD-tuned.yaml otherwise.")
@click.option("--sentences", default=24, show_default=True, help="Of each corpus, to tune on; none of them is learned from.")
@click.option("--test", "test_sentences", default=12, show_default=True, help="Of each corpus, to test what was found on.")
@click.option("--generations", default=10, show_default=True, help="Groups of evaluations after the first, 4 for each setting.")
@click.option("--limit", type=click.IntRange(min=2), help="Learn from at most so many utterances of each, evenly chosen.")
@spread_over("--workers", 2, "Processes at once; what is found does not depend on it.")
@seeded
@as_json
def tune(
    *,
    corpora: tuple[Path, ...],
    method: str | None,
    given: Path | None,
    output: Path | None,
    sentences: int,
    test_sentences: int,
    as_json: bool,
    **limits: Any,
) -> None:
    """Search a method's settings on held-out sentences of every CORPUS together; interrupted, it goes on where it was.

    What is found is nearest over all of them, each counting alike and a loss on one ten times; it is tested on other
    sentences of each. What is 3 % farther on one CORPUS than the settings that trials start from is not tried on the next.
    """
    import yaml

    from facesynth.atomic import write_text
    from facesynth.config import load_config
    from facesynth.corpus import Corpus

    name, tuner = _tuner(method)
    output = output or Path(f"{name}-tuned.yaml")
    counts = {"sentences": sentences, "test_sentences": test_sentences, **limits}
    opened, settings = [Corpus.open(corpus) for corpus in corpora], load_config(given) if given else {}
    found = resolve_name(tuner)(opened, journal=output.with_suffix(".jsonl"), settings=settings, **counts)
    write_text(output, yaml.safe_dump({k: float(f"{v:.4g}") for k, v in found.settings.items()}, sort_keys=False))
    tried = f"{found.evaluations} settings tried on {sentences} sentences of each corpus; {output} holds the nearest"
    show(as_json, asdict(found), [tried, *_results(found, test_sentences)])


def _results(found: Any, count: int) -> Iterator[str]:
    ratios = ", ".join(f"{performer} {ratio:.4f}" for performer, ratio in found.ratios.items())
    yield f"error on these sentences over that of the settings it started from: {ratios}"
    yield f"on {count} other sentences of each, mean squared error:\n"
    yield "| corpus | found | default | published | found nearer than default |\n|---|---:|---:|---:|---:|"
    for one in found.tested:
        nearer = f"in {one.nearer}, farther in {one.farther}"
        yield f"| {one.performer} | {one.found:.4g} | {one.default:.4g} | {one.published:.4g} | {nearer} |"


def _tuner(method: str | None) -> tuple[str, str]:
    """Name of the method and of what searches its settings; FacesynthError where nothing does, or it must be chosen."""
    from facesynth.methods.registry import capabilities_of, known_capabilities

    tunable = {one.name: one.tuner for one in known_capabilities()[0] if one.tuner}
    if method is None and len(tunable) == 1:
        return next(iter(tunable.items()))
    if method is not None and capabilities_of(method).tuner:
        return method, tunable[method]
    raise FacesynthError(f"--method must be one whose settings can be searched: {', '.join(tunable)}; got {method}")
