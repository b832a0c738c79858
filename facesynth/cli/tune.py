"""`facesynth tune`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click


@click.command("tune")
@click.argument("corpus", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("efase-tuned.yaml"), show_default=True)
@click.option("--sentences", default=24, show_default=True, help="To tune on; none of them is in the database.")
@click.option("--test", "test_sentences", default=12, show_default=True, help="To compare found and published settings on.")
@click.option("--generations", default=10, show_default=True, help="Of 28 evaluations each, after the first.")
@click.option("--limit", type=click.IntRange(min=2), help="At most so many utterances in the database, evenly chosen.")
@click.option("--workers", default=2, show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def tune(
    *,
    corpus: Path,
    output: Path,
    sentences: int,
    test_sentences: int,
    generations: int,
    limit: int | None,
    workers: int,
    seed: int,
    as_json: bool,
) -> None:
    """Search eFASE's settings on held-out sentences of CORPUS; interrupted, it goes on where it was."""
    import yaml

    from facesynth.atomic import write_text
    from facesynth.corpus import Corpus
    from facesynth.methods.efase.method import Efase
    from facesynth.methods.efase.tuning import split_for_tuning
    from facesynth.methods.efase.tuning import tune as search

    database, tuning, test = split_for_tuning(Corpus.open(corpus), sentences, test_sentences, seed)
    if limit and len(database) > limit:
        database = database.subset([database.ids[i * len(database) // limit] for i in range(limit)])
    model = Efase().fit(database, seed=seed)
    journal = output.with_suffix(".jsonl")
    found = search(model, tuning, test, journal=journal, generations=generations, seed=seed, workers=workers)
    write_text(output, yaml.safe_dump({k: float(f"{v:.4g}") for k, v in found.settings.items()}, sort_keys=False))
    if as_json:
        click.echo(json.dumps(asdict(found)))
        return
    click.echo(f"{found.evaluations} evaluations on {sentences} sentences; {output} holds the settings")
    click.echo(f"on {test_sentences} other sentences: found {found.test_error:.4g}, published {found.published_test_error:.4g}")
