"""Phones of other languages and aligners: IPA, X-SAMPA, tones, stress, length, and what is spoken but not known."""

import numpy as np
import pytest
from bringing import added, corpus_of, lay_down, spoken
from grids import long_grid, put

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import viseme_of
from facesynth.speech.phone_labels import label_remarks, normalise_phone, notation_of
from facesynth.speech.textgrid import read_labelled

ROUNDED = {"uw", "uh", "ow", "w", "oy"}
SHUT, AT_TEETH = {"p", "b", "m"}, {"f", "v"}


def grid_of(labels):
    bounds = np.round(np.arange(len(labels) + 1) * 0.2, 3).tolist()
    return long_grid([("phones", list(zip(labels, bounds[:-1], bounds[1:], strict=True)))], 0.0, bounds[-1]), bounds[-1]


@pytest.mark.parametrize(
    ("labels", "phones"),
    [
        ("y yː ʏ ø øː œ œ̃ ɥ ɞ ɵ ʉ ɔʏ ɒj", ROUNDED),
        ("i ɪ e ɛ a ɯ ɨ ɤ ə ɐ æ ai aj", {"iy", "ih", "ey", "eh", "aa", "ax", "ah", "ae", "ay"}),
        ("p b m pʰ bʲ mʲ ɓ pː pʼ ʙ pf p͡f", SHUT),
        ("ɱ f v ʋ ɸ β fʲ", AT_TEETH),
        ("t d n l ʈ ɖ ʈʷ ɳ ɾ ɫ t̪ d̪ tʰ ɗ ɲ", {"t", "d", "n", "l"}),
        ("k ɡ ŋ x ɣ ʁ ʀ χ q ɢ ɴ c ɟ kʷ kʰ", {"k", "g", "ng"}),
        ("tʃ dʒ t͡ɕ d͡ʑ ʈʂ tɕ ʃ ɟʝ cç tʃʰ", {"ch", "jh", "sh"}),
        ("s z ʂ ʐ ts dz z̩ sʲ ʒ", {"s", "z", "sh", "zh"}),
    ],
)
def test_ipa_by_what_the_lips_do(labels, phones):
    for label in labels.split():
        assert normalise_phone(label, "ipa") in phones, label


@pytest.mark.parametrize(
    ("labels", "phones"),
    [
        ("@ { 3: 3` V A I U E", "ax ae er er ah aa ih uh eh"),
        ("aI aU OI eI @U i: u: \"A: 'i", "ay aw oy ey ow iy uw aa iy"),
        ("S Z T D N tS dZ j r\\ n= l=", "sh zh th dh ng ch jh y r en el"),
        ("2: 9 y: R pf t_h a_T", "ow ow uw k p t aa"),
    ],
)
def test_x_sampa(labels, phones):
    assert [normalise_phone(label, "x_sampa") for label in labels.split()] == phones.split()


@pytest.mark.parametrize("label", ["a4", "a˥˩", "a⁵¹", "á", "ǎ", "ˈa", "ˌa", "aː", "aˑ", "ã", "a55", "'a"])
def test_tones_stress_and_length_go(label):
    assert normalise_phone(label, "ipa") == "aa"


@pytest.mark.parametrize(
    ("labels", "notation"),
    [
        ("sil AH0 B spn", "arpabet"), ("AA1_B T_E", "arpabet"), ("hh ah l ow", "arpabet"), ("B T S", "arpabet"), ("", "arpabet"),
        ("a y b", "ipa"), ("ə t spn", "ipa"), ("ɟʝ ɒj", "ipa"), ("a4 t i2", "ipa"),
        ("a n N S", "x_sampa"), ("@ n", "x_sampa"), ("aI t", "x_sampa"), ("3: t", "x_sampa"), ("2 9 t", "x_sampa"),
    ],
)  # fmt: skip
def test_the_notation_is_seen_in_all_labels_together(labels, notation):
    assert notation_of(labels.split()) == notation


def test_the_same_letter_means_what_its_notation_says(tmp_path):
    def read(labels):
        return read_labelled(put(tmp_path / "a.TextGrid", grid_of(labels.split())[0])).phones.labels

    assert read("y a j N") == ("uw", "aa", "y", "ng")
    assert read("Y AA JH N") == ("y", "aa", "jh", "n")
    assert read("S a s") == ("sh", "aa", "s")
    assert read("S AA Z") == ("s", "aa", "z")


def test_speak_rounds_the_lips_and_tells_once(tmp_path, talker):
    text, seconds = grid_of(["a", "ø", "ɱ", "b", "œ", "<unk>", "spn", "spn"])
    sound = lay_down(tmp_path / "session", "a", seconds)
    put(sound.with_suffix(".TextGrid"), text)
    curves, facts = spoken(talker, sound, tmp_path)
    middles = (np.arange(8) * 10 + 5).tolist()
    assert (curves["mouthFunnel"][[middles[1], middles[4]]] > 0.6).all()
    assert curves["mouthClose"][middles[3]] > 0.4
    assert (curves["jawOpen"][middles[6:]] < 0.1).all(), "the lips rest at what is not known"
    said = [line for line in facts["remarks"] if "a.TextGrid" in line]
    assert len(said) == 3
    assert "read as IPA" in said[0]
    assert "ø as ow, ɱ as v, œ as ow" in said[1]
    assert "'<unk>' (1), 'spn' (2) is not known; the lips rest there" in said[2]


def test_an_import_takes_them_and_accounts_for_it(tmp_path):
    text, seconds = grid_of(["sil", "ɟʝ", "ɒj", "ɱ", "ʈʷ", "ɖ", "ʁ", "ɣ", "pf", "a4", "sil"])
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", seconds)
    put(sound.with_suffix(".TextGrid"), text)
    report, account = added(corpus, tmp_path / "session")
    assert Corpus.open(corpus)["a"].speech.phones.labels == ("pau", "jh", "oy", "v", "t", "d", "k", "k", "p", "aa", "pau")
    assert any("sounds that English lacks" in remark for remark in report["remarks"]["a"])
    assert "sounds that English lacks" in account


def test_english_is_not_remarked_on():
    assert label_remarks(["AH0", "sil", "B", "", "sp"]) == ()


def test_the_table_is_whole():
    from facesynth.speech.phone_labels import _rows

    rows = _rows()
    assert len({row["ipa"] for row in rows}) == len(rows) > 100
    signs = [row["x_sampa"] for row in rows if row["x_sampa"]]
    assert len(set(signs)) == len(signs)
    for row in rows:
        phone = normalise_phone(row["ipa"], "ipa")
        assert row["phone"] in ("", phone)
        assert phone == "pau" or 1 <= viseme_of(phone) <= 14
        if row["x_sampa"]:
            assert normalise_phone(row["x_sampa"], "x_sampa") == phone, row


@pytest.mark.parametrize(
    ("labels", "strange", "phone"),
    [
        ("HH XYZ AH0 L OW1", "XYZ", "uh"),
        ("HH 4711 AH0 L OW1", "4711", "pau"),
    ],
)
def test_one_unknown_label_is_told_and_does_not_refuse_the_file(tmp_path, labels, strange, phone):
    read = read_labelled(put(tmp_path / "a.TextGrid", grid_of(labels.split())[0]))
    assert read.phones.labels[1] == phone
    assert len(read.phones) == 5
    (said,) = (line for line in read.remarks if "no phones known here" in line)
    assert f"{strange!r} (1) as {phone if phone != 'pau' else 'a rest of the lips'}" in said
    lines = tmp_path / "a.lab"
    lines.write_text("\n".join(f"{0.2 * k + 0.2:.1f} {label}" for k, label in enumerate(labels.split())), encoding="utf-8")
    again = read_labelled(lines)
    assert again.phones.labels == read.phones.labels
    assert said in again.remarks


@pytest.mark.parametrize("label", ["???", "??", "?", "*", "+++"])
def test_question_marks_are_told_as_unclear(tmp_path, label):
    read = read_labelled(put(tmp_path / "a.TextGrid", grid_of(["HH", "AH0", label, "L", "OW1"])[0]))
    assert read.phones.labels == ("hh", "ah", "pau", "l", "ow")
    assert read.remarks == (f"what is said at {label!r} (1) is not known; the lips rest there",)


def test_a_tier_of_words_is_no_tier_of_phones(tmp_path):
    path = put(tmp_path / "a.TextGrid", grid_of(["sil", "hello", "a", "wonderful", "sil", "world", "to", "you"])[0])
    with pytest.raises(FacesynthError, match=r"a.TextGrid: unknown phone 'hello'"):
        read_labelled(path)


def test_digraphs_are_one_sound_among_ipa_too(tmp_path):
    read = read_labelled(put(tmp_path / "a.TextGrid", grid_of(["zh", "ü3", "sh", "a1", "ch", "i4"])[0]))
    assert read.phones.labels[::2] == ("zh", "sh", "ch")


SETS = {
    "pinyin": (
        "sil b a1 m ian4 f uo3 j iang4 q v2 x iong2 zh uang1 sh uai4 c ui2 l ve4 r en2 ar4 n ü3",
        "pau b aa m eh f ow jh aa ch uw sh uh zh aa sh ay s ey l eh r ax aa n uw",
    ),
    "Japanese": ("silB k o N n i ch i w a my o q py U silE", "pau k ow ng n iy ch iy w aa m ow pau p uw pau"),
    "Korean": ("k0 aa pp wv s0 vv mm yu c0 xi", "k aa p ah s ah m uw jh iy"),
    "MRPA": ("pau b @@ d oo n i@ t ou # m ii", "pau b er d ao n ih t ow pau m iy"),
    "Preston Blair": ("rest MBP AI FV O WQ L etc U E rest", "pau m aa f ow w l s uw eh pau"),
    "Rhubarb": ("X A D B E F G C H X", "pau m aa s ao uw f eh l pau"),
}


@pytest.mark.parametrize("kind", list(SETS))
def test_sets_of_one_language_or_program_are_known_by_their_own_labels(tmp_path, kind):
    labels, phones = SETS[kind]
    read = read_labelled(put(tmp_path / "a.TextGrid", grid_of(labels.split())[0]))
    assert read.phones.labels == tuple(phones.split())
    assert any(line.startswith("the phones are read as") for line in read.remarks)


@pytest.mark.parametrize(
    ("labels", "notation"),
    [
        ("a i q t x u", "ipa"), ("uo ie y ö j v a e", "ipa"), ("a4 t i2", "ipa"), ("sh er ch zh ow", "arpabet"),
        ("sh s t n", "arpabet"), ("m b p pau", "arpabet"), ("N a k S", "x_sampa"), ("A E O @", "x_sampa"), ("B D F G", "arpabet"),
    ],
)  # fmt: skip
def test_labels_that_others_share_are_of_no_such_set(labels, notation):
    assert notation_of(labels.split()) == notation


@pytest.mark.parametrize(
    ("label", "notation", "phone"),
    [
        ("a_~", "x_sampa", "aa"), ("E~_o", "x_sampa", "eh"), ("aan", "arpabet", "aa"), ("own", "arpabet", "ow"),
        ("r̝̊", "ipa", "zh"), ("ř", "ipa", "zh"),
        ("a_E", "ipa", "aa"), ("NSN_S", "arpabet", "pau"), ("<EXCLUDE-name>", "arpabet", "pau"),
        ("IVER", "arpabet", "pau"), ("silE", "ipa", "pau"), ("_:", "x_sampa", "pau"), (",", "ipa", "pau"), ("#0", "ipa", "pau"),
    ],
)  # fmt: skip
def test_marks_of_corpora_and_aligners(label, notation, phone):
    assert normalise_phone(label, notation) == phone


def test_speech_that_a_corpus_leaves_out_is_told():
    assert label_remarks(["AA1", "<EXCLUDE-name>", "T"]) == (
        "what is said at '<EXCLUDE-name>' (1) is not known; the lips rest there",
    )
    assert label_remarks(["AA1", "<SIL>", "T"]) == ()
