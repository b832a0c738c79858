"""TextGrids of several speakers: one must be chosen, none is taken without a word."""

import itertools

import pytest
from bringing import added, checked, corpus_of, lay_down, run, spoken
from grids import long_grid, put

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.speech.textgrid import read_labelled

ANNA = [("B", 0.0, 0.5), ("AA1", 0.5, 1.0)]
BELA = [("S", 0.0, 0.5), ("IY1", 0.5, 1.0)]
NAMES = [
    ("Anna - words", "Anna - phones", "Bela - words", "Bela - phones"),
    ("words@Anna", "phones@Anna", "words@Bela", "phones@Bela"),
    ("Anna_Words", "Anna_Phones", "Bela_Words", "Bela_Phones"),
    ("words (Anna)", "phones (Anna)", "words (Bela)", "phones (Bela)"),
    ("ORT-MAU_Anna", "MAU_Anna", "ORT-MAU_Bela", "MAU_Bela"),
    ("word@Anna", "phon@Anna", "word@Bela", "phon@Bela"),
    ("Anna (words)", "Anna (phones)", "Bela [words]", "Bela [ phones ]"),
]
OTHER_NAMES = [
    ("{} \N{EN DASH} words", "{} \N{EN DASH} phones", "Anna", "Bela"),
    ("{}\N{EM DASH}words", "{}\N{EM DASH}phones", "Anna", "Bela"),
    ("{}\N{NO-BREAK SPACE}-\N{NO-BREAK SPACE}words", "{}\N{NO-BREAK SPACE}-\N{NO-BREAK SPACE}phones", "Anna", "Bela"),
    ("words::{}", "phones::{}", "Anna", "Bela"),
    ("{} - words", "{} - phones", "Wordsworth", "Woodward"),
    ("{} - words", "{} - phones", "Telephone", "Room"),
    ("{} words", "{} phones", "microphone 1", "microphone 2"),
    ("{}Words", "{}Phones", "Stephon", "Persephone"),
    ("{} - words", "{} - phones", "Phone", "Words"),
    ("{} - words", "{} - phones", "\N{LATIN CAPITAL LETTER L WITH STROKE}ucja", "\N{CJK UNIFIED IDEOGRAPH-674E}"),
]


def tiers(names):
    return list(zip(names, ([("bah", 0.0, 1.0)], ANNA, [("see", 0.0, 1.0)], BELA), strict=True))


@pytest.mark.parametrize("names", NAMES)
def test_speak_wants_one_chosen_and_says_what_that_one_says(tmp_path, talker, names):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    for order in itertools.islice(itertools.permutations(tiers(names)), 0, 24, 5):
        put(sound.with_suffix(".TextGrid"), long_grid(order))
        code, _, said = run("speak", talker, sound, "-o", tmp_path / "o.npz")
        assert (code, "2 speakers" in said, "Anna" in said, "Bela" in said, "--speaker" in said) == (2, True, True, True, True)
        anna, _ = spoken(talker, sound, tmp_path, "--speaker", "Anna")
        bela, _ = spoken(talker, sound, tmp_path, "--speaker", "bela")
        assert anna["mouthClose"].max() > 0.4
        assert bela["mouthClose"].max() < 0.01
    code, _, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--speaker", "Cleo")
    assert (code, "unknown speaker 'Cleo'" in said) == (2, True)


@pytest.mark.parametrize("names", OTHER_NAMES)
def test_speakers_whose_names_look_like_kinds_of_tiers_and_other_signs_between(tmp_path, names):
    words, phones, first, second = names
    named = tiers([words.format(first), phones.format(first), words.format(second), phones.format(second)])
    for order in (named, named[::-1]):
        path = put(tmp_path / "a.TextGrid", long_grid(order))
        with pytest.raises(FacesynthError, match="2 speakers") as refused:
            read_labelled(path, 1.0)
        assert f"({', '.join((first, second)[:: 1 if order is named else -1])})" in str(refused.value)
        for speaker, said, word in ((first, ("b", "aa"), "bah"), (second, ("s", "iy"), "see")):
            found = read_labelled(path, 1.0, speaker)
            assert (found.phones.labels, [name for name, _, _ in found.words]) == (said, [word])


def test_add_wants_one_chosen_and_takes_words_and_phones_of_that_one(tmp_path):
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), long_grid(tiers(NAMES[0])))
    said, _ = added(corpus, tmp_path / "session")
    assert "2 speakers (Anna, Bela)" in said
    report, _ = added(corpus, tmp_path / "session", "--speaker", "Bela")
    assert report["added"] == ["a"]
    utterance = Corpus.open(corpus)["a"]
    assert (utterance.speech.text, utterance.speech.phones.labels) == ("see", ("s", "iy"))
    report, _ = added(corpus, tmp_path / "session", "--speaker", "Anna")
    assert report["changed"] == {"a": ["phones"]}
    assert Corpus.open(corpus)["a"].speech.phones.labels == ("b", "aa")


def test_one_who_says_nothing_is_no_choice(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    silent = [("", 0.0, 1.0)]
    put(sound.with_suffix(".TextGrid"), long_grid([("A - phones", silent), ("B - phones", ANNA)]))
    curves, facts = spoken(talker, sound, tmp_path)
    assert curves["mouthClose"].max() > 0.4
    assert any("A says nothing" in line for line in facts["remarks"])


def test_one_speaker_and_tiers_of_the_same_name(tmp_path, talker):
    sound = lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), long_grid([("Anna - words", [("bah", 0, 1)]), ("Anna - phones", ANNA)]))
    assert spoken(talker, sound, tmp_path)[0]["mouthClose"].max() > 0.4
    put(sound.with_suffix(".TextGrid"), long_grid([("Anna - phones", BELA), ("Anna - phones", ANNA)]))
    assert "choose one" in run("speak", talker, sound, "-o", tmp_path / "o.npz")[2]
    assert spoken(talker, sound, tmp_path, "--speaker", "Anna 2")[0]["mouthClose"].max() > 0.4
    put(sound.with_suffix(".TextGrid"), long_grid([("phones_old", BELA), ("phones", ANNA)]))
    curves, facts = spoken(talker, sound, tmp_path)
    assert curves["mouthClose"].max() > 0.4
    assert any("not 'phones_old'" in line for line in facts["remarks"])


def test_check_says_that_a_corpus_own_grid_has_two(tmp_path):
    corpus, sound = corpus_of(tmp_path), lay_down(tmp_path / "session", "a", 1.0)
    put(sound.with_suffix(".TextGrid"), long_grid([("phones", ANNA)]))
    added(corpus, tmp_path / "session")
    put(corpus / "phones" / "a.TextGrid", long_grid(tiers(NAMES[0])))
    assert any("2 speakers" in problem["what"] and problem["grave"] for problem in checked(corpus))
