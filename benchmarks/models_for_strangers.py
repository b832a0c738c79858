"""Models by name, driven by a voice that none of them learned from.

python benchmarks/models_for_strangers.py STRANGER/ [MODEL …] [--tracked FOLDER]

STRANGER is a corpus of somebody else, such as GRID s26 from video; MODEL a name or a file, all that `facesynth models` lists
where none is given. Openings of the lips against the stranger's own: mean correlation over the clips with the words known (phones
placed by a transcript) and with nothing known (phones heard in the sound), over whole clips, with the rest before and after, and
from the first to the last phone; then, with the words known and in speech, the share of clips whose openings have 0.85 to 1.15 of
the stranger's standard deviation after one gain for all, and the share of p, b and m at which the lips shut. `loudness` is the
logarithm of the sound's level, smoothed as a jaw moves: what anybody has without a model. FOLDER has the same clips as another
program followed them (`CLIP_mediapipe.npz`, 478 landmarks as shares of a picture of 360 x 288): how far two trackers agree.
"""

import argparse
from collections.abc import Callable
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from shapes_by_hand import lips_of, openings, share_shut

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.lips import closure_rate, lip_opening
from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.filters import gaussian
from facesynth.inference.motion import Motion
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.motion.resample import resample
from facesynth.speech.phone_sources import find_phones
from facesynth.zoo.shelf import entry, load, names

COLUMNS = ("whole clip, words known", "nothing known", "in speech, words known", "nothing known", "as wide", "shut at p, b, m")
ALIKE = 0.15
LEVEL_S = 0.05
"""Standard deviation of the smoothing of the sound's level."""
LIP_PAIRS = ((82, 87), (13, 14), (312, 317))
"""Landmarks of the inner lips, upper and lower, by their numbers in MediaPipe's mesh of a face."""
Opening = Callable[[Speech], tuple[NDArray[np.float64], float]]
"""Of the lips [T], in any unit, and its rate, Hz."""


@dataclass(frozen=True)
class Row:
    """Correlations with the words known and unknown, of whole clips and in speech, and two shares."""

    known_whole: float
    unknown_whole: float
    known: float
    unknown: float
    alike: float
    shut: float

    def __str__(self) -> str:
        return " | ".join(f"{figure:.2f}" for figure in astuple(self))


def main(stranger: Path, models: list[str], tracked: Path | None) -> None:
    corpus = Corpus.open(stranger)
    said = [corpus[name] for name in corpus.ids]
    heard = [replace(u, speech=unknown(u.speech)) for u in said]
    truth = [lips_of(lip_opening(u.motion), u.motion.fps) for u in said]
    share = share_shut(truth, said)
    print(f"{corpus.performer}, {len(said)} clips\n\n| model | {' | '.join(COLUMNS)} |")
    print("|---" + len(COLUMNS) * "|---:" + "|")
    for name in models or [name for name in names() if entry(name).part == "mouth"]:
        print(f"| {name} | {judged(opening_of(name), said, heard, truth, share)} |", flush=True)
    print(f"| loudness | {judged(loudness, said, heard, truth, share)} |")
    if tracked is not None:
        others = [tracked_lips(tracked / f"{u.id}_mediapipe.npz", u) for u in said]
        inside = correlation(cut(others, said), cut(truth, said))
        print(f"| the same lips by another tracker | {correlation(others, truth):.2f} | | {inside:.2f} | | | |")


def unknown(speech: Speech) -> Speech:
    """The same, of which nobody knows the words."""
    found = find_phones(speech.audio, speech.sample_rate)
    return replace(speech, phones=found.phones, emotions=EmotionTrack.constant("neutral", found.phones.duration_s))


def opening_of(name: str) -> Opening:
    model = load(name)
    emotion = "neutral" if "neutral" in model.emotions else model.emotions[0]

    def opening(speech: Speech) -> tuple[NDArray[np.float64], float]:
        motion = model.synthesize(replace(speech, emotions=EmotionTrack.constant(emotion, speech.phones.duration_s)))
        return lip_opening(motion), motion.fps

    return opening


def loudness(speech: Speech) -> tuple[NDArray[np.float64], float]:
    fps = 100.0
    pieces = np.array_split(speech.audio.astype(np.float64), max(1, round(len(speech.audio) / speech.sample_rate * fps)))
    level = np.log10(np.array([np.sqrt(np.mean(piece**2)) for piece in pieces]) + 1e-3)
    return gaussian(level[:, None], LEVEL_S * fps)[:, 0], fps


def tracked_lips(path: Path, utterance: Utterance) -> Motion:
    """The lips of a clip as another program followed them, in heights of the picture, as long as the clip."""
    with np.load(path) as kept:
        height = kept["landmarks"][:, :, 1]
    opening = np.mean([height[:, below] - height[:, above] for above, below in LIP_PAIRS], axis=0)
    at = np.minimum(np.arange(len(utterance.motion)), len(opening) - 1)
    return lips_of(opening[at], utterance.motion.fps)


def judged(opening: Opening, said: list[Utterance], heard: list[Utterance], truth: list[Motion], share: float) -> Row:
    whole, unknown_ = spoken(opening, said), spoken(opening, heard)
    wholes = (correlation(whole, truth), correlation(unknown_, truth))
    narrow, wide = openings(whole)
    shut = [closed(made, u, narrow + share * (wide - narrow)) for made, u in zip(whole, said, strict=True)]
    known, truth = cut(whole, said), cut(truth, said)
    ours, theirs = (np.concatenate([lip_opening(m) - lip_opening(m).mean() for m in set_]) for set_ in (known, truth))
    each = np.array([lip_opening(m).std() / lip_opening(t).std() for m, t in zip(known, truth, strict=True)])
    alike = np.abs(each * theirs.std() / ours.std() - 1) <= ALIKE
    inside = (correlation(known, truth), correlation(cut(unknown_, said), truth))
    return Row(*wholes, *inside, float(alike.mean()), float(np.nanmean(shut)))


def spoken(opening: Opening, said: list[Utterance]) -> list[Motion]:
    """Lips at the clips' rate and length."""
    made = []
    for utterance in said:
        there = resample(lips_of(*opening(utterance.speech)), utterance.motion.fps)
        at = np.minimum(np.arange(len(utterance.motion)), len(there) - 1)
        made.append(replace(there, frames=there.frames[at]))
    return made


def cut(motions: list[Motion], said: list[Utterance]) -> list[Motion]:
    return [during_speech(motion, utterance) for motion, utterance in zip(motions, said, strict=True)]


def during_speech(motion: Motion, utterance: Utterance) -> Motion:
    """From the first to the last phone: before and after, people do with their mouths what they like."""
    phones, bounds = utterance.speech.phones, utterance.speech.phones.frame_bounds(motion.fps)
    spoken_ = [k for k, label in enumerate(phones.labels) if label != SILENCE]
    return replace(motion, frames=motion.frames[bounds[spoken_[0]] : bounds[spoken_[-1] + 1]])


def correlation(made: list[Motion], truth: list[Motion]) -> float:
    pairs = [(lip_opening(m), lip_opening(t)) for m, t in zip(made, truth, strict=True)]
    return float(np.mean([np.corrcoef(ours, theirs)[0, 1] if ours.std() > 0 else 0.0 for ours, theirs in pairs]))


def closed(made: Motion, utterance: Utterance, below: float) -> float:
    try:
        return closure_rate(made, utterance.speech.phones, below)
    except UnavailableError:
        return np.nan


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stranger", type=Path)
    parser.add_argument("models", nargs="*")
    parser.add_argument("--tracked", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    main(options.stranger, options.models, options.tracked)
