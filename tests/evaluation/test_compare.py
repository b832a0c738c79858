import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus
from filelock import FileLock

from facesynth.config import load_config
from facesynth.corpus.workers import Workers
from facesynth.evaluation import jobs
from facesynth.evaluation.compare import evaluate, folds_beside, judge_predictions, predicted_labels
from facesynth.evaluation.contestants import SECOND_TAKE, Contestant, Family
from facesynth.evaluation.folds import Fold, make_folds
from facesynth.evaluation.geometry import marker_error
from facesynth.evaluation.predictions import load_prediction, save_prediction
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.baselines.phone_mean import PhoneMean
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.registry import create

QUICK = tuple(Contestant(name, name.replace(" ", "_")) for name in ("mean face", "phone mean", "ridge"))
COSTS = ("train_s", "train_cpu_s", "train_minutes", "rtf", "rtf_cpu", "peak_mb", "model_mb")
CLOCKS = ("train_s", "train_cpu_s", "rtf", "rtf_cpu", "peak_mb")


class Telling(PhoneMean):
    """Phone mean that tells something of itself, as a concatenative method would."""

    def report(self, speech):
        return {"other_phones": 0.25, "phones": len(speech.phones)}

    def joins(self, speech):
        return speech.phones.frame_bounds(self.fps)[1:-1]


class Drawing(MeanFace):
    """A method that draws where it holds the face: the first channel lies off by a normal number of 2 units."""

    def synthesize(self, speech, *, seed=0, **options):
        motion = super().synthesize(speech)
        frames = motion.frames.copy()
        frames[:, 0] += 2 * np.random.default_rng(seed).normal()
        return Motion(frames, motion.fps, motion.layout)


class Short(MeanFace):
    """A method that forgets the last frame."""

    def synthesize(self, speech, *, seed=0, **options):
        motion = super().synthesize(speech)
        return Motion(motion.frames[:-1], motion.fps, motion.layout)


TOYS = {"telling": Telling, "drawing": Drawing, "short": Short}
"""Methods that only these tests know; see `toy_methods`."""


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=21, fps=30)


@pytest.fixture(scope="module")
def folds(corpus):
    return make_folds(corpus, 2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="module")
def result(corpus, folds, folder):
    return evaluate((*QUICK, Contestant("telling", "telling")), corpus, folds, folder)


def figures(evaluation, label):
    """Every figure of a method that has one and that the machine does not decide."""
    scores = evaluation.comparison.scores[label].items()
    return {name: repr(score) for name, score in scores if score.utterances and name not in CLOCKS}


def test_every_method_speaks_every_utterance_once_and_rows_order_as_they_should(result, corpus):
    scores = result.comparison.scores
    assert list(scores) == [SECOND_TAKE, "mean face", "phone mean", "ridge", "telling"]
    assert result.comparison.utterances == corpus.ids
    assert scores["ridge"]["marker_error"].utterances == len(corpus)
    error = {label: scores[label]["marker_error"].mean for label in scores}
    assert error[SECOND_TAKE] < error["phone mean"] < error["mean face"]
    assert scores["mean face"]["energy_ratio"].mean == 0
    assert scores["phone mean"]["emotion_accuracy"].mean > scores["mean face"]["emotion_accuracy"].mean
    assert result.comparison.recorded_emotions.accuracy > 0.8


def test_no_sentence_that_is_tested_was_learned_from(folds, corpus):
    for fold in folds:
        sentences = [{corpus.record(i).sentence_key for i in ids} for ids in (fold.train, fold.test)]
        assert not sentences[0] & sentences[1]


def test_a_second_take_counts_only_where_there_is_one(result, corpus, tmp_path):
    takes = [r for r in corpus.records if r.take == 2]
    assert result.comparison.scores[SECOND_TAKE]["lve"].utterances == 2 * len(takes)
    alone = corpus.subset([i for i in corpus.ids if i.endswith("t1")])
    evaluation = evaluate(QUICK[:1], alone, make_folds(alone, 2), tmp_path)
    assert "not available" in evaluation.comparison.markdown()


def test_figures_can_be_computed_again_from_what_was_kept(result, corpus, folds, folder):
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    labels = [row.label for row in result.comparison.rows[1:]]  # in another order pairs are subtracted the other way round
    again = judge_predictions(corpus, folds_beside(folder / "predictions", corpus), folder / "predictions", labels)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before  # nothing is written into what is given
    assert again.folds == folds
    for label in result.comparison.scores:
        assert figures(again, label) == figures(result, label)
    assert set(again.differences) == set(result.differences)
    named, motion = load_prediction(folder / "predictions" / "ridge" / f"{corpus.ids[0]}.npz")
    row = next(row for row in result.comparison.rows if row.label == "ridge")
    assert named == corpus.ids[0]
    assert row.values["marker_error"][0] == marker_error(motion, corpus[named].motion)


def test_a_method_s_own_figures_become_columns(result):
    assert result.comparison.scores["telling"]["other_phones"].mean == 0.25
    assert result.comparison.scores["telling"]["join_jump"].utterances == len(result.comparison.utterances)
    assert result.comparison.scores["ridge"]["other_phones"].utterances == 0
    assert "the method does not report it" in result.comparison.markdown(["other_phones"])


def test_costs_and_what_it_was_made_of_are_kept(result):
    costs = next(row for row in result.comparison.rows if row.label == "ridge").costs
    assert costs["train_s"] > 0
    assert costs["train_cpu_s"] > 0
    assert 0 < costs["rtf"] < 1
    assert 0 < costs["rtf_cpu"] < 1
    assert costs["peak_mb"] == 123
    assert costs["model_mb"] > 0.01
    account = result.accounts["ridge"][0]
    assert account["done"]
    assert len(account["made_of"]) == len(account["versions"]["source"]) == 64
    assert account["contestant"]["method"] == "ridge"
    assert result.comparison.provenance["corpus"]["sha256"]


def test_who_comes_first_pays_for_nothing(corpus, folds, tmp_path, monkeypatch):
    learned = []
    monkeypatch.setattr(jobs, "_warm", set())
    fit = PhoneMean.fit
    monkeypatch.setattr(PhoneMean, "fit", lambda self, some, *, seed=0: learned.append(len(some)) or fit(self, some, seed=seed))
    evaluate([Contestant(name, "phone_mean") for name in ("one", "two")], corpus, folds[:1], tmp_path)
    assert learned == [jobs.WARM_UTTERANCES, len(folds[0].train), len(folds[0].train)]


@pytest.mark.parametrize("name", ["efase", "anime_graph"])
def test_a_search_that_expects_poses_is_warm_without_its_network(name, corpus, folds, repository, tmp_path, monkeypatch):
    made = []
    monkeypatch.setattr(jobs, "_warm", set())
    monkeypatch.setattr(jobs, "create", lambda method, **settings: made.append(create(method, **settings)) or made[-1])
    monkeypatch.setattr(PosePredictor, "learn", lambda *_: pytest.fail("hundreds of steps, to be warm"))
    settings = load_config(repository / "configs" / f"{name}_soft.yaml")
    job = jobs.Job(corpus.path, tmp_path, Contestant("soft", name, settings=settings), folds[0], 1, 0)
    jobs._warm_up(job, corpus.subset(corpus.ids[: jobs.WARM_UTTERANCES]))
    assert [type(model).__name__.lower() for model in made] == [name.replace("_", "")]
    assert made[0].layout == corpus.layout


def test_a_method_that_draws_is_judged_by_several_motions(result, corpus, folds, tmp_path):
    evaluation = evaluate([Contestant("drawing", "drawing")], corpus, folds, tmp_path)
    scores = evaluation.comparison.scores["drawing"]
    assert scores["diversity"].utterances == len(corpus)
    offsets = 2 * np.array([np.random.default_rng(seed).normal() for seed in range(jobs.SAMPLES)])
    apart = np.abs(offsets[:, None] - offsets)[np.triu_indices(len(offsets), 1)].mean()
    points = corpus.layout.channels // corpus.layout.dimension
    assert scores["diversity"].mean == pytest.approx(apart / points, rel=1e-3)
    assert scores["error_of_best"].mean <= scores["error_of_mean"].mean + 1e-6
    assert scores["error_of_best"].mean <= scores["marker_error"].mean
    assert result.comparison.scores["ridge"]["diversity"].utterances == 0
    assert "the method draws none" in result.comparison.markdown(["diversity"])
    again = judge_predictions(corpus, folds, tmp_path / "predictions")
    assert figures(again, "drawing") == figures(evaluation, "drawing")


@pytest.mark.parametrize(
    "workers",
    [Workers(), pytest.param(Workers(2), marks=pytest.mark.slow), pytest.param(Workers(2, "ray"), marks=pytest.mark.slow)],
    ids=["one", "two", "ray"],
)
def test_the_same_seed_gives_the_same_bytes_whoever_works(result, corpus, folds, folder, tmp_path, workers):
    if workers.engine == "ray":
        pytest.importorskip("ray")
    again = evaluate(QUICK, corpus, folds, tmp_path, workers=workers)
    for one in QUICK:
        assert figures(again, one.label) == figures(result, one.label)
        for path in (tmp_path / "predictions" / one.label).glob("*.npz"):
            assert path.read_bytes() == (folder / "predictions" / one.label / path.name).read_bytes()


def test_killed_and_run_again_it_goes_on_and_ends_the_same(result, corpus, folds, folder, tmp_path, monkeypatch):
    spoken, trained = [], []
    keep, train = jobs._speak_one, jobs._train

    def die_after_five(job, method, utterance):
        if len(spoken) == 5:
            raise KeyboardInterrupt
        spoken.append(utterance.id)
        keep(job, method, utterance)

    monkeypatch.setattr(jobs, "_train", lambda job, corpus: trained.append(job.number) or train(job, corpus))
    monkeypatch.setattr(jobs, "_speak_one", die_after_five)
    with pytest.raises(KeyboardInterrupt):
        evaluate(QUICK[2:], corpus, folds, tmp_path)
    monkeypatch.setattr(jobs, "_speak_one", lambda job, method, u: spoken.append(u.id) or keep(job, method, u))
    again = evaluate(QUICK[2:], corpus, folds, tmp_path)
    assert figures(again, "ridge") == figures(result, "ridge")
    assert sorted(spoken) == sorted(corpus.ids)  # nothing was spoken twice
    assert trained == [1, 2]  # the model of the interrupted fold was kept
    assert not list((tmp_path / "predictions" / "ridge").glob(".fold*.safetensors"))
    evaluate(QUICK[2:], corpus, folds, tmp_path)
    assert trained == [1, 2]


def test_other_settings_under_the_same_label_are_made_anew(corpus, folds, tmp_path):
    evaluate([Contestant("some", "mean_face")], corpus, folds, tmp_path)
    evaluation = evaluate([Contestant("some", "phone_mean")], corpus, folds, tmp_path)
    assert evaluation.accounts["some"][0]["contestant"]["method"] == "phone_mean"
    assert evaluation.comparison.scores["some"]["energy_ratio"].mean > 0


def test_other_people_s_predictions_are_judged_without_layout_or_folds(result, corpus, folder, tmp_path):
    chosen = [i for i in corpus.ids if i.startswith(("s00", "s01"))]
    for utterance_id in chosen:
        _, motion = load_prediction(folder / "predictions" / "ridge" / f"{utterance_id}.npz")
        (tmp_path / "p" / "theirs").mkdir(parents=True, exist_ok=True)
        np.savez(tmp_path / "p" / "theirs" / f"{utterance_id}.npz", frames=motion.frames, fps=30)
    folds = folds_beside(tmp_path / "p", corpus)
    evaluation = judge_predictions(corpus, folds, tmp_path / "p")
    assert set(folds[0].test) == set(chosen)
    assert evaluation.comparison.scores["theirs"]["lve"].utterances == len(chosen)
    assert "nobody kept it" in evaluation.comparison.markdown(["train_s"])


@pytest.mark.parametrize("changes", [{"lip_pairs": ((10, 9),)}, {"groups": {}, "lip_pairs": (), "neutral": None}])
def test_a_prediction_does_not_choose_what_its_lips_are(result, corpus, folds, folder, tmp_path, changes):
    for utterance_id in corpus.ids:
        _, motion = load_prediction(folder / "predictions" / "ridge" / f"{utterance_id}.npz")
        other = replace(motion, layout=replace(motion.layout, **changes))
        save_prediction(tmp_path / "ridge" / f"{utterance_id}.npz", utterance_id, other)
    again = judge_predictions(corpus, folds, tmp_path)
    wanted = {name: score for name, score in figures(result, "ridge").items() if name not in COSTS}
    assert {"lip_gap_corr", "closure_rate", "lve", "fdd"} <= set(wanted)
    assert figures(again, "ridge") == wanted
    assert again.details["ridge"].phones == result.details["ridge"].phones
    assert again.details["ridge"].trade == result.details["ridge"].trade


def test_predictions_that_do_not_fit_are_refused(corpus, folds, folder, tmp_path):
    source = folder / "predictions" / "ridge"
    for name, target in (("s00_happy_t1", "s01_sad_t1"), ("s00_happy_t1", "nobody")):
        shutil.rmtree(tmp_path / "p", ignore_errors=True)
        (tmp_path / "p" / "bad").mkdir(parents=True)
        shutil.copy(source / f"{name}.npz", tmp_path / "p" / "bad" / f"{target}.npz")
        with pytest.raises(FacesynthError, match=target):
            judge_predictions(corpus, folds, tmp_path / "p")
    _, motion = load_prediction(source / "s00_happy_t1.npz")
    shutil.rmtree(tmp_path / "p" / "bad")
    for fault in (
        Motion(motion.frames[:-1], 30, motion.layout),
        Motion(motion.frames, 25, motion.layout),
    ):
        save_prediction(tmp_path / "p" / "bad" / "s00_happy_t1.npz", "s00_happy_t1", fault)
        with pytest.raises(FacesynthError, match="cannot be judged"):
            judge_predictions(corpus, folds, tmp_path / "p")


def test_what_cannot_be_compared_is_refused(corpus, folds, tmp_path):
    with pytest.raises(FacesynthError, match=r"'s0.*cannot be judged.*nothing is cut"):
        evaluate([Contestant("short", "short")], corpus, folds, tmp_path)
    with pytest.raises(FacesynthError, match="learned from and tested on"):
        evaluate(QUICK, corpus, [Fold(corpus.ids, corpus.ids)], tmp_path)
    with pytest.raises(FacesynthError, match="label"):
        Contestant("../up", "mean_face")
    with pytest.raises(FacesynthError, match="two methods are called"):
        evaluate([*QUICK, *QUICK], corpus, folds, tmp_path)
    with pytest.raises(FacesynthError, match="test on"):
        evaluate(QUICK, corpus, [Fold(corpus.ids, ())], tmp_path)
    with pytest.raises(FacesynthError, match="no such folder"):
        folds_beside(tmp_path / "nothing", corpus)


def test_two_runs_do_not_share_a_folder(corpus, folds, tmp_path):
    with FileLock(tmp_path / ".lock"), pytest.raises(FacesynthError, match="another comparison"):
        evaluate(QUICK[:1], corpus, folds, tmp_path)


def test_the_whole_result_is_plain_json(result):
    json.loads(result.comparison.json(), parse_constant=pytest.fail)


def test_stored_rows_come_in_the_order_of_their_families_with_references_last(tmp_path, corpus):
    for label in ("zeta", "mean face", "b", "a", SECOND_TAKE, "ridge"):
        save_prediction(tmp_path / label / "u.npz", "u", corpus[corpus.ids[0]].motion)
    assert predicted_labels(tmp_path, [Family("t", ("b", "gone", "a"))]) == ["zeta", "b", "a", "mean face", "ridge"]
    assert predicted_labels(tmp_path) == ["a", "b", "zeta", "mean face", "ridge"]
