"""The anime graph as a method of the zoo."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import permutations
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits
from torch import nn

from facesynth.corpus import Corpus
from facesynth.inference.anime_graph.candidates import Chooser, Maps
from facesynth.inference.anime_graph.emotions import EmotionMapper
from facesynth.inference.anime_graph.graph import Graph
from facesynth.inference.anime_graph.lowpass import LowPass
from facesynth.inference.anime_graph.model import AnimeGraph as Runtime
from facesynth.inference.anime_graph.plan import Plan, Wish
from facesynth.inference.anime_graph.search import NUMPY, Weights
from facesynth.inference.anime_graph.stream import WishStream
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.errors import FacesynthError
from facesynth.inference.last_search import LastSearch
from facesynth.inference.lips import bilabial_spans, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.anime_graph.build import GraphBuilder, tensors_of
from facesynth.methods.anime_graph.capabilities import CAPABILITIES
from facesynth.methods.anime_graph.components import BLOCKS, FaceComponents
from facesynth.methods.anime_graph.features import AudioFeatures
from facesynth.methods.anime_graph.learning import learn
from facesynth.methods.anime_graph.lowpass import cutoffs_hz
from facesynth.methods.anime_graph.mapping import (
    EmotionMap,
    MapSettings,
    Width,
    fit_emotion_map,
    matched,
    require_pairs,
)
from facesynth.methods.anime_graph.maps import EmotionMaps, FittedMap
from facesynth.methods.anime_graph.parallel import Take, emotion_pairs, take_of
from facesynth.methods.anime_graph.split import NOTHING_SPLIT, Split, split_components
from facesynth.methods.anime_graph.torch_search import torch_search
from facesynth.methods.capabilities import Account
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.hearing import Features
from facesynth.methods.learn.spreading import in_pieces
from facesynth.methods.method import Method, Prepared
from facesynth.methods.registry import register
from facesynth.motion.rbf import Kernel
from facesynth.progress import track


@register(CAPABILITIES)
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
    map_width, map_kernel, map_centres :
        Of the emotion maps: `closest` (the paper), `median` or `cross-validated` width, `gaussian` or `exponential`
        kernel, number of K-means centres.
    emotional_components : list of int, optional
        Which components the maps change, in place of the automatic split.
    temperature : float
        0 is the cheapest path (the paper); above, the mean over all paths, the cheaper the more, in the unit of eq. 2.
    pose_weight : float
        Of a node's squared distance (mean over channels, mm²) from the pose that sound and phones lead one to expect.
    sharpening : float
        How much quick movement is raised (see `facesynth.inference.filters.sharpen`); a mean moves too little.
    learn : bool
        Before `fit`, weights above 0, and the sharpening, are learned from where they are, on sentences that are kept out
        of the graph meanwhile (`prepared`).
    help_pairs : bool
        Whether a recorded pair of the two phones helps to bridge a jump; without, every jump is a cross-fade.
    features : str
        What poses are expected from: `log_mel`, `phone_net` or `both`.
    voices : int
        From how many changed sounds of each recording poses are learned as well; see `PosePredictor`.
    """

    cutoffs_hz: torch.Tensor
    """[D] cut-off frequency of each component's low-pass filter."""

    def __init__(
        self,
        variance: float = 0.98,
        parameters: int = 9,
        jump_weight: float = 100.0,
        jump_cost_weight: float = 1.0,
        audio_weight: float = 0.01,
        map_width: Width = "cross-validated",
        map_kernel: Kernel = "exponential",
        map_centres: int = 250,
        emotional_components: Sequence[int] | None = None,
        help_pairs: bool = True,
        temperature: float = 0.0,
        pose_weight: float = 0.0,
        sharpening: float = 0.0,
        learn: bool = False,
        features: Features = "log_mel",
        voices: int = 0,
    ) -> None:
        super().__init__()
        for name, value in (("temperature", temperature), ("pose_weight", pose_weight), ("sharpening", sharpening)):
            if not 0 <= value < float("inf"):
                raise FacesynthError(f"{name} must be 0 (as in the paper) or above; got {value}")
        self.audio = AudioFeatures(parameters)
        self.components = FaceComponents()
        self.maps = EmotionMaps()
        self.predictor = PosePredictor(features, voices=voices) if pose_weight > 0 else None
        self.map_settings = MapSettings(map_width, map_kernel, map_centres)
        self.nodes = nn.Module()
        self._chooser: Chooser | None = None
        self._last: LastSearch[dict[str, Any]] = LastSearch()

    @property
    def weights(self) -> Weights:
        """Of the cost."""
        return Weights(*(self.config[name] for name in ("jump_weight", "jump_cost_weight", "audio_weight", "pose_weight")))

    @classmethod
    def prepared(cls, config: Mapping[str, Any], corpus: Corpus, seed: int) -> Prepared:
        """With `learn`, weights and sharpening learned on sentences that a graph of the others does not have."""
        if not config["learn"]:
            return Prepared(config)
        learned = learn(corpus, config, seed=seed)
        return Prepared({**config, **learned.settings}, learned.account)

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn components, graph, cut-offs and the maps of every pair of emotions with parallel sentences.

        `seed` starts the components and the maps.
        """
        device = self.device
        self.learned_from(corpus)
        frames = corpus.arrays().frames
        frames = frames[np.isfinite(frames).all(axis=1)]
        if len(frames) < 2:
            raise FacesynthError(f"{corpus.path} has {len(frames)} complete frames of motion; there is nothing to learn from")
        self.components.fit(frames, corpus.layout, variance=self.config["variance"], seed=seed)
        builder = GraphBuilder(self.components, self.audio, self.emotions, corpus.removed_nodes())
        takes, gaps = [], []
        for utterance in track(corpus, "anime graph", len(corpus)):
            builder.add(utterance)
            takes.append(take_of(utterance, self.components))
            spans = bilabial_spans(utterance.speech.phones, self.fps)
            gaps += narrowest_gaps(utterance.motion.frames, corpus.layout, spans)
        self.facts["closed_gap"] = float(np.median(gaps)) if gaps else None
        graph = builder.build()
        for name, tensor in tensors_of(graph).items():
            self.nodes.register_buffer(name, tensor)
        runs = (graph.frames[a:b] for a, b in sorted(set(zip(graph.run_starts, graph.run_stops, strict=True))))
        self.register_buffer("cutoffs_hz", torch.from_numpy(cutoffs_hz(runs, self.fps)))
        self.facts["utterances"] = list(corpus.ids)
        if self.predictor is not None:
            self.predictor.learn(corpus, lambda frames: self.in_metric(frames.cpu()).to(device), seed)
        self._fit_maps([take for take in takes if take is not None], seed)
        self._chooser, self._last = None, LastSearch()
        return self.to(device)

    def in_metric(self, frames: torch.Tensor) -> torch.Tensor:
        """Frames [T, C] as components times metric [T, D], whose squared distance is the mean over the channels."""
        return self.components.encode(frames) @ self.components.metric

    # Hundreds of small clusterings and systems: where another program held one of two processors, two threads that
    # wait for each other took 55 s of processor time for a fit that takes 6 s with one thread here.
    @threadpool_limits.wrap(limits=1)
    def _fit_maps(self, takes: Sequence[Take], seed: int) -> None:
        """A map for every ordered pair of emotions; why there is none is kept for those who ask for it."""
        self.facts["no_map"] = {}
        pairs = list(permutations(self.emotions, 2))
        counts = {pair: len({a.sentence for a, _ in emotion_pairs(takes, *pair)}) for pair in pairs}
        self.split = self._split(takes, seed) if any(counts.values()) else NOTHING_SPLIT
        self.facts["findings"] = [self.split.summary()] if len(self.emotions) > 1 else []
        fitted = []
        for pair in pairs:
            try:
                require_pairs(self.split, counts[pair], *pair)
            except FacesynthError as error:
                self.facts["no_map"][" ".join(pair)] = str(error)
            else:
                fitted.append(pair)
        mixing = self.components.mixing.numpy()
        fit = partial(_fit_map, list(takes), self.split, self.map_settings, mixing, seed)
        found = zip(fitted, in_pieces(fit, fitted, "emotion maps"), strict=True)
        number = self.emotions.index
        self.maps.fill([FittedMap(number(a), number(b), *one) for (a, b), one in found], self.split.emotional)

    def __getstate__(self) -> dict[str, Any]:
        """For another process, without what is made anew when it is asked for."""
        return {**self.__dict__, "_chooser": None, "_last": LastSearch()}

    def _split(self, takes: Sequence[Take], seed: int) -> Split:
        override = self.config["emotional_components"]
        split = split_components(takes, self.components, self.fitted_layout, override, seed=seed)
        self.facts["components"] = split.report(BLOCKS, self.components.block.tolist())
        return split

    @property
    def chooser(self) -> Chooser:
        """The graph with its maps, ready for searching."""
        if self._chooser is None:
            self.fitted_layout  # noqa: B018 - raises before `fit`
            graph = Graph.of({name: tensor.cpu().numpy() for name, tensor in self.nodes.named_buffers()})
            pairs = [(int(source), int(target)) for source, target in self.maps.pairs.tolist()]
            self._chooser = Chooser(graph, Maps(pairs, self.maps.apply_array))
        return self._chooser

    @property
    def graph(self) -> Graph:
        """The anime graph."""
        return self.chooser.graph

    def runtime(self) -> Runtime:
        """The model that speaks: what an exported folder is, with these modules for its graphs."""
        layout, chooser, parts, config = self.fitted_layout, self.chooser, self.components, self.config
        mixing, dropped = parts.mixing.cpu().numpy(), self.maps.dropped.cpu().numpy()
        gap = self.facts["closed_gap"]
        return Runtime(
            layout,
            self.fps,
            self.emotions,
            chooser,
            self.weights,
            parts.metric.cpu().numpy(),
            LowPass(self.cutoffs_hz.cpu().numpy(), self.fps),
            EmotionMapper(layout, self.emotions, chooser.maps, self.facts["no_map"], parts.encode_array, mixing, dropped),
            decode=parts.decode_array,
            hear=self.audio.of,
            feature_fps=self.audio.fps,
            closed_gap=np.inf if gap is None else float(gap),
            utterances=tuple(self.facts["utterances"]),
            bands=None if self.predictor is None else self.predictor.hearing.bands,
            expectation=None if self.predictor is None else self.predictor.expectation(),
            temperature=config["temperature"],
            sharpening=config["sharpening"],
            help_pairs=config["help_pairs"],
            last=self._last,
            search=NUMPY if (device := self.cutoffs_hz.device).type == "cpu" else torch_search(device),
        )

    def synthesize(self, speech: Speech, *, seed: int = 0, look_ahead: int | None = None, **options: Any) -> Motion:
        """Motion for new speech; `look_ahead`, `to_emotion` and `to_intensity` as in `inference.anime_graph.model`."""
        return self.runtime().synthesize(speech, seed=seed, look_ahead=look_ahead, **options)

    def plan(self, speech: Speech, *, look_ahead: int | None = None) -> Plan:
        """The path through the graph that expresses speech."""
        return self.runtime().plan(speech, look_ahead=look_ahead)

    def wishes(self, speech: Speech) -> list[Wish]:
        """What each phone of the speech asks for."""
        return self.runtime().wishes(speech)

    def explain(self, speech: Speech, *, look_ahead: int | None = None) -> list[dict[str, Any]]:
        """Per phone: the chosen node, its cost terms, the runners-up by audio, and what it lacks."""
        return self.runtime().explain(speech, look_ahead=look_ahead)

    def report(self, speech: Speech) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion; `plan(speech).summary()` tells more."""
        return self.runtime().report(speech)

    def joins(self, speech: Speech) -> Ints:
        """First frames of the phones that were jumped to."""
        return self.runtime().joins(speech)

    def account(self, speech: Speech, *, look_ahead: int | None = None) -> Account:
        """What the graph lacked, and what a look-ahead lost; see `Plan.summary`."""
        found = self._last.of(speech, (look_ahead,), lambda: self.plan(speech, look_ahead=look_ahead).summary())
        fallbacks = [item for what in ("phone_fallbacks", "emotion_fallbacks") for item in found[what].items()]
        lacking = f"of {found['phones']} phones are not in the graph as asked for"
        warnings = [f"{count} {lacking}: {level}" for level, count in fallbacks]
        lost = f"look-ahead of {look_ahead} phones: {found['extra_cost']:.2%} over the least cost"
        return Account(found, warnings, [] if look_ahead is None else [lost])

    def map_emotion(self, motion: Motion, source: str, target: str, *, intensity: Floats | float = 1.0) -> Motion:
        """Any motion of the learned layout from one emotion to another; see `EmotionMapper`."""
        return self.runtime().mapper.map_emotion(motion, source, target, intensity=intensity)

    def map_along(self, motion: Motion, speech: Speech, target: str, *, intensity: float = 1.0) -> Motion:
        """Any motion of the learned layout that goes with speech, from the speech's emotions to another one."""
        return self.runtime().mapper.map_along(motion, speech, target, intensity=intensity)

    def open_stream(self, *, look_ahead: int = 4) -> WishStream:
        """Something to push phones into and take frames from; `look_ahead` phones (the paper: 3 to 6) are waited for."""
        return self.runtime().open_stream(look_ahead=look_ahead)

    def stream(self, wishes: Iterable[Wish], *, look_ahead: int = 4) -> Iterator[NDArray[np.float32]]:
        """Frames [n, C] while phones arrive, as `open_stream` gives them."""
        return self.runtime().stream_wishes(wishes, look_ahead=look_ahead)


def _fit_map(
    takes: list[Take], split: Split, settings: MapSettings, mixing: Floats, seed: int, pair: tuple[str, str]
) -> EmotionMap:
    return fit_emotion_map(matched(emotion_pairs(takes, *pair), split), split, settings, mixing, seed=seed)
