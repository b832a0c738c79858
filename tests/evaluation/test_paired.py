import numpy as np
import pytest

from facesynth.evaluation import paired
from facesynth.evaluation.paired import bootstrap, compare_pairs, holm, statements
from facesynth.evaluation.table import Column, Comparison, Row

COLUMNS = (Column("lve", "mm", "low"), Column("closure_rate", "1", "high"), Column("energy_ratio", "1", "1"))


def comparison(rows, count, sentences=None):
    ids = tuple(f"u{i}" for i in range(count))
    return Comparison(COLUMNS, ids, tuple(rows), 0, sentences=tuple(sentences or ids), emotions=("neutral",) * count)


def difference(found, figure, first="good", second="bad"):
    return next(one for one in found if (one.figure, one.first, one.second) == (figure, first, second))


def test_holm_is_the_textbook_s():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_the_bootstrap_of_a_mean_has_the_normal_s_interval_and_p():
    values = np.random.default_rng(0).normal(0.15, 1, 200)
    low, high, p = bootstrap(values[:, None], 0, 100_000)[0]
    error = values.std() / np.sqrt(200)
    assert low == pytest.approx(values.mean() - 1.96 * error, abs=0.1 * error)
    assert high == pytest.approx(values.mean() + 1.96 * error, abs=0.1 * error)
    from scipy.stats import norm

    assert p == pytest.approx(2 * norm.sf(values.mean() / error), rel=0.5)


def test_the_better_method_is_named_by_each_figure_s_own_way():
    rng = np.random.default_rng(1)
    good = Row("good", {"lve": 1 + 0.1 * rng.normal(size=40), "closure_rate": [0.9] * 40, "energy_ratio": [1.1] * 40})
    bad = Row("bad", {"lve": 2 + 0.1 * rng.normal(size=40), "closure_rate": [0.5] * 40, "energy_ratio": [0.5] * 40})
    found = compare_pairs(comparison([good, bad], 40), ("lve", "closure_rate", "energy_ratio"))
    assert [one.better for one in found] == ["good"] * 3
    assert all(one.distinguishable for one in found)
    assert difference(found, "lve").mean == pytest.approx(-1, abs=0.1)
    assert difference(found, "energy_ratio").mean == pytest.approx(-0.4)
    assert statements(found)[0] == ("lve", "good is better than bad. Every pair is told apart.")


def test_equal_methods_are_not_told_apart():
    values = {"lve": np.random.default_rng(2).normal(size=30)}
    found = compare_pairs(comparison([Row("good", values), Row("bad", values)], 30), ("lve",))
    assert found[0].p == found[0].p_holm == 1
    assert statements(found) == [("lve", "no two methods can be told apart.")]


def test_few_sentences_prove_nothing_however_many_utterances_they_have():
    good, bad = Row("good", {"lve": [1.0] * 40}), Row("bad", {"lve": [2.0] * 40})
    few = compare_pairs(comparison([good, bad], 40, [f"s{i % 4}" for i in range(40)]), ("lve",))
    many = compare_pairs(comparison([good, bad], 40), ("lve",))
    assert few[0].sentences == 4
    assert few[0].p == 2.0**-3
    assert not few[0].distinguishable
    assert many[0].distinguishable


def test_false_alarms_stay_under_the_level():
    """Six methods without any difference, by three figures: rarely is any of 45 pairs told apart."""
    alarms = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        table = rng.normal(size=(25, 45))
        alarms += min(holm([p for _, _, p in bootstrap(table, seed, draws=10_000)])) < 0.05
    assert alarms <= 5


def test_forty_different_rows_are_told_apart_and_forty_equal_ones_are_not(monkeypatch):
    """The correction over 780 pairs asks for less than 1000 samples resolve."""
    monkeypatch.setattr(paired, "DRAWS", 1000)
    monkeypatch.setattr(paired, "CHUNK", 1000)
    rng = np.random.default_rng(0)
    apart = [Row(f"m{k}", {"lve": k + 0.1 * rng.normal(size=40)}) for k in range(40)]
    alike = [Row(f"m{k}", {"lve": rng.normal(size=40)}) for k in range(40)]
    found = compare_pairs(comparison(apart, 40), ("lve",))
    assert len(found) == 780
    assert all(one.distinguishable for one in found)
    assert not any(one.distinguishable for one in compare_pairs(comparison(alike, 40), ("lve",)))


def test_far_from_zero_p_is_student_s():
    from scipy.stats import ttest_1samp

    values = np.random.default_rng(4).normal(1.5, 1, 60)
    p = bootstrap(values[:, None], 0, 20_000)[0][2]
    assert p < 1e-9
    assert np.log(p) == pytest.approx(np.log(ttest_1samp(values, 0).pvalue), rel=0.05)


def test_a_recording_is_not_compared():
    rows = [Row("second take", {"lve": [1.0] * 9}), Row("good", {"lve": [2.0] * 9}), Row("bad", {"lve": [3.0] * 9})]
    assert [(one.first, one.second) for one in compare_pairs(comparison(rows, 9), ("lve",))] == [("good", "bad")]


def test_utterances_that_one_of_two_lacks_are_left_out():
    good, bad = Row("good", {"lve": [1, 1, np.nan, 1, 1]}), Row("bad", {"lve": [2, 2, 2, np.nan, 2]})
    assert compare_pairs(comparison([good, bad], 5), ("lve",))[0].sentences == 3
    assert compare_pairs(comparison([good, Row("bad")], 5), ("lve",)) == ()
