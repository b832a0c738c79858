"""What the lag of spikes and the thresholds of texts and fits rest on: measured again on recordings.

python benchmarks/phone_thresholds.py RECORDINGS [--clips 40]

RECORDINGS holds any of `grid_s1`, `ravdess_speech` (words known) and `facegood` (Mandarin). Four tables:

- lag: how much later than the middle of a phone, as the words are aligned by pocketsphinx, the network's spike of the same phone
  comes;
- fits: within which distance of their spikes 80 % of the phones lie that a fit by pocketsphinx's English model places, by piece
  of the sound: `recognition.FURTHEST_S` parts those that are believed;
- texts: fit of a clip with its own words, with another sentence's, and with a sentence of another language, and by how much each
  exceeds the same phones in random order: `text_alignment.WORST_FIT` and `BEYOND_CHANCE` part what is refused;
- words: shares of a clip's own words, and of words of other sentences put in place of one, that are told as doubtful.
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from alignment import STATEMENTS
from languages import SENTENCES
from phones import SETS, Clip, evenly

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.spikes import LAG_S
from facesynth.speech import recognition
from facesynth.speech.alignment import words_of
from facesynth.speech.audio import load_audio
from facesynth.speech.languages import pronounced
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.phone_matching import match
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.segments import segments_of
from facesynth.speech.text_alignment import (
    BEYOND_CHANCE,
    DOUBTFUL,
    SHORTEST_WORD,
    WORST_FIT,
    Word,
    belongs,
    doubtful,
    fit_by_chance,
    fit_of,
    heard_classes,
    told,
)

ENGLISH = ("grid_s1", "ravdess_speech")
MANDARIN = "facegood"
SHARES = (0, 10, 50, 90, 100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--clips", type=int, default=40, help="of each set, taken evenly")
    options = parser.parse_args()
    torch.set_num_threads(1)
    clips = {name: list(SETS[name](options.folder / name, options.clips)) for name in ENGLISH}
    print_lag(clips)
    print_fits(clips, sorted((options.folder / MANDARIN).glob("*.wav")))
    texts = {name: sentences(options.folder / name, options.clips) for name in ENGLISH}
    print_texts(clips, texts)


def print_lag(clips: dict[str, list[Clip]]) -> None:
    """Spike after the middle of the phone, by set and together."""
    print(f"\nlag of spikes, ms (taken off: {1000 * LAG_S:.0f})\n| | phones | 25 % | median | 75 % |\n|---|---:|---:|---:|---:|")
    lags = {name: np.concatenate([lags_of(clip) for clip in some]) for name, some in clips.items()}
    for name, found in {**lags, "together": np.concatenate([*lags.values()])}.items():
        cells = " | ".join(f"{1000 * value:.0f}" for value in np.percentile(found, (25, 50, 75)))
        print(f"| {name} | {len(found)} | {cells} |", flush=True)


def lags_of(clip: Clip) -> np.ndarray:
    """[n] seconds, of the phones that the network hears as they are said."""
    said = [segment for segment in segments_of(clip.truth) if segment[0] != SILENCE]
    spikes = phone_hearing().spikes(clip.audio, clip.rate)
    partners = match([label for label, _, _ in said], [spike.phone for spike in spikes]).partners
    both = [(segment, spikes[k]) for segment, k in zip(said, partners.tolist(), strict=True) if k >= 0]
    return np.array(
        [
            (spike.first_s + spike.last_s) / 2 + LAG_S - (start_s + end_s) / 2
            for (label, start_s, end_s), spike in both
            if label == spike.phone
        ]
    )


def print_fits(clips: dict[str, list[Clip]], mandarin: Sequence[Path]) -> None:
    """Quantiles over pieces of how near fitted phones stay to their spikes."""
    sounds = {name: [(clip.audio, clip.rate) for clip in some] for name, some in clips.items()}
    sounds[MANDARIN] = [load_audio(path) for path in mandarin]
    print(f"\n{recognition.NEARER} % of fitted phones lie within, ms (believed up to {1000 * recognition.FURTHEST_S:.0f})")
    heads = " | ".join(f"{share} % of pieces" for share in SHARES)
    print(f"| | pieces | {heads} | believed |\n|---|---:|" + "---:|" * (len(SHARES) + 1))
    for name, some in sounds.items():
        apart = np.array([one for audio, rate in some for one in fits_of(audio, rate)])
        if not len(apart):
            continue
        cells = " | ".join(f"{1000 * value:.0f}" for value in np.percentile(apart, SHARES))
        print(f"| {name} | {len(apart)} | {cells} | {(apart <= recognition.FURTHEST_S).sum()} |", flush=True)


def fits_of(audio: np.ndarray, rate: int) -> list[float]:
    """Of each piece of a sound the distance (s) that NEARER % of the fitted phones keep to; of those that can be fitted."""
    apart: list[float] = []

    def percentile(distances: np.ndarray, share: float) -> float:
        apart.append(float(np.percentile(distances, share)))
        return apart[-1]

    class Listening:
        """numpy as `recognition` sees it, with what it asks the percentile of."""

        def __getattr__(self, name: str) -> object:
            return percentile if name == "percentile" else getattr(np, name)

    try:
        spikes = recognition.speech_in(audio, rate)[0]
    except FacesynthError:
        return []
    with patch.object(recognition, "np", Listening()):
        recognition.placed(audio, rate, spikes)
    return apart


def sentences(folder: Path, count: int) -> list[str]:
    """What is said in each clip, in the order of `phones.SETS`."""
    if folder.name == "grid_s1":
        films = evenly(sorted(folder.glob("*.mpg")), count)
        lines = [[line.split()[2] for line in film.with_suffix(".align").read_text().splitlines()] for film in films]
        return [" ".join(word for word in words if word not in ("sil", "sp")) for words in lines]
    return [STATEMENTS[path.stem.split("-")[4]] for path in evenly(sorted(folder.rglob("*.flac")), count)]


def print_texts(clips: dict[str, list[Clip]], texts: dict[str, list[str]]) -> None:
    """How texts fit that belong, that do not, and that are in another language; and which words are doubted."""
    pairs = [
        (clip, text)
        for name in ENGLISH
        if len(clips[name]) == len(texts[name])
        for clip, text in zip(clips[name], texts[name], strict=True)
    ]
    others = [next(text for _, text in pairs[k + 1 :] + pairs[: k + 1] if text != own) for k, (_, own) in enumerate(pairs)]
    foreign = [*foreign_words()]
    classes = [heard_classes(clip.audio, clip.rate) for clip, _ in pairs]
    rows = {
        "its own words": [(c, english(text)) for c, (_, text) in zip(classes, pairs, strict=True)],
        "another sentence's": [(c, english(text)) for c, text in zip(classes, others, strict=True)],
        "in another language": [(c, foreign[k % len(foreign)]) for k, c in enumerate(classes)],
    }
    print(f"\nfit (refused under {WORST_FIT}) and by how much it is beyond chance (refused under {BEYOND_CHANCE})")
    print("| text | clips | fit: least | median | greatest | beyond chance: least | median | greatest | accepted |")
    print("|---|" + "---:|" * 8)
    for name, row in rows.items():
        found = [(c, told(c, [phones for _, phones in words])) for c, words in row]
        laid = [(c, spikes) for c, spikes in found if spikes is not None]
        fits = np.array([fit_of(spikes) for _, spikes in laid])
        beyond = fits - [fit_by_chance(c, spikes) for c, spikes in laid]
        cells = " | ".join(f"{value:.2f}" for values in (fits, beyond) for value in np.percentile(values, (0, 50, 100)))
        accepted = sum(belongs(c, spikes) for c, spikes in laid)
        print(f"| {name} | {len(laid)} | {cells} | {accepted} of {len(row)} |", flush=True)
    own, put = doubts_of(rows["its own words"])
    print(f"\nwords of {SHORTEST_WORD} phones and more doubted (fit under {DOUBTFUL})")
    print(f"| | words | doubted |\n|---|---:|---:|\n| its own | {len(own)} | {np.mean(own):.3f} |")
    print(f"| put in place of one | {len(put)} | {np.mean(put):.3f} |", flush=True)


def english(text: str) -> tuple[Word, ...]:
    return tuple((word, pronounce(word)) for word in words_of(text))


def foreign_words() -> Iterator[tuple[Word, ...]]:
    """Sentences of other languages, of those whose pronunciation is installed."""
    for language, text in SENTENCES.items():
        try:
            yield pronounced(text, language)
        except FacesynthError:
            continue


def doubts_of(rows: Iterable[tuple[np.ndarray, Sequence[Word]]]) -> tuple[list[bool], list[bool]]:
    """Whether each long word of the texts is doubted, and whether one is that stands in the place of another."""
    rows = list(rows)
    every = sorted({word for _, words in rows for word in words if len(word[1]) >= SHORTEST_WORD})
    rng, own, put = np.random.default_rng(0), [], []
    for classes, words in rows:
        own += [doubted for _, doubted in judged(classes, words)]
        long = [number for number, (_, phones) in enumerate(words) if len(phones) >= SHORTEST_WORD]
        if long:
            place = int(rng.choice(long))
            another = every[int(rng.choice([k for k, word in enumerate(every) if word not in words]))]
            put += [doubted for n, doubted in judged(classes, [*words[:place], another, *words[place + 1 :]]) if n == place]
    return own, put


def judged(classes: np.ndarray, words: Sequence[Word]) -> Iterator[tuple[int, bool]]:
    """Number of each long word, and whether it is doubted."""
    spikes = told(classes, [phones for _, phones in words])
    if spikes is not None:
        doubted = set(doubtful(spikes, words))
        yield from ((n, n in doubted) for n, (_, phones) in enumerate(words) if len(phones) >= SHORTEST_WORD)


if __name__ == "__main__":
    main()
