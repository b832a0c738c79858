"""Train the head that comes with the package, on recordings of several people.

python train/packaged_head.py CORPUS... [-o head.safetensors]

Heads are brought to one rate, each recording to its own mean posture, and each person's turns to the spread of all: people differ
more in how far they turn than in how. Long recordings are cut into parts.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.record import Record
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.head_hmm.method import HeadHmmMethod
from facesynth.methods.learn.heads import poses_of
from facesynth.methods.training import train
from facesynth.motion.resample import resample

CONFIG = Path(__file__).parents[1] / "configs" / "head_hmm.yaml"
FPS, PART_S = 30.0, 5.0
LAYOUT = Layout("curves", ("still",))


def main(arguments: list[str] | None = None) -> None:
    options = parse(arguments)
    with tempfile.TemporaryDirectory() as folder:
        # Everybody's heads, in one corpus.
        people = [Corpus.open(path) for path in options.corpora]
        name = ", ".join(person.performer for person in people)
        together = Corpus.create(Path(folder) / "heads", performer=name, layout=LAYOUT, fps=FPS, emotions=("neutral",))
        spreads = [spread_of(person) for person in people]
        usual = float(np.exp(np.mean(np.log(spreads))))
        for number, (person, spread) in enumerate(zip(people, spreads, strict=True)):
            print(f"{person.performer}: turns by {np.degrees(spread):.1f} degrees, taken {usual / spread:.2f} times as far")
            for utterance in [person[i] for i in person.ids]:
                add_parts(together, f"{number}_{utterance.id}", utterance, usual / spread)

        # One model.
        model = train(HeadHmmMethod, together, load_config(CONFIG), device=options.device)
        model.provenance = {"sources": [person.provenance() for person in people]}
        model.save(options.output)
    print(f"{options.output}: {model.facts['recordings']} parts learned from, {options.output.stat().st_size / 1e3:.0f} kB")


def spread_of(person: Corpus) -> float:
    """How far a person's head turns about the mean posture of each recording, rad (standard deviation)."""
    turns = [poses_of(u)[:, :3] for u in (person[i] for i in person.ids) if u.motion.head is not None]
    away = [one - one.mean(axis=0) for one in turns if np.isfinite(one).all()]
    return float(np.sqrt(np.mean(np.square(np.concatenate(away)).sum(axis=1))))


def add_parts(corpus: Corpus, name: str, utterance: Utterance, gain: float) -> None:
    """A recording in parts, about its own mean posture, its turns times a gain."""
    motion, speech = utterance.motion, utterance.speech
    if motion.head is None or not np.isfinite(motion.head).all():
        return
    head = gain * (poses_of(utterance) - poses_of(utterance).mean(axis=0))
    alone = resample(Motion(np.zeros((len(motion), 1), np.float32), motion.fps, LAYOUT, head.astype(np.float32)), FPS)
    count = max(1, round(alone.duration_s / PART_S))
    for number, frames in enumerate(np.array_split(np.arange(len(alone)), count)):
        start_s, stop_s = frames[0] / FPS, (frames[-1] + 1) / FPS
        sound = speech.audio[round(start_s * speech.sample_rate) : round(stop_s * speech.sample_rate)]
        lasts = len(frames) / FPS
        said = Speech(sound, speech.sample_rate, PhoneTrack(("pau",), np.array([lasts])), EmotionTrack.constant("neutral", lasts))
        assert alone.head is not None  # noqa: S101 - it was given one
        part = replace(alone, frames=alone.frames[frames], head=alone.head[frames])
        corpus.add_utterance(Record(f"{name}_{number}", "", f"{name}_{number}", "neutral"), said, part)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpora", type=Path, nargs="+", metavar="CORPUS")
    parser.add_argument("-o", "--output", type=Path, default=Path("head.safetensors"))
    parser.add_argument("--device", help="auto, cpu, cuda or mps; as the settings say otherwise")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
