"""What libraries make of transcripts as people write them: `python benchmarks/transcripts.py [LINES]`.

LINES holds `text | words that are said`, tests/reports/transcripts.txt if none is given. A line is right if its words are the
same, letter case and marks apart. Libraries that are not installed are left out: pip install nemo_text_processing wetext
gruut g2p_en num2words.
inflect and num2words say numbers, so they are given each number and ordinal of a line; the others are given whole lines.
"""

import re
import sys
import unicodedata
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from facesynth.speech.transcript import words_of

LINES = Path(__file__).parents[1] / "tests" / "reports" / "transcripts.txt"
NUMBER = re.compile(r"(\d[\d,]*(?:\.\d+)?)(st|nd|rd|th)?\b")
Normaliser = Callable[[str], str]


def facesynth() -> Normaliser:
    return lambda text: " ".join(words_of(text))


def inflect() -> Normaliser:
    import inflect as library

    engine = library.engine()

    def said(match: re.Match[str]) -> str:
        words = str(engine.number_to_words(match[1].replace(",", ""), andword=""))
        return str(engine.ordinal(words)) if match[2] else words

    return lambda text: NUMBER.sub(said, text)


def num2words() -> Normaliser:
    from num2words import num2words as say

    def said(match: re.Match[str]) -> str:
        number = match[1].replace(",", "")
        if match[2]:
            return str(say(int(float(number)), ordinal=True))
        return str(say(float(number) if "." in number else int(number))).replace(" and ", " ")

    return lambda text: NUMBER.sub(said, text)


def g2p_en() -> Normaliser:
    from g2p_en.expand import normalize_numbers

    return normalize_numbers  # type: ignore[no-any-return]


def gruut() -> Normaliser:
    from gruut import sentences

    def said(text: str) -> str:
        return " ".join(word.text for sentence in sentences(text, lang="en-us") for word in sentence if word.is_spoken)

    return said


def wetext() -> Normaliser:
    from wetext import Normalizer

    return Normalizer(lang="en", operator="tn").normalize


def nemo() -> Normaliser:
    from nemo_text_processing.text_normalization.normalize import Normalizer

    engine = Normalizer(input_case="cased", lang="en")
    return lambda text: str(engine.normalize(text, punct_post_process=False))


def plain(text: str) -> list[str]:
    """Words of what a library gave: small letters, marks of other alphabets taken off."""
    text = "".join(c for c in unicodedata.normalize("NFKD", text.lower()) if not unicodedata.combining(c))
    return re.findall(r"[a-z]+(?:'[a-z]+)*", text)


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else LINES
    lines = [line.rpartition(" | ") for line in path.read_text(encoding="utf-8").splitlines() if " | " in line]
    print(f"| of {len(lines)} lines | right |\n|---|---|")
    for make in (facesynth, nemo, wetext, gruut, g2p_en, num2words, inflect):
        try:
            normalise = make()
        except ImportError as error:
            print(f"| {make.__name__} | not installed ({error}) |")
            continue
        right = 0
        for text, _, words in lines:
            with suppress(Exception):  # what a library stumbles over is not right
                right += plain(normalise(text)) == plain(words)
        print(f"| {make.__name__} | {right / len(lines):.0%} |")


if __name__ == "__main__":
    main()
