"""`facesynth tune`."""

from dataclasses import asdict
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import click

from facesynth.cli.options import as_json, seeded, show
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError


@click.command("tune")
@click.argument("corpus", type=FILE)
@click.option("--method", help="Whose settings; the one whose settings can be searched, where there is one.")
@click.option("-o", "--output", type=FILE, help="Settings file; METHOD-tuned.yaml otherwise.")
@click.option("--sentences", default=24, show_default=True, help="To tune on; none of them is learned from.")
@click.option("--test", "test_sentences", default=12, show_default=True, help="To compare found and published settings on.")
@click.option("--generations", default=10, show_default=True, help="Of 28 evaluations each, after the first.")
@click.option("--limit", type=click.IntRange(min=2), help="Learn from at most so many utterances, evenly chosen.")
@click.option("--workers", default=2, show_default=True)
@seeded
@as_json
def tune(
    *, corpus: Path, method: str | None, output: Path | None, sentences: int, test_sentences: int, as_json: bool, **limits: Any
) -> None:
    """Search a method's settings on held-out sentences of CORPUS; interrupted, it goes on where it was."""
    import yaml

    from facesynth.atomic import write_text
    from facesynth.corpus import Corpus

    name, tuner = _tuner(method)
    output = output or Path(f"{name}-tuned.yaml")
    counts = {"sentences": sentences, "test_sentences": test_sentences, **limits}
    found = resolve_name(tuner)(Corpus.open(corpus), journal=output.with_suffix(".jsonl"), **counts)
    write_text(output, yaml.safe_dump({k: float(f"{v:.4g}") for k, v in found.settings.items()}, sort_keys=False))
    tuned = f"{found.evaluations} evaluations on {sentences} sentences; {output} holds the settings"
    errors = f"found {found.test_error:.4g}, published {found.published_test_error:.4g}"
    show(as_json, asdict(found), [tuned, f"on {test_sentences} other sentences: {errors}"])


def _tuner(method: str | None) -> tuple[str, str]:
    """Name of the method and of what searches its settings; FacesynthError where nothing does, or it must be chosen."""
    from facesynth.methods.registry import capabilities_of, known_capabilities

    tunable = {one.name: one.tuner for one in known_capabilities()[0] if one.tuner}
    if method is None and len(tunable) == 1:
        return next(iter(tunable.items()))
    if method is not None and capabilities_of(method).tuner:
        return method, tunable[method]
    raise FacesynthError(f"--method must be one whose settings can be searched: {', '.join(tunable)}; got {method}")
