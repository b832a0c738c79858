from itertools import pairwise

import numpy as np
import pytest
from acting import phones_of

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, LABIODENTALS, PHONES
from facesynth.performer.script import SMALL, load_script

ARPABET = frozenset(PHONES) - {"ax", "el", "em", "en"}
"""What cmudict writes; the other four are reduced forms of them."""


def diphones_of(phones):
    return set(pairwise(phones))


def diphones_per_minute(sentences):
    phones = [phones_of(sentence.text) for sentence in sentences]
    minutes = sum(0.085 * (len(spoken) - 2) + 0.7 for spoken in phones) / 60
    return len(set().union(*map(diphones_of, phones))) / minutes


def test_the_scripts_have_the_size_they_promise():
    full = load_script("full")
    assert len(full) == 225
    assert load_script("small") == full[:SMALL]
    assert len({sentence.text for sentence in full}) == 225
    assert all(4 <= len(sentence.text.split()) <= 14 for sentence in full)


@pytest.mark.parametrize("size", ["small", "full"])
def test_every_phone_is_spoken(size):
    assert {phone for sentence in load_script(size) for phone in phones_of(sentence.text)} == ARPABET


def test_many_diphones_are_spoken():
    full = load_script("full")
    assert len(set().union(*(diphones_of(phones_of(s.text)) for s in full))) >= 880
    assert len(set().union(*(diphones_of(phones_of(s.text)) for s in full[:SMALL]))) >= 420


def test_the_small_script_says_more_a_minute_than_any_random_choice():
    full = load_script("full")
    rng = np.random.default_rng(0)
    random = [diphones_per_minute([full[i] for i in rng.choice(len(full), SMALL, replace=False)]) for _ in range(100)]
    assert diphones_per_minute(full[:SMALL]) > 1.1 * max(random)


def test_lips_have_much_to_do():
    spoken = [phone for sentence in load_script("small") for phone in phones_of(sentence.text)]
    assert sum(phone in BILABIALS | LABIODENTALS for phone in spoken) / len(spoken) > 0.12


def worth(phones, heard, pairs):
    """Of a sentence: new pairs of phones, new phones, and its consonants of the lips, over its phones and pauses."""
    lips = sum(phone in BILABIALS | LABIODENTALS for phone in phones)
    return (len(diphones_of(phones) - pairs) + 8 * len(set(phones) - heard) + 0.4 * lips) / (len(phones) + 6)


def test_each_next_sentence_adds_most_for_its_length():
    """The greedy choice, within a factor of ln(pairs) of the optimum of this set-cover problem; ties go to the alphabet."""
    left, heard, pairs = {sentence.text: phones_of(sentence.text) for sentence in load_script("full")}, set(), set()
    for sentence in load_script("full"):
        assert sentence.text == max(sorted(left), key=lambda text: worth(left[text], heard, pairs))
        pairs |= diphones_of(left[sentence.text])
        heard |= set(left.pop(sentence.text))


def test_an_unknown_script_is_refused():
    with pytest.raises(FacesynthError, match="did you mean small"):
        load_script("smal")
