"""What aligners and transcribers call phones: ARPAbet, TIMIT, the International Phonetic Alphabet, X-SAMPA, Praat's signs.

One table of articulatory features, `ipa.csv`, holds the sounds of all languages. A sound that English lacks becomes the
English phone whose lips look most like it.
"""

import csv
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from facesynth.inference.errors import unknown
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.speech.phone_sets import SETS, in_set, set_of

Notation = str
NOTATIONS: Mapping[Notation, str] = {"arpabet": "ARPAbet", "ipa": "IPA", "x_sampa": "X-SAMPA", **SETS}
"""How labels can be written, by name; a key of this is a notation."""

CLOSURES = {"bcl": "b", "dcl": "d", "gcl": "g", "pcl": "p", "tcl": "t", "kcl": "k"}
"""TIMIT's closures before the release of a stop."""

QUIET = frozenset(
    (
        *(
            "",
            "sil",
            "sp",
            "ssil",
            "pause",
            "silence",
            "silb",
            "sile",
            "h#",
            "#h",
            "epi",
            "#",
            "_",
            "-",
            "_:",
            ",",
            ".",
            ";",
            "!",
        ),
        *("...", "…", "<eps>", "<sil>", "<s>", "</s>", "<p:>", "p:", "<p>", "<usb>", "<nib>", "nsn", "noise", "vocnoise"),
        *("breath", "brth", "cough", "smack", "lau", "laugh", "uh_noise", "um_noise"),
    )
)
"""Silences, pauses and noises."""
UNCLEAR = frozenset(["spn", "<spn>", "<unk>", "unk", "[unk]", "oov", "<oov>", "+spn+", "<unknown>", "unknown", "iver"])
"""Somebody speaks, and the aligner does not know what."""

_QUESTION = re.compile(r"\?{2,}|[*+]+")
"""What people write where they do not know what was said; a single ? is a sound in X-SAMPA."""

_OTHER_NAMES: Mapping[str, str] = {
    **CLOSURES,
    **dict.fromkeys(QUIET | UNCLEAR | {"q"}, SILENCE),
    # the fuller ARPAbet of TIMIT and of other dictionaries
    **{"ix": "ih", "ax-h": "ax", "axr": "er", "ux": "uw", "dx": "t", "nx": "n", "hv": "hh", "eng": "ng", "h": "hh"},
    **{"wh": "w", "j": "y", "oh": "aa", "ia": "ih", "ea": "eh", "ua": "uh", "lx": "l", "rx": "r", "sch": "sh"},
}
_LIGATURES = str.maketrans({"ʧ": "tʃ", "ʤ": "dʒ", "ʦ": "ts", "ʣ": "dz", "ʨ": "tɕ", "ʥ": "dʑ", "\u02d0": "", "\u02d1": ""})
_ARPABET_ALONE = frozenset(phone for phone in PHONES if len(phone) == 2) - {"pau", "el", "em", "en"}
"""Names that no other notation has; the others are letters that mean something else in IPA and X-SAMPA."""
_DIGRAPHS = frozenset(["ch", "sh", "zh"])
"""One sound in every spelling that writes them: of ARPAbet, and of pinyin; no two letters of IPA."""
_SYLLABIC = {"l": "el", "ɫ": "el", "m": "em", "n": "en", "ŋ": "en", "r": "er", "ɹ": "er", "ɻ": "er"}
_MOST_NAMED = 4
_LONGEST_SHOWN, _LONGEST_LABEL = 40, 64
"""Letters; what is longer is a sentence, or damaged, and no phone."""


@dataclass(frozen=True)
class Sound:
    """A row of the table. All features are 0 to 1; lips: 0 apart, 1 at the teeth, 2 closed."""

    ipa: str
    phone: str
    """The English phone that it is; empty for a sound that English lacks."""
    vowel: bool
    lips: float
    rounded: float
    place: float
    """From the front of the mouth to the back."""
    open: float
    """Of a consonant: from stops over fricatives to glides; of a vowel: from close to open."""
    voiced: float
    nasal: float
    sibilant: float


def normalise_phone(label: str, notation: Notation = "arpabet") -> str:
    """The phone that a label means, in `notation` if it can be, else in any other.

    Stress, tones, length, Kaldi's positions (`_B`), noise marks (`+SPN+`, `<sil>`) and secondary articulations go; an empty
    label is silence. FacesynthError, naming the nearest phones, for a label that means nothing here.
    """
    found = _read(label, notation)
    if found is None:
        raise unknown("phone", label if len(label) <= _LONGEST_SHOWN else f"{label[:_LONGEST_SHOWN]}…", PHONES)
    return found


def notation_of(labels: Iterable[str]) -> Notation:
    """In which notation labels are written: some of them are read in one way alone, others (y, j, N, S) in several."""
    names = {label.strip() for label in labels} - {""}
    spoken = {name for name in names if not _is_mark(re.sub("_[bies]$", "", name.lower()))}
    if own := set_of(spoken):
        return own
    plain = {re.sub(r"[0-9]*(_[BIES])?$", "", name) for name in spoken}
    arpabet = {name for name in plain if name.lower() in _ARPABET_ALONE and (name.islower() or name.isupper())}
    if 3 * len(arpabet) >= len(plain):
        return "arpabet"
    if any(not name.isascii() for name in spoken):
        return "ipa"
    letters = {name for name in plain if name.isalpha()}
    if any(re.search(r"[@{}&?\\`=\"%]|:$|^[1-9]$|_[<hjwd]", name) for name in spoken):
        return "x_sampa"
    if any(name.islower() for name in letters) and any(not name.islower() for name in letters):
        return "x_sampa"
    return "ipa" if letters & {"a", "e", "i", "o", "u"} else "arpabet"


def label_remarks(labels: Iterable[str]) -> tuple[str, ...]:
    """What a person should know of how labels were read, each thing once: their notation, approximations, what is unclear."""
    counted = Counter(label.strip() for label in labels)
    notation = notation_of(counted)
    foreign = {label: phone for label in counted if (phone := _approximated(label, notation))}
    unclear = {label: count for label, count in counted.items() if _is_unclear(label.lower(), notation)}
    remarks = []
    if notation != "arpabet":
        remarks.append(f"the phones are read as {NOTATIONS[notation]}")
    if foreign:
        some = ", ".join(f"{label} as {phone}" for label, phone in list(foreign.items())[:_MOST_NAMED])
        more = f" and {len(foreign) - _MOST_NAMED} more" if len(foreign) > _MOST_NAMED else ""
        remarks.append(f"sounds that English lacks are taken as the phones whose lips look most like them: {some}{more}")
    if unclear:
        said = ", ".join(f"{label!r} ({count})" for label, count in unclear.items())
        remarks.append(f"what is said at {said} is not known; the lips rest there")
    return tuple(remarks)


def _is_in_angles(plain: str) -> bool:
    """`<exclude-name>` of Buckeye and its like: somebody speaks."""
    return len(plain) > 3 and plain[0] == "<" and plain[-1] == ">" and plain[1:-1].strip("-_: ").isprintable()


def _is_unclear(plain: str, notation: Notation) -> bool:
    told = _is_in_angles(plain) and not {plain, plain.strip("<>")} & QUIET
    return told or plain in UNCLEAR or bool(_QUESTION.fullmatch(plain)) or (plain == "?" and notation != "x_sampa")


def _is_mark(plain: str) -> bool:
    """Whether a lower-case label stands for no sound of speech that one knows."""
    marked = len(plain) > 1 and plain[0] in "+[{(" and plain[-1] in "+]})"
    quiet = plain in QUIET or plain in UNCLEAR or plain == SILENCE or bool(re.fullmatch(r"#\d*", plain))
    return quiet or marked or _is_in_angles(plain) or bool(_QUESTION.fullmatch(plain))


def _read(label: str, notation: Notation) -> str | None:
    name = re.sub(r"(?<=\w)_[BIES]$", "", unicodedata.normalize("NFC", label).strip())
    if _is_mark(name.lower()):
        return SILENCE
    if len(name) > _LONGEST_LABEL:
        return None
    if notation in SETS and (phone := in_set(name, notation)):
        return phone
    if name.lower().rstrip("0123456789") in _DIGRAPHS:
        return name.lower().rstrip("0123456789")
    readers = {"arpabet": _by_name, "ipa": _in_ipa, "x_sampa": _in_x_sampa}
    first = notation if notation in readers else "ipa"
    order = [readers[first], *(reader for other, reader in readers.items() if other != first)]
    return next((phone for reader in order if (phone := reader(name))), None)


def _approximated(label: str, notation: Notation) -> str | None:
    """The phone that stands for a label with a sound that English lacks; None for any other."""
    name = unicodedata.normalize("NFC", label).strip()
    if (
        len(name) > _LONGEST_LABEL
        or _is_mark(name.lower())
        or (notation == "arpabet" and _by_name(name))
        or (notation in SETS and in_set(name, notation))
    ):
        return None
    text = _ipa_of(name) if notation == "x_sampa" else name
    sounds = _sounds_in(text) if text else None
    return _read(label, notation) if sounds and not all(sound.phone for sound in sounds) else None


def _by_name(name: str) -> str | None:
    plain = re.sub(r"_[bies]$", "", name.lower())
    plain = re.sub(r"(?<=[a-z])[0-3]$", "", plain)
    for candidate in (plain, plain.strip("<>()*"), _without_n(plain)):
        if candidate in PHONES:
            return candidate
        if candidate in _OTHER_NAMES:
            return _OTHER_NAMES[candidate]
    return None


def _without_n(name: str) -> str:
    """A vowel that Buckeye marks as nasal: `aan` is aa."""
    return name[:-1] if len(name) == 3 and name.endswith("n") else name


def _in_x_sampa(name: str) -> str | None:
    text = _ipa_of(name)
    return _in_ipa(text) if text else None


def _in_ipa(name: str) -> str | None:
    sounds = _sounds_in(name)
    if not sounds:
        return None
    first, last = sounds[0], sounds[1] if len(sounds) == 3 and sounds[1].vowel else sounds[-1]
    if len(sounds) == 1:
        return _alone(first, unicodedata.normalize("NFD", name))
    if not first.vowel and not last.vowel:
        return _affricate(first, last)
    if first.vowel and (last.vowel or last.ipa in "jwɥɹ"):
        return _diphthong(first, last)
    if len(sounds) == 3 and _is_obstruent(first) and _is_obstruent(sounds[-1]):
        return None  # a syllable, no phone
    return _nearest(next(sound for sound in sounds if sound.vowel))


def _alone(sound: Sound, name: str) -> str:
    """One sound with its marks: syllabic, coloured by r, or raised as the Czech ř."""
    if "\u02de" in name and sound.vowel:
        return "er"
    if sound.ipa == "r" and re.search("\u031d|\u030c", name):
        return "zh"
    syllabic = "\u0329" in name or "\u030d" in name
    return _SYLLABIC.get(sound.ipa, _nearest(sound)) if syllabic else _nearest(sound)


def _is_obstruent(sound: Sound) -> bool:
    return not sound.vowel and sound.open < 1


def _affricate(stop: Sound, fricative: Sound) -> str:
    """Closed lips are seen before all; else the friction is what is seen longer."""
    if stop.lips or stop.ipa == fricative.ipa:
        return _nearest(stop)
    if stop.open == 0 and fricative.open == 0.5 and 0.4 <= fricative.place < 0.7:
        return "jh" if fricative.voiced else "ch"
    return _nearest(fricative)


def _diphthong(first: Sound, last: Sound) -> str:
    """By where the mouth begins and whether it ends spread, rounded, or as open as it began."""
    to_front = last.open < 0.2 and not last.rounded if last.vowel else last.ipa == "j"
    to_round = last.rounded > 0.5 and last.open < 0.4 if last.vowel else last.ipa in "wɥ"
    if last.ipa == "ɹ":
        return "er" if first.place == 0.5 else _nearest(first)
    if to_front or (last.vowel and last.rounded > 0.5 and last.place < 0.5):
        starts_rounded = first.rounded or first.ipa == "ɒ"
        return "oy" if starts_rounded and first.open >= 0.3 else _by_opening(first, wide="ay", middle="ey")
    if to_round:
        return "ow" if first.rounded or first.ipa == "ə" else _by_opening(first, wide="aw", middle="ow")
    if last.open > first.open and last.ipa not in "əɐɜ":
        return _nearest(last)
    return _nearest(first)


def _by_opening(first: Sound, wide: str, middle: str) -> str:
    if first.open >= 0.65:
        return wide
    return middle if first.open >= 0.3 else _nearest(first)


# Distance of two sounds as one sees them: first whether the lips close, then rounding, then how far the mouth is open, then
# what only the teeth and the tongue show.
def _nearest(sound: Sound) -> str:
    """The English phone that a sound is, else the one that looks most like it."""
    if sound.phone:
        return sound.phone

    def distance(other: Sound) -> float:
        seen = 4 * abs(sound.lips - other.lips) + 3 * abs(sound.rounded - other.rounded)
        shape = abs(sound.open - other.open) + (0.3 if sound.vowel else 2.0) * abs(sound.place - other.place)
        return (
            seen
            + shape
            + 0.7 * abs(sound.sibilant - other.sibilant)
            + 0.2 * (abs(sound.voiced - other.voiced) + abs(sound.nasal - other.nasal))
        )

    # ao stands among the spread vowels (table A1): no other rounded vowel goes there.
    known = [other for other in _table().values() if other.phone not in ("", "ao", SILENCE) and other.vowel == sound.vowel]
    return min(known, key=distance).phone


def _sounds_in(text: str) -> list[Sound] | None:
    """The one to three sounds that a label in IPA writes; None where it is no IPA, or longer than any one phone."""
    plain = unicodedata.normalize("NFC", text.translate(_LIGATURES))
    kept = "".join(_bare(letter) for letter in plain)
    kept = re.sub(r"^['’,]|(?<=.)[0-9]+$", "", kept)
    most = 2 if text.isascii() else 3
    if not 1 <= len(kept) <= most or any(letter not in _table() for letter in kept):
        return None
    sounds = [_table()[letter] for letter in kept]
    doubled = text.isascii() and sounds[0].vowel and len(sounds) == 2 and sounds[0] == sounds[1]
    return None if doubled else sounds


def _bare(letter: str) -> str:
    """A letter without accents and marks (stress, tone, length, secondary articulation); ç is a letter of its own."""
    if letter in _table():
        return letter
    base = "".join(part for part in unicodedata.normalize("NFD", letter) if unicodedata.category(part) != "Mn")
    is_mark = all(unicodedata.category(part) in ("Lm", "Sk", "No", "Sm") or part in "'’.‿|‖↓↑↗↘ˈˌ" for part in base)
    return "" if is_mark and base not in _table() else base


def _ipa_of(name: str) -> str | None:
    """X-SAMPA as IPA; None for anything else."""
    text = re.sub(r"^[\"%']+", "", name)
    text = re.sub(r"_~|\u035c|\u0361", "", text)
    text = re.sub(r"_[TBHLMRF0-9](?:_[TBHLMRF0-9])*$|[:'~]|:\\", "", text)
    syllabic = bool(re.search(r"(?<=.)_?=$", text))
    text = re.sub(r"(?<=.)_?=$|_[hjwGdnlaAmNocrv+\-/^\"}>{tkxXq?\\0]+", "", text)
    text = re.sub(r"(?<=[a-zA-Z@{}\\])[0-9]+$", "", text) if len(text) > 1 and text[-2:] not in _signs() else text
    letters, place = "", 0
    while place < len(text):
        here = (text[place : place + length] for length in (5, 4, 3, 2, 1))
        sign = next((part for part in here if part in _signs()), None)
        if sign is None:
            return None
        letters, place = letters + _signs()[sign], place + len(sign)
    return letters + ("\u0329" if syllabic else "") if not name.isdigit() or len(name) == 1 else None


@cache
def _rows() -> tuple[Mapping[str, str], ...]:
    text = resources.files(__package__).joinpath("ipa.csv").read_text(encoding="utf-8")
    return tuple(csv.DictReader(text.splitlines()))


@cache
def _table() -> Mapping[str, Sound]:
    """The sounds by their letter in IPA."""
    numbers = ("lips", "rounded", "place", "open", "voiced", "nasal", "sibilant")
    return {
        row["ipa"]: Sound(row["ipa"], row["phone"], row["vowel"] == "1", **{name: float(row[name]) for name in numbers})
        for row in _rows()
    }


@cache
def _signs() -> Mapping[str, str]:
    """Letters in IPA by their sign in X-SAMPA."""
    return {row["x_sampa"]: row["ipa"] for row in _rows() if row["x_sampa"]}


@cache
def praat_signs() -> Mapping[str, str]:
    r"""Letters in IPA by the two characters that stand for them behind a backslash in Praat: `\sw` is ə."""
    return {row["praat"]: row["ipa"] for row in _rows() if row["praat"]}
