import json

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.errors import FacesynthError
from facesynth.evaluation.compare import SECOND_TAKE, evaluate, reference_methods
from facesynth.evaluation.geometry import marker_error
from facesynth.evaluation.predictions import load_prediction
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.baselines.phone_mean import PhoneMean
from facesynth.motion.motion import Motion

REFERENCES = reference_methods()
QUICK = {label: REFERENCES[label] for label in ("mean face", "phone mean", "ridge")}
CLOCKS = ("train_s", "rtf", "peak_mb")


class Telling(PhoneMean):
    """Phone mean that tells something of itself, as a concatenative method would."""

    name = "telling"

    def report(self, speech):
        return {"other_phones": 0.25, "phones": len(speech.phones)}

    def joins(self, speech):
        return speech.phones.frame_bounds(self.fps)[1:-1]


class Short(MeanFace):
    """A method that forgets the last frame."""

    name = "short"

    def synthesize(self, speech, *, seed=0, **options):
        motion = super().synthesize(speech)
        return Motion(motion.frames[:-1], motion.fps, motion.layout)


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    corpus = tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=21, fps=30)
    test = [r.id for r in corpus.records if r.sentence in ("s00", "s01", "s05")]
    return corpus.subset(i for i in corpus.ids if i not in test), corpus.subset(test)


@pytest.fixture(scope="module")
def predictions(tmp_path_factory):
    return tmp_path_factory.mktemp("predictions")


@pytest.fixture(scope="module")
def comparison(split, predictions):
    return evaluate({**QUICK, "telling": Telling}, *split, seed=0, predictions_dir=predictions)


def test_every_method_has_every_figure_and_reference_rows_order_as_they_should(comparison):
    scores = comparison.scores
    assert list(scores) == [SECOND_TAKE, "mean face", "phone mean", "ridge", "telling"]
    error = {label: scores[label]["marker_error"].mean for label in scores}
    assert error[SECOND_TAKE] < error["phone mean"] < error["mean face"]
    assert scores["mean face"]["energy_ratio"].mean == 0
    assert scores["mean face"]["lip_gap_corr"].mean == 0
    assert scores["phone mean"]["emotion_accuracy"].mean > scores["mean face"]["emotion_accuracy"].mean
    assert comparison.recorded_emotions.accuracy > 0.9


def test_a_second_take_counts_only_where_there_is_one(comparison, split):
    assert comparison.scores[SECOND_TAKE]["lve"].utterances == 2
    assert "second recording" in next(row for row in comparison.rows if row.label == SECOND_TAKE).reasons["lve"]
    alone = evaluate({}, split[0], split[1].subset(["s01_angry_t1", "s05_sad_t1"]), predictions_dir=split[0].path / "p")
    assert "not available" in alone.markdown()


def test_figures_can_be_computed_again_from_what_was_kept(comparison, predictions, split):
    row = next(row for row in comparison.rows if row.label == "ridge")
    for value, utterance in zip(row.values["marker_error"], split[1], strict=True):
        name, motion = load_prediction(predictions / "ridge" / f"{utterance.id}.npz")
        assert name == utterance.id
        assert marker_error(motion, utterance.motion) == value


def test_a_method_s_own_figures_become_columns(comparison):
    assert comparison.scores["telling"]["other_phones"].mean == 0.25
    assert comparison.scores["telling"]["join_jump"].utterances == len(comparison.utterances)
    assert comparison.scores["ridge"]["other_phones"].utterances == 0
    assert "the method does not report it" in comparison.markdown(["other_phones"])


def test_costs_are_there(comparison):
    costs = next(row for row in comparison.rows if row.label == "ridge").costs
    assert costs["train_s"] > 0
    assert 0 < costs["rtf"] < 1
    assert costs["model_mb"] > 0.01


def test_the_same_seed_gives_the_same_figures_and_bytes(comparison, predictions, split, tmp_path):
    again = evaluate(QUICK, *split, seed=0, predictions_dir=tmp_path)
    for label in QUICK:
        first, second = comparison.scores[label], again.scores[label]
        assert all(repr(first[name]) == repr(second[name]) for name in second if name not in CLOCKS)
        for path in (tmp_path / label).iterdir():
            assert path.read_bytes() == (predictions / label / path.name).read_bytes()


def test_a_trained_method_is_taken_as_it_is(split, tmp_path):
    trained = MeanFace().fit(split[0])
    comparison = evaluate({"mean face": trained}, *split, predictions_dir=tmp_path)
    assert np.isnan(comparison.rows[1].costs["train_s"])
    assert "it was trained before" in comparison.markdown(["train_s"])
    json.loads(comparison.json())


def test_what_cannot_be_compared_is_refused(split, tmp_path):
    train, test = split
    with pytest.raises(FacesynthError, match=r"'s00.*cannot be judged.*nothing is cut"):
        evaluate({"short": Short}, train, test, predictions_dir=tmp_path)
    with pytest.raises(FacesynthError, match="learned from and tested on"):
        evaluate({}, train, train, predictions_dir=tmp_path)
    with pytest.raises(FacesynthError, match="label"):
        evaluate({"../up": MeanFace}, train, test, predictions_dir=tmp_path)
    with pytest.raises(FacesynthError, match="test on"):
        evaluate({}, train, test.subset([]), predictions_dir=tmp_path)
