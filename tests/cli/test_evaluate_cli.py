import json

import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.evaluate import evaluate
from facesynth.cli.reproduce import reproduce
from facesynth.evaluation import jobs
from facesynth.inference.errors import FacesynthError


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=12, fps=30).path


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    path = tmp_path_factory.mktemp("family") / "pm.yaml"
    path.write_text(
        "title: Phone means\nmethod: phone_mean\naxis: minutes\nvariants: {few: {minutes: 0.05}, many: {minutes: 9}}\n"
    )
    return path


@pytest.fixture(autouse=True)
def no_process_for_memory(monkeypatch):
    """Each takes seconds."""
    monkeypatch.setattr(jobs, "peak_speaking_mb", lambda *_: None)


def run(*arguments, command=evaluate):
    return CliRunner().invoke(command, [str(a) for a in arguments], catch_exceptions=False)


def test_one_command_makes_a_report_and_its_predictions_make_it_again(corpus, family, tmp_path):
    made = run(corpus, "mean_face", "--family", family, "--folds", 2, "--no-references", "--no-video", "-o", tmp_path / "a")
    assert made.exit_code == 0
    assert "| few |" in made.output
    again = run(
        corpus,
        "--from-predictions",
        tmp_path / "a" / "predictions",
        "--family",
        family,
        "--no-video",
        "-o",
        tmp_path / "b",
        "--json",
    )
    for name in ("table.csv", "utterances.csv", "comparisons.csv", "phones.csv", "trade.csv", "points.csv"):
        rows = [sorted((tmp_path / part / name).read_text().splitlines()) for part in "ab"]
        assert rows[0] == rows[1] or name == "comparisons.csv"
    assert {row["label"] for row in json.loads(again.stdout)["rows"]} == {"second take", "mean_face", "few", "many"}


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (["ridge"], "METHOD"),
        (["--folds", 5], "--folds"),
        (["--train-minutes", 1], "--train-minutes"),
        (["--test-limit", 9], "--test-limit"),
    ],
)
def test_predictions_are_not_trained_for(corpus, tmp_path, given, named):
    done = run(corpus, *given, "--from-predictions", tmp_path, "-o", tmp_path / "r")
    assert done.exit_code == 2
    assert f"leave out {named} " in done.output


def test_what_is_wrong_is_said(corpus, tmp_path):
    assert "name a method" in run(corpus, "-o", tmp_path).output
    with pytest.raises(FacesynthError, match="ridge"):
        run(corpus, "rigde", "-o", tmp_path)
    with pytest.raises(FacesynthError, match="no such folder"):
        run(corpus, "--from-predictions", tmp_path / "nowhere", "-o", tmp_path)
    with pytest.raises(FacesynthError, match="unknown utterance"):
        run(corpus, "ridge", "--show", "nobody", "-o", tmp_path)
    assert "Invalid value for '--engine': 'rya'" in run(corpus, "ridge", "--engine", "rya", "-o", tmp_path).output
    with pytest.raises(FacesynthError, match="output type"):
        run("deng2008", corpus, "-o", tmp_path / "x.doc", command=reproduce)
