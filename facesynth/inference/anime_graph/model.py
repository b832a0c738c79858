"""Sound and phones in, motion out: at once, or as they come in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..anime_graph.assembly import Blender, likely_motions, make_piece
from ..anime_graph.graph import Candidates, LookAhead, Nodes, Step, Weights, Wish, best_path, soft_path
from ..anime_graph.hearing import Ear, Floats, Ints
from ..anime_graph.stream import AnimeStream
from ..checks import checked_audio, checked_rate
from ..closures import close_at, keep_shut
from ..errors import FacesynthError, reject_options, unknown
from ..filters import butterworth, forth_and_back, gaussian, sharpen
from ..folder import Folder
from ..graphs import Graph
from ..layout import Layout
from ..lips import bilabial_spans
from ..motion import Motion
from ..sound import resample
from ..speech import frame_bounds

if TYPE_CHECKING:
    from ..expectation import Expectation

NEUTRAL = "neutral"
EMOTION_CHANGES_S, SMALLEST_SWING = 0.08, 1e-4
LEAST_SHARE = 1e-3
"""Candidates that are less probable than this are left out of a mean."""
PASS_ALL, ORDER = 0.98, 6
FORGETS = 1e-5
"""Share of a step that is left of it where a filter no longer feels it."""
OPTIONS = ("seed", "look_ahead", "to_emotion", "to_intensity")


@dataclass(frozen=True, eq=False)
class Plan:
    """A path through the graph."""

    wishes: Sequence[Wish]
    candidates: Sequence[Candidates]
    steps: Sequence[Step]
    path: Ints
    """[T] index of the chosen one among each phone's candidates."""
    cost: float
    """Eq. 2."""

    @property
    def nodes(self) -> Ints:
        """[T] the chosen nodes."""
        return np.array([c.nodes[i] for c, i in zip(self.candidates, self.path, strict=True)])


class AnimeGraph:
    """A folder exported from an `anime_graph` model."""

    def __init__(self, folder: Folder, threads: int) -> None:
        manifest, settings, arrays = folder.manifest, folder.settings, folder.arrays()
        self.manifest, self.settings = manifest, settings
        self.fps, self.rate = float(manifest["fps"]), int(manifest["sample_rate"])
        self.layout, self.emotions = Layout.from_dict(manifest["layout"]), tuple(manifest["emotions"])
        self.phones = {phone: index for index, (phone, _) in enumerate(manifest["phones"])}
        self.weights = Weights(**settings["weights"])
        self.pairs = [tuple(pair) for pair in settings["maps"]]
        maps = Graph(folder, "emotion_maps", threads) if self.pairs else None
        self.nodes = Nodes(arrays, [viseme for _, viseme in manifest["phones"]], self.pairs, maps)
        self._mixing, self._cutoffs = arrays["mixing"], arrays["cutoffs_hz"]
        self._dropped = arrays.get("dropped")
        self._filtered = np.flatnonzero(self._cutoffs < PASS_ALL * self.fps / 2)
        self._sections = butterworth(ORDER, 2 * self._cutoffs[self._filtered] / self.fps)
        self.expectation: Expectation | None = None
        if self.weights.pose > 0:
            from ..expectation import exported_bands, exported_expectation  # only models that expect need it

            self.expectation = exported_expectation(folder, arrays, threads)
            self._bands = exported_bands(folder, threads)
        self._plp, self._encode, self._decode = (Graph(folder, name, threads) for name in ("rasta_plp", "encode", "decode"))

    @cached_property
    def settles_frames(self) -> int:
        """How far the filters reach to either side; it is the lowest cut-off that reaches farthest."""
        if not len(self._filtered):
            return 0
        far = int(np.ceil(2 * np.log(FORGETS) / np.log(self._sections[:, 2].max())))  # by the pole nearest to the circle
        step = np.repeat([0.0, 1.0], far)[:, None].repeat(len(self._filtered), axis=1)
        felt = np.abs(forth_and_back(self._sections, step, 0)[:far]).max(axis=1) > FORGETS
        return far - int(felt.argmax())

    @property
    def closed_gap(self) -> float:
        """How near the lips come at a p, b or m; infinite where the recordings do not show it."""
        gap = self.settings["closed_gap"]
        return np.inf if gap is None else float(gap)

    def synthesize(
        self,
        speech: Any,
        *,
        seed: int = 0,
        look_ahead: int | None = None,
        to_emotion: str | None = None,
        to_intensity: float = 1.0,
        **options: Any,
    ) -> Motion:
        """Motion for speech. Nothing is random: `seed` changes nothing.

        look_ahead: search that many phones ahead in place of the whole utterance. to_emotion, to_intensity: find motion in
        the speech's own emotion and map it to this one.
        """
        reject_options("anime_graph", options, OPTIONS)
        plan = self.plan(speech, look_ahead=look_ahead)
        joined = self._mean(plan) if self.settings["temperature"] > 0 else self._blended(plan)
        frames = self.decode(sharpen(self.low_pass(joined), self.settings["sharpening"], self.fps))
        frames = close_at(frames, self.layout, bilabial_spans(speech.phones, self.fps), self.closed_gap, self.fps)
        motion = self._with_intensity(Motion(frames.astype(np.float32), self.fps, self.layout), speech)
        return motion if to_emotion is None else self.map_along(motion, speech, to_emotion, intensity=to_intensity)

    def plan(self, speech: Any, *, look_ahead: int | None = None) -> Plan:
        """The path through the graph that expresses speech."""
        wishes = self.wishes(speech)
        candidates = [self.nodes.candidates(wish.phone, wish.emotion) for wish in wishes]
        steps: list[Step] = []
        for t, wish in enumerate(wishes):
            before = (candidates[t - 1], steps[t - 1]) if t else None
            steps.append(self.nodes.step(candidates[t], before, wish, self.weights))
        if look_ahead is None:
            return Plan(wishes, candidates, steps, *best_path(steps, self.weights))
        search = LookAhead(self.weights, look_ahead)
        settled = [candidate for step in steps for candidate in search.push(step)]
        path = np.array(settled + search.finish(), np.int64)
        return Plan(wishes, candidates, steps, path, self._cost(steps, path))

    def wishes(self, speech: Any) -> list[Wish]:
        """What each phone of the speech asks for."""
        labels, ends_s = tuple(speech.phones.labels), np.asarray(speech.phones.ends_s, np.float64)
        audio = checked_audio(speech.audio)
        if float(np.ptp(audio)) < SMALLEST_SWING:
            raise FacesynthError("the sound is constant (silence?); choose a recording in which somebody speaks")
        feelings = speech.emotions.per_phone(speech.phones)[0]
        numbers = [self.numbers(label, feeling) for label, feeling in zip(labels, feelings, strict=True)]
        ear = self.ear()
        ear.hear(resample(audio, speech.sample_rate, self.rate))
        ear.finish()
        features = ear.features
        bounds, lengths = frame_bounds(ends_s, self.settings["feature_fps"]), np.diff(frame_bounds(ends_s, self.fps))
        starts = np.minimum(bounds[:-1], len(features) - 1)
        stops = np.maximum(np.minimum(bounds[1:], len(features)), starts + 1)
        poses = self._expected(self.expectation, speech, numbers, ends_s) if self.expectation else [None] * len(labels)
        each = zip(numbers, starts, stops, lengths, poses, strict=True)
        return [Wish(*n, features[a:b], int(count), pose) for n, a, b, count, pose in each]

    def _expected(
        self, expectation: Expectation, speech: Any, numbers: Sequence[tuple[int, int]], ends_s: Floats
    ) -> list[Floats]:
        """The expected pose over each phone."""
        said, felt = zip(*numbers, strict=True)
        bounds = frame_bounds(ends_s, self.fps)
        poses = expectation.poses(self._bands(speech), said, ends_s, felt, self.fps, int(bounds[-1]))
        return np.split(poses, bounds[1:-1])

    def map_emotion(self, motion: Motion, source: str, target: str, *, intensity: Floats | float = 1.0) -> Motion:
        """Any motion of the model's layout from one emotion to another; intensity 0..1, a number or one per frame [T]."""
        number = self._map_number(source, target)
        if (motion.layout.kind, tuple(motion.layout.names)) != (self.layout.kind, self.layout.names):
            raise FacesynthError(
                f"got motion of {len(motion.layout.names)} {motion.layout.kind}; wanted this model's layout, "
                f"{len(self.layout.names)} {self.layout.kind}"
            )
        if number is None:
            return motion
        frames = motion.frames.astype(np.float64)
        before = self._encode(frames=np.nan_to_num(frames)[None])[0][0]
        change = (self.nodes.mapped(before, number) - before) @ self._mixing.T
        amount = np.broadcast_to(np.asarray(intensity, np.float64), len(frames))[:, None]
        dropped = 0.0 if self._dropped is None else self._dropped[number]
        changed = keep_shut(frames + amount * (change + dropped), frames, self.layout)
        return Motion(changed.astype(np.float32), motion.fps, motion.layout)

    def map_along(self, motion: Motion, speech: Any, target: str, *, intensity: float = 1.0) -> Motion:
        """Any motion that goes with speech, from the speech's emotions to another one."""
        if not 0 <= intensity <= 1:
            raise FacesynthError(f"intensity is {intensity:g}; wanted 0 (unchanged) to 1")
        self._map_number(target, target)
        for source in sorted(set(speech.emotions.labels) - {target}):
            felt = intensity * self._felt(speech, source, motion)
            motion = self.map_emotion(motion, source, target, intensity=felt)
        return motion

    def stream(self, *, look_ahead: int = 4, sample_rate: int | None = None) -> AnimeStream:
        """Sound and phones as they come in; a node is settled when `look_ahead` phones (the paper: 3 to 6) follow it."""
        if self.weights.pose > 0 or self.settings["temperature"] > 0 or self.settings["sharpening"] > 0:
            raise FacesynthError(
                "this model takes means over paths, expects poses or is sharpened: it wants whole utterances; for streams export "
                "one trained with temperature=0 pose_weight=0 sharpening=0"
            )
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        return AnimeStream(self, look_ahead)

    def numbers(self, phone: str, emotion: str) -> tuple[int, int]:
        """Of a phone and of an emotion."""
        if phone not in self.phones:
            raise unknown("phone", phone, self.phones)
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)
        return self.phones[phone], self.emotions.index(emotion)

    def ear(self) -> Ear:
        """Something that hears a sound from its start."""
        return Ear(self._plp, self.settings["bands"], self.settings["parameters"])

    def blender(self) -> Blender:
        """Something that joins pieces."""
        return Blender(self.nodes, self.fps, self.settings["help_pairs"])

    def decode(self, components: Floats) -> Floats:
        """Components [T, D] to frames [T, C]."""
        return self._decode(coordinates=components[None])[0][0]

    def low_pass(self, components: Floats) -> Floats:
        """Components [T, D] without what lies above each one's cut-off, nothing shifted in time."""
        smooth = components.copy()
        columns = self._filtered
        if len(columns) and len(components) > 1:
            reach = np.minimum(len(components) - 1, np.round(2 * self.fps / self._cutoffs[columns]).astype(np.int64))
            smooth[:, columns] = forth_and_back(self._sections, components[:, columns], reach)
        return smooth

    def _blended(self, plan: Plan) -> Floats:
        blender = self.blender()
        for t, (wish, candidates, chosen) in enumerate(zip(plan.wishes, plan.candidates, plan.path.tolist(), strict=True)):
            captured = t > 0 and bool(plan.steps[t].link[chosen] == plan.path[t - 1])
            blender.add(make_piece(self.nodes, wish, candidates, chosen), captured)
        return np.concatenate([blender.blended(t) for t in range(len(blender.pieces))])

    def _mean(self, plan: Plan) -> Floats:
        """[frames, D] each phone the mean of its candidates, brought to its time."""
        frames = []
        for wish, candidates, shares in zip(
            plan.wishes, plan.candidates, soft_path(plan.steps, self.weights, self.settings["temperature"]), strict=True
        ):
            likely = np.flatnonzero(shares >= min(LEAST_SHARE, shares.max()))
            pieces = likely_motions(self.nodes, wish, candidates, likely)
            frames.append(np.tensordot(shares[likely] / shares[likely].sum(), pieces, 1))
        return np.concatenate(frames)

    def _cost(self, steps: Sequence[Step], path: Ints) -> float:
        cost = sum(float(self.weights.target(step)[c]) for step, c in zip(steps, path, strict=True))
        for t in range(1, len(path)):
            if steps[t].link[path[t]] != path[t - 1]:
                cost += float(steps[t].jumps[path[t], path[t - 1]])
        return cost

    def _with_intensity(self, motion: Motion, speech: Any) -> Motion:
        """An emotion of intensity I is mapped towards neutral by 1 - I; where no map leads there, it stays whole."""
        track = speech.emotions
        for source in sorted(set(track.labels) & set(self.emotions) - {NEUTRAL}):
            weak = self._felt(speech, source, motion, 1 - np.asarray(track.intensities))
            mapped = NEUTRAL in self.emotions and f"{source} {NEUTRAL}" not in self.settings["no_map"]
            if mapped and weak.max() > 0:
                motion = self.map_emotion(motion, source, NEUTRAL, intensity=weak)
        return motion

    def _felt(self, speech: Any, emotion: str, motion: Motion, amount: Floats | float = 1.0) -> Floats:
        """[T] amount (of each interval of the emotion track) where the emotion is felt, 0 elsewhere; smooth over time."""
        track = speech.emotions
        felt = np.array([label == emotion for label in track.labels]) * amount
        times_s = np.arange(len(motion)) / motion.fps
        at = np.minimum(np.searchsorted(track.ends_s, times_s, side="right"), len(track.labels) - 1)
        return gaussian(felt[at], EMOTION_CHANGES_S * motion.fps)

    def _map_number(self, source: str, target: str) -> int | None:
        """Number of a map, None from an emotion to itself; FacesynthError where there is none."""
        for name in (source, target):
            if name not in self.emotions:
                raise unknown("emotion", name, self.emotions)
        if source == target:
            return None
        pair = self.emotions.index(source), self.emotions.index(target)
        if pair not in self.pairs:
            raise FacesynthError(self.settings["no_map"].get(f"{source} {target}", f"no map leads from {source} to {target}"))
        return self.pairs.index(pair)
