"""`facesynth reproduce`."""

import json
from pathlib import Path
from typing import Any

import click

from facesynth.cli.options import as_json, seeded
from facesynth.cli.types import FILE
from facesynth.inference.errors import unknown

TYPES = (".html", ".md", ".csv", ".json")


@click.command("reproduce")
@click.argument("paper")
@click.argument("corpus", type=FILE)
@click.option("-o", "--output", type=FILE, help="File to write: .html with pictures, .md, .csv or .json.")
@click.option("--train-minutes", type=click.FloatRange(0.01), help="Learn from so many minutes.")
@click.option("--test-limit", type=click.IntRange(min=2), default=24, show_default=True, help="Utterances tested.")
@seeded
@as_json
def reproduce(paper: str, corpus: Path, output: Path | None, as_json: bool, **limits: Any) -> None:
    """Run what can be run of PAPER (cao2005, deng2008, deng2006, saisan2004) on CORPUS.

    Printed are the paper's figure, ours, and whether the two can be compared; what is missing is listed as missing.
    """
    from facesynth.atomic import write_text
    from facesynth.corpus import Corpus
    from facesynth.evaluation.papers import reproduce as run
    from facesynth.evaluation.report import require_drawing

    if output and output.suffix not in TYPES:
        raise unknown("output type", output.suffix or str(output), TYPES)
    require_drawing()
    result = run(paper, Corpus.open(corpus), **limits)
    plain = json.dumps(result.to_dict(), indent=1, ensure_ascii=False) + "\n"
    if output:
        write_text(output, plain if output.suffix == ".json" else result.written_as(output.suffix))
    click.echo(plain if as_json else result.markdown())
