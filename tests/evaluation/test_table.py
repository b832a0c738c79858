import csv
import io
import json
import math

import numpy as np
import pytest

from facesynth.evaluation.emotion_recognition import Confusion
from facesynth.evaluation.exports import best_labels
from facesynth.evaluation.table import Column, Comparison, Row, interval
from facesynth.inference.errors import FacesynthError

NAN = math.nan
ALONE = [str(i) for i in range(40)]
"""Each utterance says another sentence."""
COLUMNS = (
    Column("lve", "mm", "low"),
    Column("fdd", "mm", "0"),
    Column("emotion_accuracy", "1", "high"),
    Column("rtf", "1", "low"),
)


def comparison():
    good = Row(
        "good", {"lve": (1, 2, 3, 2), "fdd": (NAN,) * 4, "emotion_accuracy": (1, 1, 1, 0)}, {"rtf": 0.01}, {"fdd": "no rest"}
    )
    poor = Row("poor", {"lve": (4, NAN, 4, 4), "fdd": (NAN,) * 4}, {"rtf": NAN}, {"fdd": "no rest", "rtf": "no clock"})
    return Comparison(COLUMNS, tuple("abcd"), (good, poor), 0, Confusion.of(["x", "y"], ["x", "y"]), {"train": {"minutes": 1}})


def test_scores_are_means_over_the_utterances_that_have_one():
    scores = comparison().scores
    assert scores["good"]["lve"].mean == 2
    assert scores["good"]["lve"].low < 2 < scores["good"]["lve"].high
    assert (scores["poor"]["lve"].mean, scores["poor"]["lve"].low, scores["poor"]["lve"].utterances) == (4, 4, 3)
    assert scores["good"]["fdd"].utterances == 0


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    covers = [low <= 0 <= high for low, high in (interval(rng.normal(size=40), ALONE, i) for i in range(200))]
    assert 0.88 <= np.mean(covers) <= 0.99
    values = rng.normal(size=40)
    assert interval(values, ALONE, 3) == interval(values, ALONE, 3)


def test_more_utterances_of_the_same_sentences_tell_nothing_new():
    values = np.random.default_rng(0).normal(size=40)
    once, often = interval(values, ALONE, 0), np.repeat(values, 16)
    assert interval(often, np.repeat(ALONE, 16), 0) == pytest.approx(once)
    assert np.ptp(interval(often, [str(i) for i in range(640)], 0)) < 0.4 * np.ptp(once)
    assert interval(np.full(3, 0.1), ["a", "b", "c"], 0) == (0.1, 0.1)


def test_the_table_draws_sentences():
    values = tuple(np.repeat(np.random.default_rng(0).normal(size=10), 4))
    ids = tuple(f"u{i}" for i in range(40))
    widths = []
    for sentences in (ids, tuple(f"s{i // 4}" for i in range(40))):
        score = Comparison(COLUMNS, ids, (Row("a", {"lve": values}),), 0, sentences=sentences).scores["a"]["lve"]
        widths.append(score.high - score.low)
    assert widths[1] > 1.5 * widths[0]


def test_a_mean_over_fewer_utterances_says_so_and_is_never_the_best():
    rows = (
        Row("second take"),
        Row("whole", {"lve": (4, 5, 6, NAN)}),
        Row("part", {"lve": (1, NAN, NAN, NAN), "fdd": (1, 2, 3, 4)}),
    )
    found = Comparison(COLUMNS, tuple("abcd"), rows, 0)
    assert "| part | 1.00 (1 of 3) |" in found.markdown()
    assert str(found.scores["whole"]["lve"]).endswith("]")  # nobody has the fourth
    assert best_labels(found, "lve", "low") == {"whole"}
    alone = Comparison(COLUMNS, tuple("abcd"), (Row("part", {"lve": (1, NAN, NAN, NAN)}),), 0)
    assert str(alone.scores["part"]["lve"]) == "1.00 (1 of 4)"


def test_markdown_gives_units_directions_intervals_and_reasons():
    text = comparison().markdown()
    lines = text.splitlines()
    assert lines[0] == "| method | lve (mm) ↓ | fdd (mm) → 0 | emotion_accuracy ↑ | rtf ↓ |"
    assert lines[2].startswith("| good | 2.00 [")
    alike = lines[lines.index("On the 3 of 4 utterances of poor:") :]
    assert alike[2] == "| method | lve (mm) ↓ | fdd (mm) → 0 | emotion_accuracy ↑ |"
    assert alike[4].startswith("| good | 2.00 [1.00, 3.00] |"), "of the same three: 1, 3 and 2"
    assert alike[5] == "| poor | 4.00 | — | — |"
    assert "— fdd: no rest (good, poor)" in lines
    assert "— rtf: no clock (poor)" in lines
    assert "The recordings themselves: emotion accuracy 1.00, unweighted average recall 1.00." in lines


def test_no_table_has_rows_of_different_utterances():
    rows = (
        Row("whole", {"lve": (1, 2, 3, 9)}),
        Row("few", {"lve": (4, NAN, NAN, NAN)}),
        Row("some", {"lve": (4, 5, NAN, NAN)}),
        Row("none"),
    )
    found = Comparison(COLUMNS[:1], tuple("abcd"), rows, 0).tables()
    assert [(title, [row.label for row in one.rows]) for title, one in found] == [
        ("", ["whole", "none"]),
        ("On the 1 of 4 utterances of few:", ["whole", "few", "some"]),
        ("On the 2 of 4 utterances of some:", ["whole", "some"]),
    ]
    assert [one.scores["whole"]["lve"].mean for _, one in found] == [3.75, 1, 1.5]
    assert all(score["lve"].whole for _, one in found[1:] for score in one.scores.values())


def test_markdown_of_chosen_figures():
    assert comparison().markdown(["rtf"]).splitlines()[:3] == ["| method | rtf ↓ |", "| --- | ---: |", "| good | 0.0100 |"]
    with pytest.raises(FacesynthError, match="lve"):
        comparison().markdown(["lwe"])


def test_csv_has_a_line_per_method_and_figure():
    rows = list(csv.DictReader(io.StringIO(comparison().csv())))
    assert len(rows) == 8
    assert rows[0]["method"] == "good"
    assert float(rows[0]["mean"]) == 2
    assert rows[1]["mean"] == ""
    assert rows[1]["reason"] == "no rest"


def test_json_has_every_utterance_and_no_nan():
    plain = json.loads(comparison().json(), parse_constant=pytest.fail)
    assert plain["rows"][1]["values"]["lve"] == [4, None, 4, 4]
    assert plain["rows"][0]["scores"]["lve"]["mean"] == 2
    assert plain["recorded_emotions"]["asked_by_recognised"] == [[1, 0], [0, 1]]
    assert plain["provenance"] == {"train": {"minutes": 1}}
