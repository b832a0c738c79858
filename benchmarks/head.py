"""Methods of the head on recordings that they did not learn from: distance, correlation, and how like a person they move.

python benchmarks/head.py CORPUS [--parts 5] [--folds 5] [--limit 60] [--methods sway,hmm] [--model head.safetensors]

Every recording is left out once, a fifth at a time. `recorded elsewhere` is the head of another recording, which knows nothing
of this sound: its distances of distributions are what chance leaves of a person, its distance what posture and moment make.
--parts cuts recordings into parts of so many seconds, each of which counts as one. --model adds a row for a trained model of a
head: the packaged `head`, or one that `train/packaged_head.py` learned from other people.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.record import Record
from facesynth.evaluation.head import head_cca, head_distance
from facesynth.evaluation.head_statistics import distances, take_apart
from facesynth.inference.head.keys import HeadKeys
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.learn.heads import mean_head, poses_of, with_head
from facesynth.methods.registry import create
from facesynth.motion.resample import resample
from facesynth.zoo.shelf import load

CONFIGS = Path(__file__).parents[1] / "configs"
LAYOUT = Layout("curves", ("still",))
COLUMNS = (
    "head",
    "CCA",
    "off, °",
    "off about own mean, °",
    "speed in speech",
    "in pauses",
    "range",
    "spectrum",
    "pause ratio",
    "s/s",
)
Maker = Callable[[Utterance], NDArray]
"""From an utterance to poses [T, 6]."""
Learner = Callable[[Corpus, list[Utterance]], Maker]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--parts", type=float)
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--limit", type=int, default=60)
    parser.add_argument("--methods", default="")
    parser.add_argument("--model", action="append", default=[], help="a model of a head: its file, or a name")
    options = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        corpus = heads_alone(Corpus.open(options.corpus), Path(folder) / "heads", options.parts, options.limit)
        found = with_head(corpus)
        minutes = sum(len(u.motion) for u in found) / corpus.fps / 60
        print(f"{corpus.performer}: {len(found)} recordings, {minutes:.1f} minutes, {corpus.fps:g} fps, {options.folds} folds\n")
        print(f"| {' | '.join(COLUMNS)} |\n|---|{'---:|' * (len(COLUMNS) - 1)}")
        chosen = [name.strip() for name in options.methods.split(",") if name.strip()]
        for name, learn in (METHODS | {Path(model).stem: trained(model) for model in options.model}).items():
            if not chosen or any(one in name for one in chosen):
                print(row(name, learn, corpus, found, options.folds), flush=True)


def row(name: str, learn: Learner, corpus: Corpus, found: list[Utterance], folds: int) -> str:
    """A line of the table."""
    off, cca, own, made, spent, length = [], [], [], [], 0.0, 0.0
    for k in range(folds):
        test = found[k::folds]
        train = [u for u in found if u.id not in {t.id for t in test}]
        make = learn(corpus.subset([u.id for u in train]), train)
        for utterance in test:
            begun = time.process_time()
            head = make(utterance)
            spent, length = spent + time.process_time() - begun, length + utterance.motion.duration_s
            moved = replace(utterance.motion, head=head[: len(utterance.motion)].astype(np.float32))
            made.append((utterance.id, take_apart(moved, utterance.speech)))
            cca.append(head_cca(moved, utterance.motion))
            off.append(head_distance(moved, utterance.motion))
            own.append(head_distance(about_mean(moved), about_mean(utterance.motion)))
    known = {u.id: take_apart(u.motion, u.speech) for u in found}
    d = distances([sample for _, sample in made], [known[i] for i, _ in made])
    figures = [np.mean(cca), np.mean(off), np.mean(own), *d.values()]
    return f"| {name} | " + " | ".join(f"{value:.2f}" for value in figures) + f" | {spent / length:.3f} |"


def about_mean(motion: Motion) -> Motion:
    head = motion.head - motion.head.mean(axis=0)
    return replace(motion, head=head)


def zoo(method: str, config: str = "", *, keyed: bool = False) -> Learner:
    """A method of the zoo; keyed: with the true first and last pose as key poses."""

    def learn(train: Corpus, _: list[Utterance]) -> Maker:
        model = create(method, **(load_config(CONFIGS / config) if config else {})).fit(train)

        def make(utterance: Utterance) -> NDArray:
            given = {"head_keys": ends_of(utterance)} if keyed else {}
            return model.synthesize(utterance.speech, seed=seed_of(utterance), **given).head

        return make

    return learn


def trained(name: str) -> Learner:
    """A model that learned from others: its head moves about the mean of the talker's, whose posture it cannot know."""

    def learn(_: Corpus, train: list[Utterance]) -> Maker:
        model, rest = load(name), mean_head(train)

        def make(utterance: Utterance) -> NDArray:
            there = resample(model.synthesize(utterance.speech, seed=seed_of(utterance)), utterance.motion.fps).head
            at = np.minimum(np.arange(len(utterance.motion)), len(there) - 1)
            return there[at] + rest

        return make

    return learn


def ends_of(utterance: Utterance) -> HeadKeys:
    truth = poses_of(utterance)
    return HeadKeys(np.array([0.0, (len(truth) - 1) / utterance.motion.fps]), truth[[0, -1]])


def still(_: Corpus, train: list[Utterance]) -> Maker:
    rest = mean_head(train)
    return lambda u: np.tile(rest, (len(u.motion), 1)) + 1e-9 * np.random.default_rng(0).standard_normal((len(u.motion), 6))


def elsewhere(_: Corpus, train: list[Utterance]) -> Maker:
    def make(u: Utterance) -> NDArray:
        other = poses_of(train[seed_of(u) % len(train)])
        return other[np.minimum(np.arange(len(u.motion)), len(other) - 1)]

    return make


def seed_of(u: Utterance) -> int:
    return sum(map(ord, u.id))


METHODS: dict[str, Learner] = {
    "recorded elsewhere": elsewhere,
    "still": still,
    "ridge from prosody": zoo("head_ridge"),
    "sway": zoo("head_sway"),
    "knn": zoo("head_knn", "head_knn.yaml"),
    "knn, dissertation's weights": zoo("head_knn", "head_knn_paper.yaml"),
    "knn with key poses": zoo("head_knn", "head_knn.yaml", keyed=True),
    "hmm": zoo("head_hmm", "head_hmm.yaml"),
    "hmm, postures as recorded": zoo("head_hmm", "head_hmm_paper.yaml"),
}


def heads_alone(corpus: Corpus, path: Path, seconds: float | None, limit: int) -> Corpus:
    """The recordings that have a head all along, or parts of them, without the face: it is not looked at here."""
    alone = Corpus.create(
        path, performer=corpus.performer, layout=LAYOUT, fps=corpus.fps, emotions=corpus.emotions, synthetic=corpus.synthetic
    )
    chosen = [u for u in corpus if u.motion.head is not None and np.isfinite(u.motion.head).all()]
    for utterance in chosen[:: max(1, len(chosen) // limit)][:limit]:
        for number, (speech, motion) in enumerate(parts(utterance, seconds)):
            emotion = utterance.speech.emotions.labels[0]
            name = f"{utterance.id}_{number}"
            alone.add_utterance(Record(name, "", name, emotion), speech, motion)
    return alone


def parts(utterance: Utterance, seconds: float | None) -> Iterator[tuple[Speech, Motion]]:
    motion, speech = utterance.motion, utterance.speech
    length = round((seconds or motion.duration_s) * motion.fps)
    for a in range(0, len(motion) - length + 1, length):
        head = motion.head[a : a + length]
        ends = np.round(np.array([a, a + length]) / motion.fps * speech.sample_rate).astype(int)
        sound = speech.audio[ends[0] : ends[1]]
        lasts = length / motion.fps
        sound = np.pad(sound, (0, max(0, ends[1] - ends[0] - len(sound))))
        emotion = EmotionTrack.constant(speech.emotions.labels[0], lasts)
        said = Speech(sound, speech.sample_rate, PhoneTrack(("pau",), np.array([lasts])), emotion)
        yield said, Motion(np.zeros((length, 1), np.float32), motion.fps, LAYOUT, head)


if __name__ == "__main__":
    main()
