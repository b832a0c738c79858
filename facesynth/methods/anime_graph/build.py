"""From a corpus to an anime graph."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Utterance, node_name
from facesynth.inference.anime_graph.graph import Graph
from facesynth.inference.anime_graph.hearing import ranges, require_sound
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONE_INDEX
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.features import AudioFeatures

_ROWS = tuple(f.name for f in fields(Graph) if f.name not in {"frames", "features", "after"})


@dataclass
class GraphBuilder:
    """Add utterances, then build: a node for each phone, silences included.

    A phone whose motion has missing samples, and a node that a person removed, is left out and breaks its
    utterance into two runs.
    """

    components: FaceComponents
    audio: AudioFeatures
    emotions: Sequence[str]
    removed: Collection[str] = ()
    _frames: list[NDArray[np.float64]] = field(default_factory=list)
    _features: list[NDArray[np.float64]] = field(default_factory=list)
    _rows: list[dict[str, int]] = field(default_factory=list)
    _utterances: int = 0

    def add(self, utterance: Utterance) -> None:
        """The nodes of one utterance."""
        speech, frames = utterance.speech, utterance.motion.frames
        require_sound(speech.audio, f"utterance {utterance.id}")
        features = self.audio.of(speech)
        moved = _at_least_one(speech.phones.frame_bounds(utterance.motion.fps), len(frames))
        heard = ranges(speech.phones, self.audio.fps, len(features))
        feelings = [self.emotions.index(e) for e in speech.emotions.per_phone(speech.phones)[0]]
        complete = np.array(np.isfinite(frames).all(axis=1))
        components = self.components.encode_array(np.where(complete[:, None], frames, 0))
        names = [node_name(utterance.id, n) for n in range(len(speech.phones))]
        usable = [bool(complete[a:b].all()) and name not in self.removed for name, (a, b) in zip(names, moved, strict=True)]
        for run in _runs(usable):
            labels = [PHONE_INDEX[speech.phones.labels[n]] for n in run]
            self._add_run(run, labels, [feelings[n] for n in run], moved[run], heard[run])
            self._frames.append(components[moved[run[0], 0] : moved[run[-1], 1]])
            self._features.append(features[heard[run[0], 0] : heard[run[-1], 1]])
        self._utterances += 1

    def _add_run(
        self, run: list[int], phones: list[int], feelings: list[int], moved: NDArray[np.int64], heard: NDArray[np.int64]
    ) -> None:
        moved = moved - moved[0, 0] + sum(map(len, self._frames))
        heard = heard - heard[0, 0] + sum(map(len, self._features))
        for k, number in enumerate(run):
            self._rows.append(
                {
                    "phones": phones[k],
                    "emotions": feelings[k],
                    "starts": int(moved[k, 0]),
                    "stops": int(moved[k, 1]),
                    "feature_starts": int(heard[k, 0]),
                    "feature_stops": int(heard[k, 1]),
                    "run_starts": int(moved[0, 0]),
                    "run_stops": int(moved[-1, 1]),
                    "before": len(self._rows) - 1 if k else -1,
                    "utterances": self._utterances,
                    "numbers": number,
                }
            )

    def build(self) -> Graph:
        """The graph of all utterances added."""
        if not self._rows:
            raise FacesynthError("no phone of this corpus has complete motion and sound; look at `facesynth corpus check`")
        columns = {name: np.array([row[name] for row in self._rows], np.int64) for name in _ROWS}
        after = np.full(len(self._rows), -1, np.int64)
        linked = np.flatnonzero(columns["before"] >= 0)
        after[columns["before"][linked]] = linked
        return Graph(np.concatenate(self._frames), np.concatenate(self._features), after=after, **columns)


def tensors_of(graph: Graph) -> dict[str, torch.Tensor]:
    """The arrays by name, to be stored; frames and features in single precision. `Graph.of` is the inverse."""
    arrays = {f.name: getattr(graph, f.name) for f in fields(graph)}
    kinds = {name: np.float32 if array.dtype == np.float64 else np.int32 for name, array in arrays.items()}
    return {name: torch.from_numpy(np.ascontiguousarray(array, kinds[name])) for name, array in arrays.items()}


def _at_least_one(bounds: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """[P, 2] first frame and one past the last of each phone; one too short for a frame takes the nearest one."""
    starts = np.minimum(bounds[:-1], count - 1)
    return np.stack([starts, np.maximum(np.minimum(bounds[1:], count), starts + 1)], axis=1)


def _runs(usable: Sequence[bool]) -> list[list[int]]:
    """Indices of the stretches without an unusable phone."""
    runs: list[list[int]] = [[]]
    for n, good in enumerate(usable):
        if good:
            runs[-1].append(n)
        elif runs[-1]:
            runs.append([])
    return [run for run in runs if run]
