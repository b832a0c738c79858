"""Labels cut out of a longer file with their times kept, beside a sound that begins at 0."""

import numpy as np
import pytest
from bringing import FPS, added, checked, corpus_of, lay_down, run, spoken
from grids import PHONES, WORDS, binary_grid, json_grid, long_grid, put, shifted, short_grid

from facesynth.corpus import Corpus


def moved(by_s, make=long_grid):
    return make([("words", shifted(WORDS, by_s)), ("phones", shifted(PHONES, by_s))], by_s, by_s + 1.0)


def closing(curves):
    """Seconds at which the lips are nearest."""
    return float(curves["mouthClose"].argmax()) / FPS


@pytest.mark.parametrize("make", [long_grid, short_grid, binary_grid, json_grid])
@pytest.mark.parametrize("by_s", [10.0, 0.4, -3.0, 3600.123])
def test_times_of_a_longer_file_are_counted_from_0(tmp_path, talker, by_s, make):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    grid = put(tmp_path / ("a.json" if make is json_grid else "a.TextGrid"), moved(by_s, make))
    curves, facts = spoken(talker, sound, tmp_path, "--phones", grid)
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
    assert any(f"begin at {by_s:g} s" in line for line in facts["remarks"])


def test_lines_of_start_end_label_too(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    lines = "".join(f"{start:.3f} {end:.3f} {label}\n" for label, start, end in shifted(PHONES, 10))
    curves, facts = spoken(talker, sound, tmp_path, "--phones", put(tmp_path / "a.lab", lines))
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
    assert any("begin at 10 s" in line for line in facts["remarks"])


@pytest.mark.parametrize(
    ("head", "tiers_by_s", "told"), [((10.0, 11.0), 0.0, False), ((0.0, 1.0), 10.0, True), ((0.0, 11.0), 10.0, True)]
)
def test_a_head_that_is_of_another_cut_than_its_intervals(tmp_path, talker, head, tiers_by_s, told):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    grid = put(tmp_path / "a.TextGrid", long_grid([("phones", shifted(PHONES, tiers_by_s))], *head))
    curves, facts = spoken(talker, sound, tmp_path, "--phones", grid)
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
    assert any("begin at 10 s" in line for line in facts["remarks"]) == told


@pytest.mark.parametrize("write", ["{:.0f} {:.0f}", "{:.3f} {:.3f}"])
def test_lines_of_a_longer_file_in_milliseconds_and_with_decimal_commas(tmp_path, talker, write):
    sound, scale = lay_down(tmp_path / "session", "a", 1.0), 1000 if ":.0f" in write else 1
    times = [(write.format(scale * (10 + start), scale * (10 + end)), label) for label, start, end in PHONES]
    lines = "".join(f"{time}\t{label}\n".replace(".", ",") for time, label in times)
    curves, facts = spoken(talker, sound, tmp_path, "--phones", put(tmp_path / "a.lab", lines))
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
    assert any("begin at 10 s" in line for line in facts["remarks"])


def test_the_account_tells_and_words_move_too(tmp_path):
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), moved(10.0))
    report, account = added(corpus, tmp_path / "session")
    assert "begin at 10 s" in report["remarks"]["a"][0]
    assert "begin at 10 s" in account
    utterance = Corpus.open(corpus)["a"]
    np.testing.assert_allclose(utterance.speech.phones.ends_s, [0.2, 0.5, 0.7, 0.9, 1.0])
    assert utterance.speech.text == "op a"
    put(corpus / "phones" / "a.TextGrid", moved(10.0))
    assert any("begin at 10 s" in problem["what"] and not problem["grave"] for problem in checked(corpus))
    np.testing.assert_allclose(Corpus.open(corpus)["a"].speech.phones.ends_s, [0.2, 0.5, 0.7, 0.9, 1.0])


def test_times_that_fit_the_sound_stay(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 2.0)
    grid = put(tmp_path / "a.TextGrid", moved(1.0))
    curves, facts = spoken(talker, sound, tmp_path, "--phones", grid)
    assert closing(curves) == pytest.approx(1.6, abs=0.021)
    assert not any("longer file" in line for line in facts["remarks"])


def test_another_sounds_labels_are_refused(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 3.0)
    code, _, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--phones", put(tmp_path / "a.TextGrid", moved(10.0)))
    assert (code, "ends at 11.00 s, the sound at 3.00 s" in said) == (2, True)


@pytest.mark.parametrize(
    ("factor", "end", "unit"),
    [
        (1e7, "", "100 ns"),
        (1e7, " -812.4", "100 ns"),
        (16000, "", "16000 Hz"),
        (44100, "", "44100 Hz"),
        (1000, "", "milliseconds"),
    ],
)
def test_lines_in_other_units(tmp_path, talker, factor, end, unit):
    """HTK counts in 100 ns and may add a score, TIMIT in samples."""
    sound = lay_down(tmp_path / "session", "a", 1.0)
    lines = "".join(f"{factor * start:.0f} {factor * stop:.0f} {label}{end}\n" for label, start, stop in PHONES)
    curves, facts = spoken(talker, sound, tmp_path, "--phones", put(tmp_path / "a.lab", lines))
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
    assert any("they were taken as" in line and unit in line for line in facts["remarks"])


def test_lines_of_xwaves(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    lines = "signal a\nnfields 1\n#\n" + "".join(f"    {stop:.5f}  121 {label}\n" for label, _, stop in PHONES)
    curves, _ = spoken(talker, sound, tmp_path, "--phones", put(tmp_path / "a.lab", lines))
    assert closing(curves) == pytest.approx(0.6, abs=0.021)
