"""The anime graph as a method of the zoo."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from facesynth.corpus import Corpus
from facesynth.errors import FacesynthError, unknown
from facesynth.methods.anime_graph.build import GraphBuilder
from facesynth.methods.anime_graph.candidates import Chooser
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.features import AudioFeatures, ranges
from facesynth.methods.anime_graph.graph import PHONE_INDEX, Graph
from facesynth.methods.anime_graph.lowpass import cutoffs_hz, low_pass
from facesynth.methods.anime_graph.maps import EmotionMaps
from facesynth.methods.anime_graph.plan import Plan, Wish, blend, explain, make_plan
from facesynth.methods.anime_graph.search import Weights
from facesynth.methods.anime_graph.streaming import Stream
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.motion import Motion
from facesynth.progress import track
from facesynth.speech.phones import PHONES
from facesynth.speech.speech import Speech

MOST_FRAMES = 60_000
"""Of more training frames than this, evenly spaced ones are enough to find the components."""


@register("anime_graph")
class AnimeGraph(Method):
    """Recorded phones, found by sound and joined by example; emotions mapped between recordings (Cao 2005).

    Parameters
    ----------
    variance : float
        Share of the motion's variance that PCA keeps, in lips and in upper face (the paper: 0.95 to 0.98).
    parameters : int
        How many RASTA-PLP parameters the audio cost compares.
    jump_weight, jump_cost_weight, audio_weight : float
        The weights of eq. 2.
    """

    cutoffs_hz: torch.Tensor
    """[D] cut-off frequency of each component's low-pass filter."""

    def __init__(
        self,
        variance: float = 0.95,
        parameters: int = 9,
        jump_weight: float = 100.0,
        jump_cost_weight: float = 1.0,
        audio_weight: float = 0.01,
    ) -> None:
        super().__init__(
            variance=variance,
            parameters=parameters,
            jump_weight=jump_weight,
            jump_cost_weight=jump_cost_weight,
            audio_weight=audio_weight,
        )
        self.weights = Weights(jump_weight, jump_cost_weight, audio_weight)
        self.audio = AudioFeatures(parameters)
        self.components = FaceComponents()
        self.maps = EmotionMaps()
        self.nodes = nn.Module()
        self._chooser: Chooser | None = None

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn components, graph, cut-offs and the maps of every pair of emotions with parallel sentences."""
        self.learned_from(corpus)
        frames = corpus.arrays().frames
        frames = frames[np.isfinite(frames).all(axis=1)]
        if len(frames) < 2:
            raise FacesynthError(f"{corpus.path} has {len(frames)} complete frames of motion; there is nothing to learn from")
        some = frames[:: max(1, len(frames) // MOST_FRAMES)]
        self.components.fit(some, corpus.layout, variance=self.config["variance"], seed=seed)
        builder = GraphBuilder(self.components, self.audio, self.emotions, corpus.removed_nodes())
        for utterance in track(corpus, "anime graph", len(corpus)):
            builder.add(utterance)
        graph = builder.build()
        for name, tensor in graph.tensors().items():
            self.nodes.register_buffer(name, tensor)
        runs = (graph.frames[a:b] for a, b in sorted(set(zip(graph.run_starts, graph.run_stops, strict=True))))
        self.register_buffer("cutoffs_hz", torch.from_numpy(cutoffs_hz(runs, self.fps)))
        self.facts["utterances"] = list(corpus.ids)
        self._chooser = None
        return self

    @property
    def chooser(self) -> Chooser:
        """The graph with its maps, ready for searching."""
        if self._chooser is None:
            self.fitted_layout  # noqa: B018 - raises before `fit`
            self._chooser = Chooser(Graph.from_tensors(dict(self.nodes.named_buffers())), self.maps)
        return self._chooser

    @property
    def graph(self) -> Graph:
        """The anime graph."""
        return self.chooser.graph

    def synthesize(  # type: ignore[override]
        self, speech: Speech, *, seed: int = 0, look_ahead: int | None = None
    ) -> Motion:
        """Motion for new speech. Nothing is random: `seed` changes nothing.

        `look_ahead`: search that many phones ahead, as for streaming, in place of the whole utterance.
        """
        plan = self.plan(speech, look_ahead=look_ahead)
        moved, _ = blend(self.chooser, plan, self.fps)
        return self._motion(low_pass(moved, self.cutoffs_hz.numpy(), self.fps))

    def stream(self, wishes: Iterable[Wish], *, look_ahead: int = 4) -> Iterator[NDArray[np.float32]]:
        """Frames [n, C] while phones arrive; `look_ahead` phones (the paper: 3 to 6) are waited for."""
        stream = Stream(
            self.chooser,
            self.weights,
            metric=self.components.metric.numpy(),
            cutoffs_hz=self.cutoffs_hz.numpy(),
            fps=self.fps,
            look_ahead=look_ahead,
        )
        for wish in wishes:
            yield self.components.decode_array(stream.push(wish)).astype(np.float32)
        yield self.components.decode_array(stream.finish()).astype(np.float32)

    def plan(self, speech: Speech, *, look_ahead: int | None = None) -> Plan:
        """The path through the graph that expresses speech."""
        return make_plan(self.chooser, self.wishes(speech), self.components.metric.numpy(), self.weights, look_ahead)

    def explain(self, speech: Speech) -> list[dict[str, Any]]:
        """Per phone: the chosen node, its cost terms, the runners-up by audio, and what it lacks."""
        return explain(self.chooser, self.plan(speech), self.weights, self.facts["utterances"], self.emotions)

    def wishes(self, speech: Speech) -> list[Wish]:
        """What each phone of the speech asks for."""
        feelings, _ = speech.emotions.per_phone(speech.phones)
        for label, known, what in ((feelings, self.emotions, "emotion"), (speech.phones.labels, PHONES, "phone")):
            for name in label:
                if name not in known:
                    raise unknown(what, name, known)
        features = self.audio.of(speech)
        heard = ranges(speech.phones, self.audio.fps, len(features))
        lengths = np.diff(speech.phones.frame_bounds(self.fps)).tolist()
        return [
            Wish(PHONE_INDEX[label], self.emotions.index(emotion), features[a:b], length)
            for label, emotion, (a, b), length in zip(speech.phones.labels, feelings, heard.tolist(), lengths, strict=True)
        ]

    def _motion(self, components: NDArray[np.float64]) -> Motion:
        return Motion(self.components.decode_array(components).astype(np.float32), self.fps, self.fitted_layout)
