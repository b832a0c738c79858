"""How well phones are found in real recordings: `python benchmarks/alignment.py FOLDER [--clips N]`.

FOLDER holds any of `haskins_ema` (hand-labelled phones), `grid_s1` (word times) and `ravdess_speech` (sentence known,
eight emotions). Printed are errors of boundaries, phone errors of recognition, and how often a right transcript is
refused and a wrong one accepted.
"""

import argparse
import difflib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE, viseme_of
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.alignment import Alignment, align
from facesynth.speech.audio import load_audio
from facesynth.speech.phone_labels import normalise_phone
from facesynth.speech.recognition import recognise
from facesynth.speech.segments import phone_track

STATEMENTS = {"01": "Kids are talking by the door", "02": "Dogs are sitting by the door"}
OTHERS = (
    "the quick brown fox jumps over the lazy dog",
    "please call stella and ask her to bring these things",
    "my favourite colour is green",
    "we will meet again tomorrow evening",
    "what do you think about it",
    "she had your dark suit in greasy wash water all year",
)
GRID_UNITS_PER_S = 25000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=12, help="how many clips of each large set")
    options = parser.parse_args()
    for name, measure in (("haskins_ema", haskins), ("grid_s1", grid), ("ravdess_speech", ravdess)):
        if (options.folder / name).is_dir():
            print(f"\n{name}")
            measure(options.folder / name, options.clips)


def haskins(folder: Path, _clips: int) -> None:
    """Boundaries and recognition against phones labelled by hand."""
    errors_s, phones, wrong, wrong_visemes = [], 0, 0, 0
    for path in sorted(folder.glob("*.mat")):
        sound = next(v for k, v in loadmat(path, squeeze_me=True, struct_as_record=False).items() if not k.startswith("__"))[0]
        audio = (sound.SIGNAL / np.abs(sound.SIGNAL).max() / 2).astype(np.float32)
        truth = phone_track([(str(p.LABEL), *map(float, p.OFFS)) for p in sound.PHONES])
        errors_s += boundary_errors_s(align(audio, sound.SRATE, sound.SENTENCE).phones, truth)
        heard = recognise(audio, sound.SRATE)
        phones += len(spoken(truth))
        wrong += edits(spoken(heard), spoken(truth))
        wrong_visemes += edits([viseme_of(p) for p in spoken(heard)], [viseme_of(p) for p in spoken(truth)])
    show("alignment, phone boundaries", errors_s)
    print(
        f"  recognition: phone error rate {wrong / phones:.2f}, viseme error rate {wrong_visemes / phones:.2f} ({phones} phones)"
    )


def grid(folder: Path, count: int) -> None:
    """Word boundaries against the corpus's own, which are rounded to 20 to 40 ms."""
    clips = spread(sorted(folder.glob("*.mpg")), count)
    truths = [[line.split() for line in clip.with_suffix(".align").read_text().splitlines()] for clip in clips]
    words = [
        [(w, int(a) / GRID_UNITS_PER_S, int(b) / GRID_UNITS_PER_S) for a, b, w in t if w not in ("sil", "sp")] for t in truths
    ]
    texts = [" ".join(word for word, _, _ in said) for said in words]
    found = refusals(clips, texts, [texts[(i + len(texts) // 2) % len(texts)] for i in range(len(texts))])
    errors_s = [
        got - wanted
        for placed, said in zip(found, words, strict=True)
        if placed is not None
        for placed_word, said_word in zip(placed.words, said, strict=True)
        for got, wanted in zip(placed_word[1:], said_word[1:], strict=True)
    ]
    show("alignment, word boundaries", errors_s)


def ravdess(folder: Path, count: int) -> None:
    """Two sentences in eight emotions: whether the transcript is accepted."""
    clips = spread(sorted(folder.glob("*/*.flac")), count)
    refusals(clips, [STATEMENTS[clip.stem.split("-")[4]] for clip in clips], [OTHERS[i % len(OTHERS)] for i in range(len(clips))])


def refusals(clips: Sequence[Path], right: Sequence[str], wrong: Sequence[str]) -> list[Alignment | None]:
    """Print how often right transcripts are refused and wrong ones accepted; returns the alignments with the right ones."""
    found = [attempt(clip, text) for clip, text in zip(clips, right, strict=True)]
    others = [attempt(clip, text) for clip, text, own in zip(clips, wrong, right, strict=True) if text != own]
    fits = [placed.fit for placed in found if placed is not None]
    print(f"  right transcript: {len(fits)} of {len(found)} aligned, fit {np.min(fits):.0f} to {np.max(fits):.0f}")
    print(f"  wrong transcript: {sum(placed is None for placed in others)} of {len(others)} refused")
    return found


def attempt(clip: Path, text: str) -> Alignment | None:
    try:
        return align(*load_audio(clip), text)
    except FacesynthError:
        return None


def boundary_errors_s(found: PhoneTrack, truth: PhoneTrack) -> list[float]:
    """Found minus true time of every boundary between two phones that both tracks have next to each other."""
    blocks = difflib.SequenceMatcher(None, found.labels, truth.labels, autojunk=False).get_matching_blocks()
    return [float(found.ends_s[a + k] - truth.ends_s[b + k]) for a, b, size in blocks for k in range(size - 1)]


def show(what: str, errors_s: Sequence[float]) -> None:
    errors_ms = np.array(errors_s) * 1000
    print(
        f"  {what}: {len(errors_ms)}, median error {np.median(np.abs(errors_ms)):.1f} ms,"
        f" 90th percentile {np.percentile(np.abs(errors_ms), 90):.1f} ms, median offset {np.median(errors_ms):+.1f} ms"
    )


def spoken(phones: PhoneTrack) -> list[str]:
    return [normalise_phone(label) for label in phones.labels if label != SILENCE]


def edits(a: Sequence[object], b: Sequence[object]) -> int:
    """Levenshtein distance."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, start=1):
        before, row = row, [i]
        for j, y in enumerate(b, start=1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (x != y)))
    return row[-1]


def spread(paths: Sequence[Path], count: int) -> list[Path]:
    """`count` paths in a fixed random order."""
    order: Callable[[int], np.ndarray] = np.random.default_rng(0).permutation
    return [paths[i] for i in sorted(order(len(paths))[:count])]


if __name__ == "__main__":
    main()
