"""A corpus as articulography records one, made of another: five points of lips and jaw, 100 Hz, noise, hasty phone times.

    python benchmarks/few_sensors.py CORPUS -o FEW_SENSORS --limit 120

It stands in `facesynth tune` for what has neither a whole face nor phones that a person corrected. The points are those where
such sensors are glued; the noise is that of a good device, the times of phones are off as a forced alignment's are.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.resample import resample
from facesynth.progress import track

FPS = 100.0
NOISE_MM, JITTER_S, SHORTEST_S = 0.3, 0.015, 0.02
SENSORS = ("upper_lip", "lower_lip", "mouth_corner_r", "mouth_corner_l", "chin")


def main() -> None:
    """Read the corpus, write the other one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--limit", type=int, default=120, help="utterances, evenly chosen")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    corpus, rng = Corpus.open(asked.corpus), np.random.default_rng(asked.seed)
    about = {name: getattr(corpus.header, name) for name in ("synthetic", "licence", "consent", "emotions")}
    notes = f"five points of {corpus.performer}, with noise and hasty phone times, as articulography records"
    made = Corpus.create(
        asked.output, performer=f"{corpus.performer} by sensors", layout=Layout("markers", SENSORS), fps=FPS, notes=notes, **about
    )
    count = min(asked.limit, len(corpus))
    for number in track(range(count), "utterances", count):
        utterance = corpus[corpus.ids[number * len(corpus) // count]]
        speech = replace(utterance.speech, phones=hasty(utterance.speech.phones, rng))
        made.add_utterance(corpus.record(utterance.id), speech, by_sensors(utterance, rng), aligned=True)


def by_sensors(utterance: Utterance, rng: np.random.Generator) -> Motion:
    """The sensors' motion of an utterance; gaps stay gaps."""
    points = [utterance.motion.layout.names.index(name) for name in SENSORS]
    channels = np.concatenate([np.arange(3 * point, 3 * point + 3) for point in points])
    frames = utterance.motion.frames[:, channels]
    motion = resample(Motion(frames, utterance.motion.fps, Layout("markers", SENSORS)), FPS)
    noise = rng.normal(0, NOISE_MM / np.sqrt(3), motion.frames.shape)
    return replace(motion, frames=(motion.frames + noise).astype(np.float32))


def hasty(phones: PhoneTrack, rng: np.random.Generator) -> PhoneTrack:
    """The same phones, their inner ends moved at random, none made shorter than it may be or than it was."""
    lengths = np.diff(phones.ends_s, prepend=0.0)
    room = np.maximum(np.minimum(lengths[:-1], lengths[1:]) - SHORTEST_S, 0) / 2
    moved = phones.ends_s.copy()
    moved[:-1] += np.clip(rng.normal(0, JITTER_S, len(moved) - 1), -room, room)
    return replace(phones, ends_s=moved)


if __name__ == "__main__":
    main()
