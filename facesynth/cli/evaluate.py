"""`facesynth evaluate`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from facesynth.methods.method import Method

MAIN = (
    "marker_error", "lve", "lve_centred", "lip_gap_corr", "closure_rate", "false_closure_rate", "energy_ratio",
    "emotion_accuracy", "other_phones", "other_visemes", "train_s", "rtf", "model_mb",
)  # fmt: skip
"""Columns of the short table; everything is in the CSV and the JSON."""


@click.command("evaluate")
@click.argument("corpus", type=click.Path(path_type=Path))
@click.argument("methods", nargs=-1, required=True)
@click.option("-o", "--output", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder of the report.")
@click.option("--no-references", is_flag=True, help="Leave out mean face, phone mean, ridge and tcn.")
@click.option("--test-share", type=click.FloatRange(0.01, 0.9), default=0.2, show_default=True, help="Of the sentences.")
@click.option("--test-limit", type=click.IntRange(min=2), help="At most so many held-out utterances, evenly chosen.")
@click.option("--seed", default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def evaluate(
    *,
    corpus: Path,
    methods: tuple[str, ...],
    output: Path,
    no_references: bool,
    test_share: float,
    test_limit: int | None,
    seed: int,
    as_json: bool,
) -> None:
    """Train METHODS on a part of CORPUS and judge them on sentences that they did not see.

    A method may be a name (efase) or a settings file (efase=configs/efase_published.yaml).
    """
    from facesynth.atomic import write_text
    from facesynth.config import load_config
    from facesynth.corpus import Corpus
    from facesynth.evaluation.compare import evaluate as compare
    from facesynth.evaluation.compare import reference_methods
    from facesynth.methods.registry import create

    train, test = Corpus.open(corpus).split(seed, test_share)
    if test_limit and len(test) > test_limit:
        test = test.subset([test.ids[i * len(test) // test_limit] for i in range(test_limit)])
    candidates: dict[str, Callable[[], Method]] = {}
    for method in methods:
        name, _, config = method.partition("=")
        settings = load_config(config) if config else {}
        create(name, **settings)
        candidates[Path(config).stem if config else name] = partial(create, name, **settings)
    if not no_references:
        candidates |= reference_methods()
    result = compare(candidates, train, test, seed=seed, predictions_dir=output / "predictions")
    for suffix, text in ((".md", result.markdown()), (".csv", result.csv()), (".json", result.json())):
        write_text(output / f"table{suffix}", text)
    click.echo(
        result.json() if as_json else result.markdown([c for c in MAIN if c in {column.name for column in result.columns}])
    )
