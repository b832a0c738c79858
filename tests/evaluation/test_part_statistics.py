"""Heads and eyes in a comparison: figures of the whole run, rows of their own, and no figures of a face that rests."""

from dataclasses import replace

import numpy as np
import pytest
from living_eyes import recording
from nodding import nodding_corpus

from facesynth.evaluation.compare import evaluate
from facesynth.evaluation.contestants import Contestant, contestant, references
from facesynth.evaluation.folds import make_folds
from facesynth.evaluation.part_statistics import EYES, HEAD, PartSums
from facesynth.evaluation.report import Wish, write_report
from facesynth.evaluation.verdict import verdicts


def test_what_moves_as_recorded_is_nought_apart_and_what_rests_is_one(tmp_path):
    corpus = nodding_corpus(tmp_path / "c", 3)
    same, still = PartSums(), PartSums()
    for number, utterance in enumerate(corpus):
        eyes = recording(utterance.motion.duration_s, seed=number, fps=60, every_s=0.4).eyes[: len(utterance.motion)]
        seen = replace(utterance, motion=replace(utterance.motion, eyes=eyes))
        same.add(seen, seen.motion)
        still.add(seen, replace(seen.motion, head=np.zeros_like(seen.motion.head), eyes=np.tile([1.0, 0, 0], (len(eyes), 1))))
    moved = same.figures()
    assert moved.pop("head_pause_ratio", 1.0) > 0
    assert set(moved) <= {*HEAD.values(), *EYES.values()}
    assert {"head_speed", "head_range", "gaze_speed", "lid_opening"} <= set(moved)
    assert set(moved.values()) == {0.0}
    rests = still.figures()
    assert rests["head_speed"] == rests["head_range"] == rests["gaze_speed"] == 1.0
    assert PartSums().figures() == {}
    alone = PartSums()
    alone.add(seen, seen.motion, "eyes")
    assert set(alone.figures()) <= set(EYES.values())


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("heads")
    corpus = nodding_corpus(folder / "c", 6)
    rows = [contestant("head_ridge"), contestant("head_rest"), Contestant("mean face", "mean_face")]
    return corpus, evaluate(rows, corpus, make_folds(corpus, 2), folder / "report"), folder / "report"


def test_heads_are_judged_as_heads_and_mouths_as_mouths(compared):
    _, result, _ = compared
    scores, rows = result.comparison.scores, {row.label: row for row in result.comparison.rows}
    assert scores["head_ridge"]["head_distance"].mean < scores["head_rest"]["head_distance"].mean
    assert scores["head_rest"]["head_speed"].mean == 1.0
    assert scores["head_ridge"]["head_speed"].mean < 1.0
    assert not scores["head_ridge"]["marker_error"].utterances
    assert rows["head_ridge"].reasons["marker_error"] == "the method moves the head alone"
    assert scores["mean face"]["marker_error"].utterances == 6
    assert rows["mean face"].reasons["head_speed"].startswith("the method moves neither head nor eyes")
    assert verdicts(result) == []
    assert not scores["mean face"]["head_speed"].utterances
    assert {"head_cca", "head_speed", "head_spectrum", "marker_error"} <= set(result.main_columns())


def test_their_page_is_written(compared):
    corpus, result, folder = compared
    page = write_report(folder, result, corpus, [], Wish("heads", videos=False)).read_text(encoding="utf-8")
    assert "head_speed" in page
    assert 'alt="head of n0' in page
    assert "the method moves the head alone" in page


def test_reference_rows_are_those_of_the_parts_that_are_compared():
    assert {one.method for one in references([contestant("head_hmm")])} == {"head_rest", "head_ridge", "head_sway"}
    assert [one.method for one in references([contestant("eyes")])] == ["eyes_random"]
    assert "head_rest" not in [one.method for one in references([contestant("efase")])]
    every = [contestant(name) for name in ("head_hmm", "eyes", "efase")]
    assert len(references()) == len(references(every))
