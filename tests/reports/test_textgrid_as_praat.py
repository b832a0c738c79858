"""TextGrids that Praat reads and others refuse: overlaps of rounding, intervals of no length, encodings, all of its forms."""

import time

import numpy as np
import pytest
from bringing import added, corpus_of, lay_down, run, spoken
from grids import PHONES, WORDS, binary_grid, chronological_grid, json_grid, long_grid, put, short_grid

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.speech.praat import read_grid
from facesynth.speech.textgrid import read_labelled

FORMS = {"long": long_grid, "short": short_grid, "chronological": chronological_grid, "binary": binary_grid, "json": json_grid}
ENDS = [0.2, 0.5, 0.7, 0.9, 1.0]


@pytest.mark.parametrize("form", FORMS)
def test_every_form_says_the_same(tmp_path, talker, form):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    path = tmp_path / ("a.json" if form == "json" else "a.TextGrid")
    put(path, FORMS[form]([("words", [("Łódź", 0.2, 0.7)]), ("phones", PHONES)]))
    found = read_labelled(path, 1.0)
    assert found.phones.labels == ("pau", "aa", "p", "ae", "pau")
    assert found.words == (("Łódź", 0.2, 0.7),)
    assert found.remarks == ()
    assert spoken(talker, sound, tmp_path, "--phones", path)[0]["mouthClose"].max() > 0.4


@pytest.mark.parametrize("overlap_s", [1e-7, 1e-4, 0.004])
@pytest.mark.parametrize("form", FORMS)
def test_a_small_overlap_is_one_boundary(tmp_path, form, overlap_s):
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", 1.0)
    tier = [(label, start - overlap_s * (start > 0), end) for label, start, end in PHONES]
    path = put(tmp_path / ("a.json" if form == "json" else "a.TextGrid"), FORMS[form]([("phones", tier)]))
    report, account = added(corpus, sound, sound.with_suffix(".npz"), "--phones", path)
    assert "4 intervals overlap" in report["remarks"]["a"][0]
    assert "4 intervals overlap" in account
    np.testing.assert_allclose(Corpus.open(corpus)["a"].speech.phones.ends_s, ENDS, atol=overlap_s)


def test_an_overlap_that_is_no_rounding_is_refused_by_its_place(tmp_path, talker):
    tier = [("AA", 0.0, 0.5), ("P", 0.3, 0.7), ("AA", 0.7, 1.0)]
    sound, path = lay_down(tmp_path / "s", "a", 1.0), put(tmp_path / "a.TextGrid", long_grid([("phones", tier)]))
    code, _, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--phones", path)
    assert (code, "segment 2 ('P') lies at 0.3 to 0.7 s" in said) == (2, True)


@pytest.mark.parametrize("form", FORMS)
def test_intervals_of_no_length_are_left_out_and_told(tmp_path, talker, form):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    tier = [*PHONES[:3], ("sp", 0.7, 0.7), *PHONES[3:], ("sp", 1.0, 1.0)]
    path = put(tmp_path / ("a.json" if form == "json" else "a.TextGrid"), FORMS[form]([("phones", tier)]))
    curves, facts = spoken(talker, sound, tmp_path, "--phones", path)
    assert any("2 intervals of no length were left out (sp)" in line for line in facts["remarks"])
    assert curves["mouthClose"].max() > 0.4


@pytest.mark.parametrize(
    ("encoding", "told"),
    [
        ("latin-1", "Latin-1"),
        ("mac_roman", "MacRoman"),
        ("utf-16-le", "UTF-16 without"),
        ("utf-16-be", "UTF-16 without"),
        ("utf-16", ""),
        ("utf-8-sig", ""),
        ("utf-8", ""),
    ],
)
@pytest.mark.parametrize("word", ["déjà vu", "Größe", "señora", "Überraschung", "ça été"])
@pytest.mark.parametrize("make", [long_grid, short_grid])
def test_words_in_any_encoding(tmp_path, encoding, told, word, make):
    path = put(tmp_path / "a.TextGrid", make([("words", [(word, 0.2, 0.7)]), ("phones", PHONES)]), encoding)
    found = read_labelled(path, 1.0)
    assert found.words[0][0] == word
    assert bool(told) == bool(found.remarks)
    assert not told or told in found.remarks[0]


def test_an_encoding_is_told_on_import(tmp_path):
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), long_grid([("words", [("öp", 0.2, 0.7), *WORDS[1:]]), ("phones", PHONES)]), "mac_roman")
    report, account = added(corpus, tmp_path / "session")
    assert "read as MacRoman" in report["remarks"]["a"][0]
    assert "read as MacRoman" in account
    assert Corpus.open(corpus)["a"].speech.text == "öp a"


def test_points_beside_intervals_are_passed_over_and_alone_are_no_phones(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    points = ("tones", [("H*", 0.3, 0.3)])
    path = put(tmp_path / "a.TextGrid", long_grid([points, ("phones", PHONES)], points=("tones",)))
    assert spoken(talker, sound, tmp_path, "--phones", path)[0]["mouthClose"].max() > 0.4
    put(path, long_grid([("phones", PHONES), points], points=("phones", "tones")))
    code, _, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--phones", path)
    assert (code, "tier of points" in said) == (2, True)


def test_line_ends_remarks_and_praats_signs_for_letters(tmp_path):
    tier = [(r"\sw", 0.0, 0.3), (r"\sh", 0.3, 0.6), (r"i\:f", 0.6, 1.0)]
    text = long_grid([("phones", tier)]).replace("\n", "\r\n").replace("xmin = 0.0 ", "xmin = 0.0 ! where it begins", 1)
    found = read_labelled(put(tmp_path / "a.TextGrid", text), 1.0)
    assert found.phones.labels == ("ax", "sh", "iy")
    assert read_labelled(put(tmp_path / "a.TextGrid", text.replace("\r\n", "\r")), 1.0).phones.labels == ("ax", "sh", "iy")


def test_a_grid_without_tiers_and_what_is_none(tmp_path):
    empty = put(tmp_path / "a.TextGrid", 'File type = "ooTextFile"\nObject class = "TextGrid"\n\n0\n1\n<absent>\n')
    assert read_grid(empty).tiers == ()
    with pytest.raises(FacesynthError, match="its tiers are none"):
        read_labelled(empty)
    with pytest.raises(FacesynthError, match="not a TextGrid"):
        read_labelled(put(tmp_path / "b.TextGrid", "hello\n"))


def test_what_lies_before_0_is_left_out_and_another_order_is_mended_and_both_are_told(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    tier = [("HH", -0.3, -0.1), ("sil", -0.1, 0.2), *[PHONES[k] for k in (2, 1, 4, 3)]]
    path = put(tmp_path / "a.TextGrid", long_grid([("phones", tier)], -0.3))
    found = read_labelled(path, 1.0)
    assert found.phones.labels == ("pau", "aa", "p", "ae", "pau")
    np.testing.assert_allclose(found.phones.ends_s, ENDS)
    remarks = spoken(talker, sound, tmp_path, "--phones", path)[1]["remarks"]
    assert any("begin at -0.3 s; what lies before 0 (1 whole intervals) was left out" in line for line in remarks)
    assert any("not in the order of their times" in line for line in remarks)


@pytest.mark.parametrize("name", ["Segmente", "fon", "IPA", "", "Mary"])
def test_a_tier_of_phones_by_another_name_is_known_by_its_labels(tmp_path, name):
    found = read_labelled(put(tmp_path / "a.TextGrid", short_grid([("Wort", [("up", 0.2, 0.9)]), (name, PHONES)])))
    assert found.phones.labels == ("pau", "aa", "p", "ae", "pau")
    assert any("no tier is called phones" in line for line in found.remarks)


def test_words_alone_are_no_phones_and_an_empty_tier_gives_way_to_a_full_one(tmp_path):
    words = [("the", 0.0, 0.3), ("boat", 0.3, 0.6), ("is", 0.6, 1.0)]
    for name in ("Mary", "words", "utterances"):
        with pytest.raises(FacesynthError, match="no tier of intervals named 'phones'"):
            read_labelled(put(tmp_path / "a.TextGrid", long_grid([(name, words)])))
    for empty in ([], [("", 0.0, 1.0)]):
        found = read_labelled(put(tmp_path / "a.TextGrid", long_grid([("phones", empty), ("A - phones", PHONES)])))
        assert found.phones.labels == ("pau", "aa", "p", "ae", "pau")


LINES = {
    "HTK with sp of no length": "0 2000000 sil\n2000000 5000000 AA1\n5000000 5000000 sp\n"
    "5000000 7000000 P -3.5\n7000000 10000000 sil\n",
    "overlaps of rounding": "0 0.2000001 sil\n0.2 0.5001 AA1\n0.5 0.7 P\n0.7 1.0 sil\n",
    "decimal commas": "0,2 sil\n0,5 AA1\n0,7 P\n1,0 sil\n",
    "a table": "start,end,phone\n0,0.2,sil\n0.2,0.5,AA1\n0.5,0.7,P\n0.7,1.0,sil\n",
    "of the Montreal aligner": "Begin,End,Label,Type,Speaker\n0.2,0.7,op,words,A\n"
    "0.2,0.5,AA1,phones,A\n0.5,0.7,P,phones,A\n0.7,1,sil,phones,A\n",
    "of Praat": "tmin\ttier\ttext\ttmax\n0\tphones\tsil\t0.2\n0.2\tphones\tAA\t0.5\n0.5\tphones\tP\t0.7\n0.7\tphones\t\t1\n",
    "a master label file": '#!MLF!#\n"*/b.lab"\n0 9 k\n.\n"*/a.lab"\n0 0.2 sil\n0.2 0.5 AA1\n0.5 0.7 P\n0.7 1.0 sil\n.\n',
    "a label left out": "0 0.2\n0.2 0.5 AA1\n0.5 0.7 P\n0.7 1.0 \n",
}


@pytest.mark.parametrize("kind", LINES)
def test_lines_of_labels_are_read_as_leniently(tmp_path, talker, kind):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    path = put(tmp_path / "a.lab", LINES[kind])
    found = read_labelled(path, 1.0)
    assert found.phones.labels == ("pau", "aa", "p", "pau")
    np.testing.assert_allclose(found.phones.ends_s, [0.2, 0.5, 0.7, 1.0], atol=1e-3)
    _, facts = spoken(talker, sound, tmp_path, "--phones", path)
    assert any("of no length" in line for line in facts["remarks"]) == ("no length" in kind)
    assert any("overlap" in line for line in facts["remarks"]) == ("overlaps" in kind)


def test_a_label_of_a_hundred_thousand_letters_is_no_phone_and_no_hang(tmp_path):
    path = put(tmp_path / "a.TextGrid", long_grid([("phones", [("B", 0.0, 0.4), ("P" * 100_000, 0.4, 0.6), ("AA1", 0.6, 1.0)])]))
    started_s = time.process_time()
    found = read_labelled(path, 1.0)
    assert time.process_time() - started_s < 2
    assert found.phones.labels == ("b", "pau", "aa")
    (remark,) = [remark for remark in found.remarks if "no phones known here" in remark]
    assert "as a rest of the lips" in remark
    assert len(remark) < 200
