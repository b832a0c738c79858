"""`facesynth evaluate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import as_json, seeded, spread_over
from facesynth.cli.types import FILE, FOLDER

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from facesynth.corpus import Corpus
    from facesynth.corpus.workers import Workers
    from facesynth.evaluation.compare import Evaluation
    from facesynth.evaluation.contestants import Contestant, Family
    from facesynth.evaluation.folds import Fold


@click.command("evaluate")
@click.argument("corpus", type=FILE)
@click.argument("methods", nargs=-1, metavar="[METHOD[:SETTINGS.yaml]]...")
@click.option("-o", "--output", type=FOLDER, required=True, help="Folder of the report.")
@click.option("--family", "families", multiple=True, type=FILE, help="A file of variants; see configs/ablations.")
@click.option("--folds", default=5, show_default=True, help="Splits by sentence.")
@click.option("--given-folds", type=FILE, help="JSON of folds in place of drawn ones.")
@click.option("--train-minutes", type=click.FloatRange(0.01), help="Learn from so many minutes of each fold.")
@click.option("--minutes", multiple=True, type=click.FloatRange(0.01), help="Each method also by so many minutes of each fold.")
@click.option("--test-limit", type=click.IntRange(min=2), help="At most so many tested utterances in all.")
@click.option("--from-predictions", "stored", type=FILE, help="Judge METHOD/ID.npz of this folder; train nothing.")
@click.option("--closed", is_flag=True, help="Each row once more with lips closed at p, b and m, by the same step for all.")
@click.option("--no-references", is_flag=True, help="Leave out the reference methods, such as the mean face.")
@click.option("--show", "shown", multiple=True, metavar="ID", help="Utterances for trajectories and video.")
@click.option("--no-video", is_flag=True, help="Leave out the videos.")
@click.option("--title", default="", help="Of the report.")
@spread_over("--workers", 1, "Processes at once; each keeps to one thread.")
@click.option("--device", default="cpu", show_default=True, help="Where methods learn and speak: cpu, cuda, mps or auto.")
@seeded
@as_json
def evaluate(
    *,
    corpus: Path,
    methods: tuple[str, ...],
    output: Path,
    families: tuple[Path, ...],
    folds: int,
    given_folds: Path | None,
    train_minutes: float | None,
    minutes: tuple[float, ...],
    test_limit: int | None,
    stored: Path | None,
    closed: bool,
    no_references: bool,
    shown: tuple[str, ...],
    no_video: bool,
    title: str,
    workers: Workers,
    device: str,
    seed: int,
    as_json: bool,
) -> None:
    """Train METHODS on a part of CORPUS, judge them on sentences that they did not see, and write a report.

    A method is a name or a name with a settings file (NAME:configs/NAME_published.yaml). Interrupted, the same command
    goes on where it was.
    """
    from facesynth.corpus import Corpus
    from facesynth.device import device_of
    from facesynth.evaluation.folds import make_folds, read_folds
    from facesynth.evaluation.report import Wish, require_drawing, write_report

    if stored is not None:
        _refuse_training()
    require_drawing()
    device_of(device)
    recordings = Corpus.open(corpus)
    for utterance_id in shown:
        recordings.record(utterance_id)
    known, contestants = _contestants(recordings, methods, families, minutes, references=not no_references)
    splits: Sequence[Fold] | None = read_folds(given_folds, recordings) if given_folds else None
    if stored is None:
        if not methods and not families:
            raise click.UsageError("name a method, a --family or --from-predictions")
        splits = splits or make_folds(recordings, folds, seed, test_limit=test_limit, train_minutes=train_minutes)
    asked: dict[str, Any] = {"seed": seed, "workers": workers, "closed": closed}
    result = _result(recordings, contestants, known, splits, stored, output, device, asked)
    page = write_report(output, result, recordings, known, Wish(title or recordings.performer, shown, videos=not no_video))
    if as_json:
        click.echo(result.comparison.json())
        return
    click.echo("\n".join([result.comparison.markdown(result.main_columns()), *result.warnings()]))
    click.echo(f"{page}: everything, for a browser; the same as CSV, JSON and LaTeX beside it")


def _refuse_training() -> None:
    """UsageError where something was asked of a training that `--from-predictions` does without."""
    source = click.get_current_context().get_parameter_source
    names = ("methods", "folds", "train_minutes", "minutes", "test_limit")
    given = [name for name in names if source(name) is click.core.ParameterSource.COMMANDLINE]
    if given:
        shown = ", ".join("METHOD" if name == "methods" else "--" + name.replace("_", "-") for name in given)
        raise click.UsageError(f"--from-predictions trains nothing; leave out {shown} (--given-folds chooses utterances)")


def _contestants(
    corpus: Corpus, methods: Sequence[str], families: Sequence[Path], minutes: Sequence[float], *, references: bool
) -> tuple[list[Family], list[Contestant]]:
    """Families, and every contestant: the named ones, the families', the reference rows, and all but the families' by minutes.

    Reference rows that ask for phones are left out where nobody knows them, and that is told.
    """
    from facesynth.evaluation.contestants import by_minutes, contestant, read_family, without_phones
    from facesynth.evaluation.contestants import references as reference_rows

    read = [read_family(path) for path in families]
    named, variants = [contestant(spec) for spec in methods], [one for _, variants in read for one in variants]
    known, asking = without_phones(reference_rows([*named, *variants]) if references else [], corpus)
    if asking:
        click.echo(f"left out, for nobody knows what is said in all recordings: {', '.join(asking)}", err=True)
    less, again = by_minutes([*named, *known], minutes)
    return [family for family, _ in read] + less, named + variants + known + again


def _result(
    corpus: Corpus,
    contestants: Sequence[Contestant],
    families: Sequence[Family],
    splits: Sequence[Fold] | None,
    stored: Path | None,
    output: Path,
    device: str,
    asked: Mapping[str, Any],
) -> Evaluation:
    from facesynth.evaluation.compare import evaluate as compare
    from facesynth.evaluation.compare import folds_beside, judge_predictions, predicted_labels

    if stored is None:
        assert splits is not None  # noqa: S101 - told apart by the caller
        return compare(contestants, corpus, splits, output, device=device, **asked)
    labels = predicted_labels(stored, families)
    return judge_predictions(corpus, splits or folds_beside(stored, corpus), stored, labels, **asked)
