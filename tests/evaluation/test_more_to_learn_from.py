"""What more recordings are worth: known slopes, tests that are corrected together, and the scripts that print them."""

import runpy
import sys
from importlib import import_module
from time import process_time

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.methods.learn.expectation import STEPS
from facesynth.methods.network.method import Network

COUNTS = (50, 100, 160)
SENTENCES = 40


@pytest.fixture
def benchmark(monkeypatch, repository):
    """A function that imports a module of benchmarks/."""
    monkeypatch.syspath_prepend(repository / "benchmarks")
    return import_module


def falling(by, noise=0.02, seed=0):
    """Errors that fall by so much where recordings double."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(1, 2, SENTENCES)
    return {count: start - by * np.log2(count / 50) + noise * rng.standard_normal(SENTENCES) for count in COUNTS}


def test_a_slope_is_what_a_doubling_takes_off_each_error(benchmark):
    slopes = benchmark("frontier_curve").per_doubling(falling(0.12, noise=0))
    np.testing.assert_allclose(slopes, -0.12, atol=1e-12)


def test_steps_that_help_are_told_from_those_that_do_not_all_corrected_together(benchmark):
    curve = benchmark("frontier_curve")
    rows = {"learns": falling(0.12), "does not": falling(0, noise=0.2)}
    steps = {(step.row, step.more): step for step in curve.steps(rows)}
    assert [steps["learns", more].gain for more in (100, 160)] == pytest.approx([0.12, 0.12 * np.log2(1.6)], abs=0.02)
    assert steps["learns", 100].nearer == SENTENCES
    assert max(steps["learns", more].p for more in (100, 160)) < 1e-5
    assert min(steps["does not", more].p for more in (100, 160)) > 0.05
    alone = {step.more: step.p for step in curve.steps({"does not": rows["does not"]})}
    assert steps["learns", 100].p == pytest.approx(2 * {s.more: s.p for s in curve.steps({"learns": rows["learns"]})}[100])
    assert all(steps["does not", more].p >= p for more, p in alone.items())


def test_errors_that_stay_the_same_tell_nothing(benchmark):
    (step,) = benchmark("frontier_curve").steps({"row": {50: np.ones(9), 100: np.ones(9)}})
    assert (step.gain, step.nearer, step.p) == (0.0, 0, 1.0)


def test_the_curve_takes_the_folds_and_rows_that_every_number_of_clips_has(benchmark, tmp_path, capsys):
    table = benchmark("frontier_table")
    kept = {50: (1, 2), 100: (1, 2), 160: (1, 2, 3)}
    for fold in (1, 2, 3):
        errors = falling(0.1, seed=fold)
        for count in [count for count in COUNTS if fold in kept[count]]:
            lines = np.tile(errors[count][:, None], len(table.FIGURES))
            rows = {"network": lines, "recorded": lines} | ({"only here": lines} if count == 160 else {})
            np.savez(tmp_path / f"figures_{count}_{fold}.npz", **rows)
    table.join(tmp_path)
    printed = capsys.readouterr().out.split("by clips to learn from: ")[1]
    assert printed.startswith("folds 1, 2\n")
    assert "| learned from | 50 | 100 | 160 | mm per doubling (95 %) |" in printed
    assert "| -0.1" in printed
    assert f"of {2 * SENTENCES}, p = " in printed
    assert not {"only here", "recorded"} & {word.strip() for word in printed.split("|")}


def test_the_network_learns_from_fewer_and_from_more_of_the_same_recordings(benchmark, monkeypatch, repository, tmp_path, capsys):
    parts, fewer = (getattr(benchmark("network_variants"), name) for name in ("parts", "fewer"))
    corpus = tiny_corpus(tmp_path / "corpus", utterances=20, fps=30)
    rest, tested = parts(corpus, 1)
    (few, _), (more, left) = fewer(rest, 1, 3), fewer(rest, 1, 6)
    assert set(few.ids) < set(more.ids) < set(rest.ids)
    assert set(more.ids) | set(left.ids) | set(tested.ids) == set(corpus.ids)
    arguments = (corpus.path, "-o", tmp_path / "out", "--clips", 6, 3, "--features", "log_mel", "--steps", 2)
    monkeypatch.setattr(sys, "argv", [str(repository / "benchmarks" / "more_clips.py"), *map(str, arguments)])
    runs = []
    for _ in range(2):
        runpy.run_path(sys.argv[0], run_name="__main__")
        runs.append(capsys.readouterr().out)
    assert runs[0] == runs[1], "the second time nothing is learned: even the seconds are the same"
    assert "3 clips (" in runs[0]
    assert "| network | " in runs[0]
    assert "- network, 3 to 6: " in runs[0]


@pytest.mark.slow
def test_learning_from_ten_minutes_takes_under_three_minutes_of_processor_time(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=480, fps=25)
    assert sum(corpus.duration_s(name) for name in corpus.ids) > 600
    few, more = (processor_seconds(corpus, steps) for steps in (20, 90))
    assert few + (more - few) / 70 * (STEPS - 20) < 180, "hearing, regression and every step of the default network, one thread"


def processor_seconds(corpus, steps):
    """Of learning so many steps: those after the first ones cost the same each."""
    began = process_time()
    Network(steps=steps).fit(corpus)
    return process_time() - began
