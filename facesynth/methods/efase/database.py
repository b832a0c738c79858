"""From recordings to motion nodes (Deng 2008, §4)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from facesynth.corpus import Corpus, Utterance, node_name
from facesynth.inference.arrays import Floats
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES, SILENCE, viseme_of
from facesynth.motion.pca import Pca
from facesynth.motion.resample import resample
from facesynth.progress import track


@dataclass(frozen=True, eq=False)
class Database:
    """What eFASE learns."""

    pca: Pca
    nodes: Nodes
    names: tuple[str, ...]
    """[N] `utterance_id:phone_number`."""
    rest: Floats
    """[E, D] mean pose of silence in each emotion."""
    unusable: int
    """Phones that are no nodes because of missing markers, no frames, or a removal."""
    barren: tuple[str, ...]
    """Utterances of which nothing could be used."""


def build_database(corpus: Corpus, fps: float, components: float) -> Database:
    """Every phone except silence is a node; silence, gaps and removed nodes break a sentence in two."""
    if len(corpus) < 2:
        raise FacesynthError(f"eFASE needs at least 2 usable utterances to choose from; this corpus has {len(corpus)}")
    recorded = [(u, resample(u.motion, fps)) for u in track(corpus, "reading", len(corpus))]
    frames = np.concatenate([motion.frames for _, motion in recorded])
    pca = Pca.fit(frames[np.isfinite(frames).all(axis=1)], components)
    collector = _Collector(corpus, pca, fps)
    for utterance, motion in recorded:
        collector.add(utterance, motion)
    collector.add_drawn()
    return collector.database()


class _Collector:
    """Grows lists of nodes, one utterance after the other."""

    def __init__(self, corpus: Corpus, pca: Pca, fps: float) -> None:
        self.corpus, self.pca, self.fps = corpus, pca, fps
        self.removed = corpus.removed_nodes()
        self.pieces: list[Floats] = []
        self.phones: list[str] = []
        self.emotions: list[str] = []
        self.names: list[str] = []
        self.before: list[int] = []
        self.silence: dict[str, list[Floats]] = {emotion: [] for emotion in corpus.emotions}
        self.unusable = 0
        self.barren: list[str] = []

    def add(self, utterance: Utterance, motion: Motion) -> None:
        """All phones of one utterance."""
        speech = utterance.speech
        emotions, _ = speech.emotions.per_phone(speech.phones)
        previous, before = -1, len(self.pieces)
        for number, (phone, emotion, piece) in enumerate(self._cut(utterance, motion, emotions)):
            complete = len(piece) > 0 and bool(np.isfinite(piece).all())
            name = node_name(utterance.id, number)
            if phone == SILENCE:
                self.silence[emotion] += [piece] if complete else []
            elif complete and name not in self.removed:
                self._append(piece, phone, emotion, name, previous)
                previous = len(self.pieces) - 1
                continue
            else:
                self.unusable += 1
            previous = -1
        if len(self.pieces) == before:
            self.barren.append(utterance.id)

    def add_drawn(self) -> None:
        """Nodes that a person drew; they have no neighbours."""
        for node in self.corpus.added_nodes():
            drawn = Motion(node.frames, self.corpus.fps, self.corpus.layout)
            if node.name not in self.removed:
                self._append(self._encode(resample(drawn, self.fps)), node.phone, node.emotion, node.name, -1)

    def database(self) -> Database:
        """Everything, as arrays."""
        if not self.pieces:
            raise FacesynthError("no phone of this corpus has complete motion; run `facesynth corpus check` on it")
        index = {emotion: i for i, emotion in enumerate(self.corpus.emotions)}
        nodes = Nodes.from_pieces(
            self.pieces,
            np.array([PHONES.index(p) for p in self.phones]),
            np.array([viseme_of(p) for p in self.phones]),
            np.array([index[e] for e in self.emotions]),
            np.array(self.before),
        )
        return Database(self.pca, nodes, tuple(self.names), self._rest(nodes), self.unusable, tuple(self.barren))

    def _cut(self, utterance: Utterance, motion: Motion, emotions: tuple[str, ...]) -> Iterator[tuple[str, str, Floats]]:
        coordinates = self._encode(motion)
        phones = utterance.speech.phones
        bounds = phones.frame_bounds(self.fps)
        for phone, emotion, start, stop in zip(phones.labels, emotions, bounds[:-1], bounds[1:], strict=True):
            yield phone, emotion, coordinates[start:stop]

    def _encode(self, motion: Motion) -> Floats:
        return self.pca.encode(torch.from_numpy(motion.frames)).numpy().astype(np.float64)

    def _append(self, piece: Floats, phone: str, emotion: str, name: str, before: int) -> None:
        self.pieces.append(piece)
        self.phones.append(phone)
        self.emotions.append(emotion)
        self.names.append(name)
        self.before.append(before)

    def _rest(self, nodes: Nodes) -> Floats:
        """Mean pose of silence; an emotion without any rests as all of them do, or as the mean frame."""
        everything = [piece for pieces in self.silence.values() for piece in pieces]
        fallback = np.concatenate(everything).mean(axis=0) if everything else nodes.frames.mean(axis=0)
        return np.stack([np.concatenate(p).mean(axis=0) if p else fallback for p in self.silence.values()])
