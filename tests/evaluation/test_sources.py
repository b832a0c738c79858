"""Rows that are made of recordings, and rows whose lips were closed by the same step."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from talking_points import FPS, LAYOUT, face, phones

from facesynth.cli.evaluate import evaluate as evaluate_verb
from facesynth.corpus import Corpus, Record
from facesynth.evaluation.compare import evaluate, judge_predictions
from facesynth.evaluation.contestants import CLOSED, SAME_WORDS, SECOND_TAKE, Contestant
from facesynth.evaluation.folds import make_folds
from facesynth.evaluation.sources import Sources, nearest_gaps, repeated_words
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, Speech

TRACK = phones(("aa", 0.5), ("m", 0.7), ("aa", 1.2), ("ih", 1.6), ("aa", 2.0))
OPEN_MM, SHUT_MM = 8.0, 0.5


def gap_of(words, shift=0.0):
    """An opening that is shut at the m and else tells by its height which word is said."""
    t = np.arange(round(2 * FPS)) / FPS
    gap = np.where(t < 1.2, OPEN_MM + words[0], OPEN_MM + words[1]) + shift
    return np.where((t >= 0.5) & (t < 0.7), SHUT_MM, gap)


def talking(path, sentences, layout=LAYOUT, gap=gap_of):
    """A corpus of two words a sentence, each a number that says how far the mouth opens."""
    corpus = Corpus.create(path, performer="P", layout=layout, fps=FPS, emotions=("neutral",))
    rng = np.random.default_rng(0)
    for number, words in enumerate(sentences):
        said = [(f"w{words[0]}", 0.0, 1.2), (f"w{words[1]}", 1.2, 2.0)]
        audio = rng.normal(0, 0.1, 32000).astype(np.float32)
        speech = Speech(audio, 16000, TRACK, EmotionTrack.constant("neutral", 2.0), " ".join(w for w, _, _ in said))
        motion = replace(face(gap(words), fps=FPS), layout=layout)
        corpus.add_utterance(Record(f"u{number}", text=speech.text), speech, motion, said)
    return Corpus.open(path)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """Each word is said in two sentences."""
    return talking(tmp_path_factory.mktemp("talk") / "c", [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)])


def opening(motion):
    return motion.points[:, 5, 1] - motion.points[:, 7, 1]


def test_a_sentence_is_put_together_from_other_sentences(corpus):
    words, remark = repeated_words(corpus, corpus.ids)
    assert not remark
    again = Sources(corpus.path, words).motion(corpus, SAME_WORDS, "u0")
    assert opening(again)[[10, 100]] == pytest.approx([OPEN_MM + 0, OPEN_MM + 1], abs=1e-3)


def test_where_words_are_not_repeated_there_is_no_row_and_that_is_told(tmp_path):
    corpus = talking(tmp_path / "c", [(0, 1), (2, 3), (4, 5), (6, 7)])
    words, remark = repeated_words(corpus, corpus.ids)
    assert not words
    assert "0 of 4" in remark
    result = evaluate([Contestant("mean face", "mean_face")], corpus, make_folds(corpus, 2), tmp_path / "r")
    assert remark in result.warnings()
    assert SAME_WORDS not in result.comparison.scores


def test_the_same_sentence_is_no_other_sentence(tmp_path):
    corpus = talking(tmp_path / "c", [(0, 1), (0, 1), (2, 3), (2, 3)])
    assert "0 of 4" in repeated_words(corpus, corpus.ids)[1]


def test_lips_come_to_the_median_of_what_the_fold_learns_from(corpus):
    folds = make_folds(corpus, 2)
    assert nearest_gaps(corpus, folds) == pytest.approx(dict.fromkeys(corpus.ids, SHUT_MM), abs=1e-5)


def test_every_row_comes_once_more_with_lips_closed(corpus, tmp_path):
    folds = make_folds(corpus, 2)
    result = evaluate([Contestant("mean face", "mean_face")], corpus, folds, tmp_path, closed=True)
    scores = result.comparison.scores
    assert list(scores) == [SECOND_TAKE, SECOND_TAKE + CLOSED, SAME_WORDS, SAME_WORDS + CLOSED, "mean face", f"mean face{CLOSED}"]
    assert scores["mean face"]["closure_rate"].mean == 0
    assert scores[f"mean face{CLOSED}"]["closure_rate"].mean == 1
    assert scores[SAME_WORDS]["closure_rate"].mean < 1, "a word that was taken from the end of a sentence has no m"
    assert scores[SAME_WORDS + CLOSED]["closure_rate"].mean == 1
    again = judge_predictions(corpus, folds, tmp_path / "predictions", ["mean face"], closed=True)
    assert again.comparison.csv() == result.comparison.csv()
    closed = result.sources.motion(corpus, f"mean face{CLOSED}", "u0")
    plain = result.sources.motion(corpus, "mean face", "u0")
    away = opening(closed) != opening(plain)
    assert opening(closed)[30:42].min() == pytest.approx(SHUT_MM, abs=1e-4)
    assert not away[:20].any()
    assert not away[60:].any()


@pytest.mark.parametrize("why", ["no nearer", "inner-lip points", "no p, b or m"])
def test_closing_is_refused_where_it_means_nothing(why, tmp_path):
    layout = replace(LAYOUT, lip_pairs=()) if why == "inner-lip points" else LAYOUT
    corpus = talking(
        tmp_path / "c", [(0, 1), (1, 0)], layout, lambda words: np.full(120, 6.0) if why == "no nearer" else gap_of(words)
    )
    if why == "no p, b or m":
        for name in corpus.ids:
            grid = corpus.files.phones(name)
            grid.write_text(grid.read_text(encoding="utf-8").replace('"m"', '"n"'), encoding="utf-8")
    folds = make_folds(corpus, 2)
    with pytest.raises(FacesynthError, match=why):
        nearest_gaps(corpus, folds)
    result = evaluate([Contestant("mean face", "mean_face")], corpus, folds, tmp_path / "r")
    assert "closure_rate" not in result.main_columns()
    assert any("No column of closures" in one and why.removeprefix("no ") in one for one in result.warnings())


def test_the_verb_closes_lips_and_its_table_says_so(corpus, tmp_path):
    asked = ["mean_face", "--folds", "2", "--closed", "--no-references", "--no-video", "-o", str(tmp_path)]
    made = CliRunner().invoke(evaluate_verb, [str(corpus.path), *asked], catch_exceptions=False)
    assert f"| mean_face{CLOSED} |" in made.output
    assert f"| {SAME_WORDS} |" in made.output


def test_no_method_may_be_called_like_a_row_of_ours():
    for label in (SAME_WORDS, f"mine{CLOSED}"):
        with pytest.raises(FacesynthError, match="label"):
            Contestant(label, "mean_face")
