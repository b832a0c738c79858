"""The anime graph as a method of the zoo."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import permutations
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from facesynth.corpus import Corpus
from facesynth.inference.closures import ClosingLips, close_at, keep_shut
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.filters import sharpen
from facesynth.inference.lips import bilabial_spans, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import Speech
from facesynth.methods.anime_graph.build import GraphBuilder
from facesynth.methods.anime_graph.candidates import Chooser
from facesynth.methods.anime_graph.capabilities import CAPABILITIES
from facesynth.methods.anime_graph.components import BLOCKS, FaceComponents
from facesynth.methods.anime_graph.features import AudioFeatures, ranges
from facesynth.methods.anime_graph.graph import PHONE_INDEX, VISEMES, Graph
from facesynth.methods.anime_graph.lowpass import cutoffs_hz, low_pass
from facesynth.methods.anime_graph.mapping import (
    MapSettings,
    Samples,
    Width,
    dropped_shift,
    fit_map,
    lasting_shift,
    matched,
    require_pairs,
)
from facesynth.methods.anime_graph.maps import EmotionMaps, FittedMap
from facesynth.methods.anime_graph.parallel import Take, emotion_pairs, take_of
from facesynth.methods.anime_graph.plan import Plan, Wish, blend, explain, make_plan
from facesynth.methods.anime_graph.search import Weights
from facesynth.methods.anime_graph.soft import mean_motion
from facesynth.methods.anime_graph.split import NOTHING_SPLIT, Split, split_components
from facesynth.methods.anime_graph.streaming import FaceStream, Stream
from facesynth.methods.capabilities import Account
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.rbf import Kernel
from facesynth.progress import track

MOST_FRAMES = 60_000
"""Of more training frames than this, evenly spaced ones are enough to find the components."""

NEUTRAL = "neutral"
EMOTION_CHANGES_S = 0.08
"""Standard deviation of the smoothing with which mapped emotions come and go."""


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
        `fit` starts from these weights, learns those above 0, and the sharpening, on sentences that it keeps out of the
        graph meanwhile, and leaves what it found in `config`.
    help_pairs : bool
        Whether a recorded pair of the two phones helps to bridge a jump; without, every jump is a cross-fade.
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
    ) -> None:
        super().__init__()
        for name, value in (("temperature", temperature), ("pose_weight", pose_weight), ("sharpening", sharpening)):
            if not 0 <= value < float("inf"):
                raise FacesynthError(f"{name} must be 0 (as in the paper) or above; got {value}")
        self.audio = AudioFeatures(parameters)
        self.components = FaceComponents()
        self.maps = EmotionMaps()
        self.predictor = PosePredictor() if pose_weight > 0 else None
        self.map_settings = MapSettings(map_width, map_kernel, map_centres)
        self.nodes = nn.Module()
        self._chooser: Chooser | None = None

    @property
    def weights(self) -> Weights:
        """Of the cost."""
        return Weights(*(self.config[name] for name in ("jump_weight", "jump_cost_weight", "audio_weight", "pose_weight")))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn components, graph, cut-offs and the maps of every pair of emotions with parallel sentences.

        `seed` starts the components and the maps, and draws the sentences that `learn` holds out.
        """
        if self.config["learn"]:
            from facesynth.methods.anime_graph.learning import learn  # it needs this class

            learned = learn(corpus, self.config, seed=seed)
            self.config |= learned.settings
            self.facts["learned"] = learned.account
        self.learned_from(corpus)
        frames = corpus.arrays().frames
        frames = frames[np.isfinite(frames).all(axis=1)]
        if len(frames) < 2:
            raise FacesynthError(f"{corpus.path} has {len(frames)} complete frames of motion; there is nothing to learn from")
        some = frames[:: max(1, len(frames) // MOST_FRAMES)]
        self.components.fit(some, corpus.layout, variance=self.config["variance"], seed=seed)
        builder = GraphBuilder(self.components, self.audio, self.emotions, corpus.removed_nodes())
        takes, gaps = [], []
        for utterance in track(corpus, "anime graph", len(corpus)):
            builder.add(utterance)
            takes.append(take_of(utterance, self.components))
            spans = bilabial_spans(utterance.speech.phones, self.fps)
            gaps += narrowest_gaps(utterance.motion.frames, corpus.layout, spans)
        self.facts["closed_gap"] = float(np.median(gaps)) if gaps else None
        graph = builder.build()
        for name, tensor in graph.tensors().items():
            self.nodes.register_buffer(name, tensor)
        runs = (graph.frames[a:b] for a, b in sorted(set(zip(graph.run_starts, graph.run_stops, strict=True))))
        self.register_buffer("cutoffs_hz", torch.from_numpy(cutoffs_hz(runs, self.fps)))
        self.facts["utterances"] = list(corpus.ids)
        if self.predictor is not None:
            self.predictor.learn(corpus, self.in_metric, seed)
        self._fit_maps([take for take in takes if take is not None], seed)
        self._chooser = None
        return self

    def in_metric(self, frames: torch.Tensor) -> torch.Tensor:
        """Frames [T, C] as components times metric [T, D], whose squared distance is the mean over the channels."""
        return self.components.encode(frames) @ self.components.metric

    def _fit_maps(self, takes: Sequence[Take], seed: int) -> None:
        """A map for every ordered pair of emotions; why there is none is kept for those who ask for it."""
        self.facts["no_map"], fitted = {}, []
        pairs = list(permutations(self.emotions, 2))
        counts = {pair: len({a.sentence for a, _ in emotion_pairs(takes, *pair)}) for pair in pairs}
        self.split = self._split(takes, seed) if any(counts.values()) else NOTHING_SPLIT
        for pair in track(pairs, "emotion maps"):
            try:
                require_pairs(self.split, counts[pair], *pair)
            except FacesynthError as error:
                self.facts["no_map"][" ".join(pair)] = str(error)
            else:
                fitted.append(self._fit_map(matched(takes, self.split, *pair), pair, seed))
        self.maps.fill(fitted, self.split.emotional)

    def _fit_map(self, samples: Sequence[Samples], pair: tuple[str, str], seed: int) -> FittedMap:
        source, target = map(self.emotions.index, pair)
        rbf = fit_map(samples, self.map_settings, seed=seed)
        shift = lasting_shift(samples, self.split.emotional)
        return FittedMap(source, target, rbf, shift, dropped_shift(samples, self.components.mixing.numpy()))

    def _split(self, takes: Sequence[Take], seed: int) -> Split:
        override = self.config["emotional_components"]
        split = split_components(takes, self.components, self.fitted_layout, override, seed=seed)
        self.facts["components"] = split.report(BLOCKS, self.components.block.tolist())
        return split

    def map_emotion(self, motion: Motion, source: str, target: str, *, intensity: NDArray[np.float64] | float = 1.0) -> Motion:
        """Any motion of the learned layout, recorded or synthesised by any method, from one emotion to another.

        intensity: 0 leaves the motion, 1 maps it fully; a number or one per frame [T]. What the components do not
        hold stays, lips that were shut stay shut, and frames with missing samples stay missing.
        """
        number = self._map_number(source, target)
        self._check_layout(motion)
        if number is None:
            return motion
        frames = motion.frames.astype(np.float64)
        before = self.components.encode_array(np.nan_to_num(frames))
        change = (self.maps.apply_array(before, number) - before) @ self.components.mixing.numpy().T
        amount = np.broadcast_to(np.asarray(intensity, np.float64), len(frames))[:, None]
        changed = frames + amount * (change + self.maps.dropped[number].numpy())
        return replace(motion, frames=keep_shut(changed, frames, motion.layout).astype(np.float32))

    def _map_number(self, source: str, target: str) -> int | None:
        """Number of a map, None from an emotion to itself; FacesynthError where there is none."""
        for name in (source, target):
            if name not in self.emotions:
                raise unknown("emotion", name, self.emotions)
        if source == target:
            return None
        number = self.maps.find(self.emotions.index(source), self.emotions.index(target))
        if number is None:
            raise FacesynthError(self.facts["no_map"][f"{source} {target}"])
        return number

    def _check_layout(self, motion: Motion) -> None:
        if (motion.layout.kind, motion.layout.names) != (self.fitted_layout.kind, self.fitted_layout.names):
            raise FacesynthError(
                f"this model maps motion of its own layout ({len(self.fitted_layout.names)} {self.fitted_layout.kind}); "
                f"got {len(motion.layout.names)} {motion.layout.kind} with other names"
            )

    @property
    def chooser(self) -> Chooser:
        """The graph with its maps, ready for searching."""
        if self._chooser is None:
            self.fitted_layout  # noqa: B018 - raises before `fit`
            self._chooser = Chooser(
                Graph.from_tensors(dict(self.nodes.named_buffers())), self.maps, help_pairs=self.config["help_pairs"]
            )
        return self._chooser

    @property
    def graph(self) -> Graph:
        """The anime graph."""
        return self.chooser.graph

    def synthesize(
        self,
        speech: Speech,
        *,
        seed: int = 0,
        look_ahead: int | None = None,
        to_emotion: str | None = None,
        to_intensity: float = 1.0,
    ) -> Motion:
        """Motion for new speech. Nothing is random: `seed` changes nothing.

        One after the other: the path, or above temperature 0 each phone as the mean of its candidates (`soft`), brought
        to time; `low_pass` at the learned cut-offs; `sharpen`; components decoded; lips closed at p, b, m (`close_at`).

        look_ahead: search that many phones ahead, as for streaming, in place of the whole utterance.
        to_emotion, to_intensity: find motion in the speech's own emotion and map it to this one.
        """
        plan = self.plan(speech, look_ahead=look_ahead)
        smooth = low_pass(self._joined(plan), self.cutoffs_hz.numpy(), self.fps)
        motion = self._motion(sharpen(smooth, self.config["sharpening"], self.fps), speech)
        motion = self._with_intensity(motion, speech)
        return motion if to_emotion is None else self.map_along(motion, speech, to_emotion, intensity=to_intensity)

    def _joined(self, plan: Plan) -> NDArray[np.float64]:
        """[frames, D] the phones one after the other, not yet smoothed."""
        if temperature := self.config["temperature"]:
            return mean_motion(self.chooser, plan, self.weights, temperature)
        return blend(self.chooser, plan, self.fps)[0]

    def map_along(self, motion: Motion, speech: Speech, target: str, *, intensity: float = 1.0) -> Motion:
        """Any motion of the learned layout that goes with speech, from the speech's emotions to another one."""
        if not 0 <= intensity <= 1:
            raise FacesynthError(f"the intensity of a mapped emotion must lie from 0 (unchanged) to 1; got {intensity:g}")
        self._map_number(target, target)
        for source in sorted(set(speech.emotions.labels) - {target}):
            motion = self.map_emotion(motion, source, target, intensity=intensity * self._felt(speech, source, motion))
        return motion

    def _with_intensity(self, motion: Motion, speech: Speech) -> Motion:
        """An emotion of intensity I is mapped towards neutral by 1 - I; where no map leads there, it stays whole."""
        track = speech.emotions
        for source in sorted(set(track.labels) & set(self.emotions) - {NEUTRAL}):
            weak = self._felt(speech, source, motion, 1 - track.intensities)
            mapped = NEUTRAL in self.emotions and f"{source} {NEUTRAL}" not in self.facts["no_map"]
            if mapped and weak.max() > 0:
                motion = self.map_emotion(motion, source, NEUTRAL, intensity=weak)
        return motion

    def _felt(
        self, speech: Speech, emotion: str, motion: Motion, amount: NDArray[np.float64] | float = 1.0
    ) -> NDArray[np.float64]:
        """[T] amount (of each interval of the emotion track) where the emotion is felt, 0 elsewhere; smooth over time."""
        from scipy.ndimage import gaussian_filter1d

        track = speech.emotions
        felt = np.array([label == emotion for label in track.labels]) * amount
        over_time = felt[track.index_at(motion.times_s)]
        return gaussian_filter1d(over_time, EMOTION_CHANGES_S * motion.fps, mode="nearest")

    def open_stream(self, *, look_ahead: int = 4) -> FaceStream:
        """Something to push phones into and take frames from; `look_ahead` phones (the paper: 3 to 6) are waited for.

        A stream takes the cheapest path, whatever the temperature, and is not sharpened.
        """
        stream = Stream(
            self.chooser,
            self.weights,
            metric=self.components.metric.numpy(),
            cutoffs_hz=self.cutoffs_hz.numpy(),
            fps=self.fps,
            look_ahead=look_ahead,
        )
        return FaceStream(stream, self.components, ClosingLips(self.fitted_layout, self._closed_gap, self.fps))

    def stream(self, wishes: Iterable[Wish], *, look_ahead: int = 4) -> Iterator[NDArray[np.float32]]:
        """Frames [n, C] while phones arrive, as `open_stream` gives them."""
        stream = self.open_stream(look_ahead=look_ahead)
        for wish in wishes:
            yield stream.push(wish)
        yield stream.finish()

    def plan(self, speech: Speech, *, look_ahead: int | None = None) -> Plan:
        """The path through the graph that expresses speech."""
        return make_plan(self.chooser, self.wishes(speech), self.components.metric.numpy(), self.weights, look_ahead)

    def report(self, speech: Speech) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion; `plan(speech).summary()` tells more."""
        plan = self.plan(speech)
        phones, feelings = (np.array([getattr(w, name) for w in plan.wishes]) for name in ("phone", "emotion"))
        said, felt = self.graph.phones[plan.nodes], self.graph.emotions[plan.nodes]
        return {
            "other_phones": float((said != phones).mean()),
            "other_visemes": float((VISEMES[said] != VISEMES[phones]).mean()),
            "other_emotions": float((felt != feelings).mean()),
        }

    def account(self, speech: Speech, *, look_ahead: int | None = None) -> Account:
        """What the graph lacked, and what a look-ahead lost; see `Plan.summary`."""
        found = self.plan(speech, look_ahead=look_ahead).summary()
        fallbacks = [item for what in ("phone_fallbacks", "emotion_fallbacks") for item in found[what].items()]
        lacking = f"of {found['phones']} phones are not in the graph as asked for"
        warnings = [f"{count} {lacking}: {level}" for level, count in fallbacks]
        lost = f"look-ahead of {look_ahead} phones: {found['extra_cost']:.2%} over the least cost"
        return Account(found, warnings, [] if look_ahead is None else [lost])

    def joins(self, speech: Speech) -> NDArray[np.int64]:
        """First frames of the phones that were jumped to."""
        plan = self.plan(speech)
        return speech.phones.frame_bounds(self.fps)[1:-1][plan.jumps]

    def explain(self, speech: Speech, *, look_ahead: int | None = None) -> list[dict[str, Any]]:
        """Per phone: the chosen node, its cost terms, the runners-up by audio, and what it lacks."""
        return explain(
            self.chooser, self.plan(speech, look_ahead=look_ahead), self.weights, self.facts["utterances"], self.emotions
        )

    def wishes(self, speech: Speech) -> list[Wish]:
        """What each phone of the speech asks for."""
        feelings, _ = speech.emotions.per_phone(speech.phones)
        for label, known, what in ((feelings, self.emotions, "emotion"), (speech.phones.labels, PHONES, "phone")):
            for name in label:
                if name not in known:
                    raise unknown(what, name, known)
        features = self.audio.of(speech)
        heard = ranges(speech.phones, self.audio.fps, len(features))
        bounds, felt = speech.phones.frame_bounds(self.fps), np.array([self.emotions.index(e) for e in feelings])
        poses: list[NDArray[np.float64] | None] = [None] * len(felt)
        if self.predictor is not None:
            said = [PHONES.index(label) for label in speech.phones.labels]
            bands, expectation = self.predictor.hearing.bands(speech), self.predictor.expectation(len(self.emotions))
            found = expectation.poses(bands, said, speech.phones.ends_s, felt.tolist(), self.fps, int(bounds[-1]))
            poses = list(np.split(found, bounds[1:-1]))
        lengths = np.diff(bounds).tolist()
        return [
            Wish(PHONE_INDEX[label], int(emotion), features[a:b], length, pose)
            for label, emotion, (a, b), length, pose in zip(
                speech.phones.labels, felt, heard.tolist(), lengths, poses, strict=True
            )
        ]

    def _motion(self, components: NDArray[np.float64], speech: Speech) -> Motion:
        """Components [T, D] as motion whose lips close at every p, b, m as they do in the recordings."""
        frames = self.components.decode_array(components)
        spans = bilabial_spans(speech.phones, self.fps)
        frames = close_at(frames, self.fitted_layout, spans, self._closed_gap, self.fps)
        return Motion(frames.astype(np.float32), self.fps, self.fitted_layout)

    @property
    def _closed_gap(self) -> float:
        """How near the lips come at a p, b or m, as recorded; infinite where the recordings do not show it."""
        gap = self.facts["closed_gap"]
        return np.inf if gap is None else float(gap)
