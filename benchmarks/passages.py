"""A long recording whose transcript lacks a paragraph, or has one too many: what is told, and how well the rest is placed.

python benchmarks/passages.py CORPUS [--minutes 15] [--sentences 6]

The recordings of CORPUS are strung together as in `long_files.py`. Of their text a paragraph is left out in the middle, or one of
other words is put in there. Error is the distance from the middle of each p, b and m that the corpus has to the nearest one that
was placed, outside of the paragraph and of two sentences beside it.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from long_files import PAUSE_S, long_file

from facesynth.corpus import Corpus
from facesynth.inference.phones import BILABIALS
from facesynth.speech.audio import load_audio
from facesynth.speech.phone_sources import find_phones

TOO_MANY = (
    "This paragraph was never said in the studio. A quarter of the harvest was lost to early frost, and the farmers of the valley"
    " asked their neighbours for help. Nobody had expected such a winter. The river froze within a single week."
)
BESIDE = 2
"""Sentences at either side of the paragraph that are not judged."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("--minutes", type=float, default=15)
    parser.add_argument("--sentences", type=int, default=6, help="that the paragraph has which is left out")
    asked = parser.parse_args()
    corpus = Corpus.open(asked.corpus)
    with tempfile.TemporaryDirectory() as folder:
        file = long_file(corpus, 60 * asked.minutes, Path(folder))
        audio, rate = load_audio(file.sound)
        sentences, begins_s, truth_s = said(corpus, len(audio) / rate)
        middle = len(sentences) // 2
        texts = {
            f"lacks {asked.sentences} sentences": [*sentences[:middle], *sentences[middle + asked.sentences :]],
            "has a paragraph too many": [*sentences[:middle], TOO_MANY, *sentences[middle:]],
        }
        for name, lines in texts.items():
            missing = asked.sentences if name.startswith("lacks") else 0
            around_s = begins_s[max(0, middle - BESIDE)], begins_s[min(middle + missing + BESIDE, len(begins_s) - 1)]
            begun = time.process_time()
            found = find_phones(audio, rate, text=" ".join(lines))
            took_s = time.process_time() - begun
            placed_s = closures(found.phones.labels, found.phones.ends_s)
            errors_ms = 1000 * np.array([np.abs(placed_s - t).min() for t in truth_s if not around_s[0] <= t <= around_s[1]])
            quantiles = ", ".join(f"{share}: {np.quantile(errors_ms, share):.0f}" for share in (0.5, 0.9, 0.99))
            true_s = begins_s[middle], begins_s[middle + missing]
            print(f"{asked.minutes:g} minutes, {name} ({true_s[0]:.1f} to {true_s[1]:.1f} s): {took_s:.0f} s of processor time")
            print(
                f"  error of {len(errors_ms)} closures, ms, by share of them {quantiles}", *found.remarks, sep="\n  ", flush=True
            )


def said(corpus: Corpus, duration_s: float) -> tuple[list[str], list[float], np.ndarray]:
    """Sentences, when each begins, and the middles of all closures, of what `long_file` strings together (s)."""
    sentences, begins_s, closed_s, now_s = [], [], [], 0.0
    while True:
        for name in corpus.ids:
            speech = corpus[name].speech
            length_s = round(speech.duration_s + PAUSE_S, 1)
            if now_s + length_s > duration_s + 0.05:
                return sentences, begins_s, np.concatenate(closed_s)
            sentences.append(speech.text.rstrip(".") + ".")
            begins_s.append(now_s)
            closed_s.append(now_s + closures(speech.phones.labels, speech.phones.ends_s))
            now_s += length_s


def closures(labels: tuple[str, ...], ends_s: np.ndarray) -> np.ndarray:
    """Middles of p, b and m, s."""
    starts_s = np.concatenate([[0.0], ends_s[:-1]])
    return np.array([(start + end) / 2 for label, start, end in zip(labels, starts_s, ends_s, strict=True) if label in BILABIALS])


if __name__ == "__main__":
    main()
