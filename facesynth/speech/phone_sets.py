"""Sets of labels that belong to one language or one program and share letters with ARPAbet, IPA and X-SAMPA.

Pinyin's initials and finals, Julius' and OpenJTalk's Japanese, KoG2P's Korean, Edinburgh's MRPA and Unisyn, and the mouths of
Preston Blair (Papagayo) and of Rhubarb: in `phone_sets.csv`, each label beside the phone whose lips it has; `own` marks labels by
which a set is known.
"""

import csv
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources

SETS: Mapping[str, str] = {
    "pinyin": "pinyin",
    "julius": "the Japanese phones of Julius and OpenJTalk",
    "kog2p": "the Korean phones of KoG2P",
    "mrpa": "the British phones of MRPA and Unisyn",
    "preston_blair": "the mouths of Preston Blair",
    "rhubarb": "the mouths of Rhubarb",
}
_LEAST_SHARE = 0.9
_NOT_IPA = frozenset(["zh", "ch", "sh", "q", "x", "c", "uo", "ui", "iu", "ve", "v", "ü"])
"""Labels of pinyin that are something else in IPA."""
_MOUTHS = frozenset("ACEH")
"""Mouths of Rhubarb whose letters are no consonants."""


def set_of(spoken: Iterable[str]) -> str:
    """The set that labels of speech come from, empty where they come from none: nearly all are in it, and one is its own."""
    labels = set(spoken)
    return next((name for name in SETS if _comes_from(labels, name)), "")


def in_set(label: str, name: str) -> str | None:
    """The phone of a label of a set; tones, stress and Kaldi's positions go where the label is not in it with them."""
    bare = re.sub(r"_[BIES]$", "", label)
    plain = re.sub(r"(?<=.)[0-9]+$", "", bare)
    for candidate in (bare, plain, plain.lower(), _without_r(plain.lower())):
        if candidate in _table()[name]:
            return _table()[name][candidate]
    return None


def _without_r(label: str) -> str:
    """A final of Mandarin without the r that colours it: `angr` is ang."""
    return label[:-1] if len(label) > 2 and label.endswith("r") else label


def _comes_from(labels: set[str], name: str) -> bool:
    known = {label for label in labels if in_set(label, name)}
    if not known or len(known) < _LEAST_SHARE * len(labels):
        return False
    if name == "rhubarb":
        return len(labels) > 2 and known == labels and bool(labels & _MOUTHS)
    bare = {re.sub(r"_[BIES]$", "", label) for label in known}
    plain = bare if name == "kog2p" else {re.sub("[0-9]+$", "", label) for label in bare}
    return bool(plain & _own()[name]) or (name == "pinyin" and _has_tones(bare))


def _has_tones(labels: set[str]) -> bool:
    """Whether vowels bear tones beside consonants or finals that IPA writes otherwise."""
    toned = {re.sub("[1-5]$", "", label) for label in labels if re.fullmatch("[a-zü:]+[1-5]", label)}
    vowels = {label for label in labels if label[0] in "aeiouvü"}
    return 2 * len(toned) > len(vowels) and bool((labels | toned) & _NOT_IPA)


@cache
def _rows() -> tuple[dict[str, str], ...]:
    text = resources.files(__package__).joinpath("phone_sets.csv").read_text(encoding="utf-8")
    return tuple(csv.DictReader(text.splitlines()))


@cache
def _table() -> Mapping[str, Mapping[str, str]]:
    return {name: {row["label"]: row["phone"] for row in _rows() if row["set"] == name} for name in SETS}


@cache
def _own() -> Mapping[str, frozenset[str]]:
    return {name: frozenset(row["label"] for row in _rows() if row["set"] == name and row["own"] == "1") for name in SETS}
