"""Texts of other languages than English: which language, and how words are pronounced, by packages of the extra `languages`."""

import csv
import re
import unicodedata
from collections.abc import Iterable, Iterator
from functools import cache, partial
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules

from facesynth.inference.errors import FacesynthError
from facesynth.speech.directions import without_directions
from facesynth.speech.folding import cleaned
from facesynth.speech.ipa_words import phones_of_ipa
from facesynth.speech.phone_labels import normalise_phone
from facesynth.speech.pronunciation import Pronunciation, is_known

ENGLISH = "en"
JAPANESE, MANDARIN = "ja", "zh"
_SCRIPTS = {
    **{"HIRAGANA": JAPANESE, "KATAKANA": JAPANESE, "HANGUL": "ko", "GREEK": "el", "HEBREW": "he", "ARABIC": "ar", "THAI": "th"},
    **{"DEVANAGARI": "hi", "BENGALI": "bn", "TAMIL": "ta", "TELUGU": "te", "GEORGIAN": "ka", "ARMENIAN": "hy", "KHMER": "km"},
    **{"GUJARATI": "gu", "GURMUKHI": "pa", "KANNADA": "kn", "MALAYALAM": "ml", "SINHALA": "si", "LAO": "lo", "MYANMAR": "my"},
    **{"ETHIOPIC": "am", "TIBETAN": "bo", "CJK": MANDARIN, "CYRILLIC": "ru"},
}
"""The language that is most written in a script, by the first word of its letters' names in Unicode."""
_SHARED = frozenset(["ru", "ar", "hi"])
"""Their scripts are those of other languages too."""
_SURE = 15.0
"""By how much the logarithm of another language's probability must exceed that of English: of 16 English lines the most was 9,
of lines of five words in eight other languages the least was 30."""
_SURER = 2 * _SURE
"""The same, where every word is an English one, too (`papa mama` looks like Quechua), or nobody here could pronounce it."""
_FEWEST_WORDS = 4
"""Fewer are not refused for looking like a language that nobody here could pronounce (`hakuna matata`)."""
_MANY = ("ar", "de", "es", "fr", "hi", "it", "ja", "ko", "pt", "ru", "tr", "zh")
_BLOBS = "g2p2_group_"
"""Begins the names of the packages that hold the words of a family of languages."""


def language_of(text: str) -> str:
    """The language a text is written in (ISO 639-1), by its letters, and by trigrams where py3langid is installed.

    `en` where nothing speaks clearly against it.
    """
    scripts = [unicodedata.name(letter, " ").split()[0] for letter in text if letter.isalpha()]
    known = [_SCRIPTS[script] for script in scripts if script in _SCRIPTS]
    if JAPANESE in known:  # beside kana, Chinese letters are kanji
        return JAPANESE
    if 2 * len(known) > len(scripts):
        most = max(sorted(set(known)), key=known.count)
        return _by_trigrams(text, most) if most in _SHARED else most
    return _by_trigrams(text, ENGLISH)


def covered_languages() -> tuple[str, ...]:
    """Languages other than English whose texts can be pronounced with what is installed (ISO 639-1)."""
    extra = [code for code, package in ((MANDARIN, "pypinyin"), (JAPANESE, "pyopenjtalk")) if find_spec(package)]
    return tuple(sorted({*_blobs(), *extra} - {ENGLISH}))


def pronounced(text: str, language: str) -> tuple[tuple[str, Pronunciation], ...]:
    """Words of a text in a language other than English with their phones; directions are left out, numbers are written out.

    FacesynthError where the language is not covered, or the text holds no word that can be pronounced.
    """
    code = code_of(language)
    require_covered(code)
    plain = unicodedata.normalize("NFC", without_directions(cleaned(text))[0])
    reader = {MANDARIN: _in_mandarin, JAPANESE: _in_japanese}.get(code, partial(_by_model, code=code))
    found = tuple((word, phones) for word, phones in reader(plain) if phones)
    if not found:
        raise FacesynthError(f"the transcript holds no word in the language {language!r}; write what is said, or leave it out")
    return found


def code_of(language: str) -> str:
    """`pt` of `pt-BR`, `zh` of `cmn`."""
    code = re.split(r"[-_]", language.strip().lower())[0]
    return {"cmn": MANDARIN, "jpn": JAPANESE, "eng": ENGLISH, "nb": "no", "fil": "tl"}.get(code, code)


def require_covered(code: str) -> None:
    """FacesynthError where texts of a language (ISO 639-1) cannot be pronounced."""
    if code in (MANDARIN, JAPANESE) and code not in covered_languages():
        extra, package = ("languages", "pypinyin") if code == MANDARIN else ("japanese", "pyopenjtalk-plus")
        raise FacesynthError(f"texts in {code!r} need the package {package}: pip install 'facesynth[{extra}]'")
    if code in covered_languages() or code == ENGLISH:
        return
    if not _blobs():
        raise FacesynthError(f"texts in the language {code!r} need other packages: pip install 'facesynth[languages]'")
    raise FacesynthError(
        f"texts in the language {code!r} cannot be pronounced here, those in English and {len(covered_languages())} others can"
        f" (ISO 639-1: {', '.join(_MANY)} …); say `--language` if it is another, leave the text out to"
        " have the phones heard, or give the phones"
    )


@cache
def _blobs() -> dict[str, Path]:
    """Files of words by language. What is missing the package would fetch: it is only asked for what is here."""
    folders = [
        Path(place)
        for module in iter_modules()
        if module.name.startswith(_BLOBS) and (spec := find_spec(module.name))
        for place in spec.submodule_search_locations or ()
    ]
    known = {path.name.partition(".")[0]: path for folder in folders for path in folder.glob("*.g2p.xz")}
    return known if find_spec("g2p2") else {}


def _by_model(text: str, code: str) -> Iterator[tuple[str, Pronunciation]]:
    import g2p2

    words = _words(_numbers_written_out(text, code))
    for word, ipa in zip(words, g2p2.phonemize_many([word.lower() for word in words], code), strict=True):
        yield word, phones_of_ipa(ipa)


def _in_mandarin(text: str) -> Iterator[tuple[str, Pronunciation]]:
    """Syllable by syllable, in the signs of Bopomofo; words in Latin letters stay out, for their language is not known."""
    from pypinyin import Style, pinyin

    letters = [
        letter for letter in _numbers_written_out(text, MANDARIN) if unicodedata.name(letter, "").startswith("CJK UNIFIED")
    ]
    syllables = pinyin("".join(letters), style=Style.BOPOMOFO) if letters else []
    for letter, (syllable,) in zip(letters, syllables, strict=True):
        signs = re.sub("[ˊˇˋ˙]", "", syllable)
        yield letter, _phones_of_symbols(MANDARIN, _longest_known(f"{signs}$", MANDARIN))


def _in_japanese(text: str) -> Iterator[tuple[str, Pronunciation]]:
    """Word by word as Open JTalk parts and reads them."""
    import pyopenjtalk

    for word in pyopenjtalk.run_frontend(text):
        if read := re.sub("[^ァ-ヺー]", "", word["pron"]):
            yield word["string"], _phones_of_symbols(JAPANESE, str(pyopenjtalk.g2p(read)).split())


def _longest_known(signs: str, language: str) -> Iterator[str]:
    """Signs parted into known symbols, the longest first; `$` ends them."""
    while signs.strip("$"):
        length = next((n for n in (3, 2, 1) if signs[:n] in _symbols(language)), 1)
        yield signs[:length]
        signs = signs[length:]


def _phones_of_symbols(language: str, symbols: Iterable[str]) -> Pronunciation:
    sounds = (sound for symbol in symbols for sound in _symbols(language).get(symbol, "").split())
    return tuple(normalise_phone(sound, "ipa") for sound in sounds)


@cache
def _symbols(language: str) -> dict[str, str]:
    """Sounds in IPA, parted by spaces, of the symbols in which a package writes a language."""
    text = resources.files(__package__).joinpath("symbols.csv").read_text(encoding="utf-8")
    return {row["symbol"]: row["ipa"] for row in csv.DictReader(text.splitlines()) if row["language"] == language}


def _numbers_written_out(text: str, code: str) -> str:
    if not re.search(r"\d", text) or find_spec("g2p2") is None:
        return text
    import g2p2

    return str(g2p2.expand_numbers(re.sub(r"(\d+)", r" \1 ", text) if code == MANDARIN else text, code))


def _words(text: str) -> list[str]:
    """Parted at spaces and dashes; without signs at their ends and inside, apostrophes excepted."""
    parts = re.split(r"[\s\-–—/|…]+", text)
    kept = ("".join(filter(_is_said, part)).strip("'") for part in parts)
    return [word for word in kept if word]


def _is_said(letter: str) -> bool:
    return letter == "'" or unicodedata.category(letter)[0] not in "PSCZ"


def _by_trigrams(text: str, otherwise: str) -> str:
    """The likeliest language, where it is much likelier than `otherwise`; a word that is repeated says it once."""
    if find_spec("py3langid") is None:
        return otherwise
    import py3langid

    words = list(dict.fromkeys(_words(text.lower())))
    logarithms = dict(py3langid.rank(" ".join(words)))
    best = max(logarithms, key=logarithms.__getitem__)
    is_english = otherwise == ENGLISH and all(map(is_known, words))
    is_covered = best in covered_languages()
    if len(words) < _FEWEST_WORDS and not is_covered:
        return otherwise
    needed = _SURER if is_english or not is_covered else _SURE
    return str(best) if logarithms[best] > logarithms[otherwise] + needed else otherwise
