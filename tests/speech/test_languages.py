"""Texts of many languages as phones: which language, whose letters, which lips."""

from importlib.util import find_spec

import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, viseme_of
from facesynth.speech.ipa_words import phones_of_ipa
from facesynth.speech.languages import code_of, covered_languages, language_of, pronounced

needs = pytest.mark.skipif(not {"de", "fr", "zh"} <= set(covered_languages()), reason="pip install 'facesynth[languages]'")
needs_japanese = pytest.mark.skipif(find_spec("pyopenjtalk") is None, reason="pip install 'facesynth[japanese]'")


@pytest.mark.parametrize(
    ("ipa", "phones"),
    [
        ("p͡flaʊ̯mə", "p l aw m ax"),
        ("t͡ʃek", "ch ey k"),
        ("ʃøːn", "sh ow n"),
        ("bõʒuʁ", "b ow zh uw k"),
        ("pʰan˥˩", "p aa n"),
        ("ˈka.sa", "k aa s aa"),
        ("ʔ", ""),
        ("\u2060ɒ", "aa"),
    ],
)
def test_words_in_ipa(ipa, phones):
    assert " ".join(phones_of_ipa(ipa)) == phones


def test_rounded_front_vowels_are_rounded():
    for vowel in ("y", "ʏ", "ø", "œ"):
        assert viseme_of(phones_of_ipa(vowel)[0]) in {viseme_of("uw"), viseme_of("ow")}


@needs
@pytest.mark.parametrize(
    ("text", "language"),
    [
        ("Bin blue at f two now.", "en"),
        ("Yes.", "en"),
        ("", "en"),
        ("My name is Inigo Montoya.", "en"),
        ("papa mama", "en"),  # Quechua by its trigrams
        ("Ma, ma, ma! Pa, pa, pa!", "en"),
        ("La la la.", "en"),
        ("aba ebe ibi", "en"),
        ("Hakuna matata", "en"),
        ("Le petit garçon mange une pomme.", "fr"),
        ("Die Katze schläft heute im Garten.", "de"),
        ("Маленький мальчик играет с мячом.", "ru"),
        ("Хлопчик грається м'ячем у парку, бо сьогодні гарна погода.", "uk"),
        ("小男孩在公园里玩皮球。", "zh"),
        ("男の子が遊んでいます。", "ja"),
        ("작은 소년이 놀아요.", "ko"),
        ("Το μικρό αγόρι παίζει.", "el"),
    ],
)
def test_the_language_of_a_text(text, language):
    assert language_of(text) == language


@needs
@pytest.mark.parametrize(
    ("language", "text", "closures"),
    [
        ("de", "5 Äpfel, „bitte“ – [Musik] Mama!", 4),
        ("zh", "皮球 不，妈妈 3", 4),
        ("pt-BR", "Pobre bebê", 4),
        ("fr", "Bonjour papa", 3),
    ],
)
def test_words_with_signs_numbers_and_closures(language, text, closures):
    phones = [phone for _, phones in pronounced(text, language) for phone in phones]
    assert sum(phone in BILABIALS for phone in phones) == closures


@needs_japanese
def test_japanese_is_read_as_said():
    said = dict(pronounced("これは3本のペンです。", "ja"))
    assert said["は"] == ("w", "aa")
    assert said["本"][0] == "b"


@needs
def test_what_no_package_covers_is_one_line():
    with pytest.raises(FacesynthError, match=r"'xx' cannot be pronounced.*leave the text out"):
        pronounced("hallo", "xx")
    with pytest.raises(FacesynthError, match="no word"):
        pronounced("— … 12 ?!".replace("12", ""), "de")


def test_missing_packages_are_named(monkeypatch):
    monkeypatch.setattr("facesynth.speech.languages._blobs", dict)
    monkeypatch.setattr("facesynth.speech.languages.find_spec", lambda _: None)
    for code, extra in (("de", "languages"), ("zh", "languages"), ("ja", "japanese")):
        with pytest.raises(FacesynthError, match=rf"pip install 'facesynth\[{extra}\]'"):
            pronounced("hallo", code)


def test_codes():
    assert [code_of(name) for name in ("pt-BR", "de_AT", "cmn", " EN ")] == ["pt", "de", "zh", "en"]
