"""Phones in, motion out: at once, or phone by phone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..closures import close_lips
from ..efase.assembly import Smoothing, blend, concatenate, joints
from ..efase.costs import Query, Weights, all_targets
from ..efase.explanation import explain, shares
from ..efase.hearing import Heard, Hearing
from ..efase.nodes import Nodes
from ..efase.plan import Plan, Solved, plan_speech
from ..efase.search import Engine, SearchIndex, Stretch
from ..efase.soft import Mix, StepMatrix, soft_search
from ..efase.steps import cost_along, step_matrix
from ..efase.stream import EfaseStream
from ..errors import FacesynthError, reject_options, unknown
from ..filters import at_rate, sharpen
from ..last_search import LastSearch
from ..layout import Layout
from ..lips import gap, has_lips
from ..long_arrays import Growing, by_blocks, row_blocks
from ..motion import Motion
from ..phones import BILABIALS, LABIODENTALS, PHONES, SILENCE, viseme_of
from ..residual import ResidualMotion, main_emotion
from ..speech import NEUTRAL, Speech, frame_bounds

LIP_PHONES = BILABIALS | LABIODENTALS
"""Never said by another viseme class while their own has a node: everybody sees lips that do not close."""
OPTIONS = ("seed", "fps", "constraints", "look_ahead")


@dataclass(frozen=True)
class Settings:
    """How speech is made from the nodes."""

    database_fps: float
    """Rate of the nodes, Hz."""
    smoothing: Smoothing
    bridge_pauses: bool = False
    """Whether silence is a step of the search; see `plan`."""
    temperature: float = 0.0
    """0: the cheapest path; above, in units of the cost, the mean over paths; see `soft`."""
    candidates: int = 150
    """Nodes of each phone that such a mean is taken over."""
    sharpening: float = 0.0
    """How much quick movement is raised."""
    expected_share: float = 0.0
    """How much of the pose, before it is sharpened, is the expected one; the search's is the rest."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What a trained model consists of."""

    layout: Layout
    fps: float
    """Of the recordings, Hz."""
    emotions: tuple[str, ...]
    nodes: Nodes
    names: Sequence[str]
    """[N] utterance of each node and number of the phone in it."""
    rest: Floats
    """[E, D] rest pose in each emotion."""
    weights: Weights
    bounds: Mapping[str, NDArray[Any]]
    """Tables of `step_bounds`."""
    settings: Settings
    decode: Callable[[NDArray[np.float32]], NDArray[np.float32]]
    """PCA coordinates [T, D] to frames [T, C]."""
    hearing: Hearing | None = None
    engine: Engine | None = None
    """What searches whole stretches; numpy unless another is given."""
    step_matrix: StepMatrix = step_matrix
    """What computes the costs of the steps that a mean over paths needs."""
    mix: Mix | None = None
    """What takes means over paths; numpy unless another is given."""
    residual: ResidualMotion | None = None
    """What moves beside the lips, whatever is said."""
    shares: Floats | None = None
    """[2, D] of each component, how much of what the search finds and of what is expected; else `expected_share` says both."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that the model came from, if it came from one."""


class Efase:
    """Constrained dynamic programming over captured motion nodes (Deng & Neumann 2008), trained."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.manifest, self.settings = parts, parts.manifest, parts.settings
        self.layout, self.fps, self.emotions = parts.layout, parts.fps, parts.emotions
        self.nodes, self.names, self.weights = parts.nodes, parts.names, parts.weights
        self.hearing, self.database_fps = parts.hearing, parts.settings.database_fps
        self._captured = set(parts.nodes.visemes.tolist())
        self._gaps: dict[int, float] = {}
        self._last: LastSearch[dict[str, float]] = LastSearch()

    @cached_property
    def index(self) -> SearchIndex:
        """What the numpy search prepares."""
        return SearchIndex(self.nodes, self.weights, self.parts.bounds)

    def synthesize(
        self,
        speech: Speech,
        *,
        seed: int = 0,
        fps: float | None = None,
        constraints: Mapping[int, str] | None = None,
        look_ahead: int | None = None,
        **options: Any,
    ) -> Motion:
        """Motion at `fps` (the corpus's rate unless given). Nothing is random: `seed` changes nothing.

        constraints: phone index -> node name. look_ahead: settle each phone when that many more are known, as a stream
        does, in place of the whole search.

        One after the other, at the database's rate: what is heard and expected (`hearing`); the cheapest path of each
        stretch of speech (`search`) and, above temperature 0, the mean over paths around it (`soft`); nodes stretched to
        their phones, joints smoothed, silence filled (`assembly`); `sharpen`; PCA decoded; the neutral rendering blended in
        where an emotion is weak; lips closed at p, b, m (`closures`); then the motion is resampled to `fps`, and what moves
        beside the lips is added (`residual`).
        """
        reject_options("efase", options, OPTIONS)
        new_fps = self.fps if fps is None else float(fps)
        if not (np.isfinite(new_fps) and new_fps > 0):
            raise FacesynthError(f"fps is {fps}; wanted a positive rate in Hz, or None for the model's {self.fps:g}")
        plans = self.plans(speech, constraints=constraints, look_ahead=look_ahead)
        self._last.keep(speech, (dict(constraints or {}), look_ahead), self._shares(plans[0]))
        return self.moved(speech, plans, new_fps)

    def plans(self, speech: Speech, *, constraints: Mapping[int, str] | None = None, look_ahead: int | None = None) -> list[Plan]:
        """One in the emotions of the track and, where one of those is weak, one in neutral."""
        plans = [self.plan(speech, constraints=constraints, look_ahead=look_ahead)]
        if bool((speech.emotions.per_phone(speech.phones)[1] < 1).any()) and NEUTRAL in self.emotions:
            plans.append(self.plan(speech, emotion=NEUTRAL, constraints=constraints, look_ahead=look_ahead))
        return plans

    def moved(self, speech: Speech, plans: Sequence[Plan], fps: float | None = None) -> Motion:
        """The motion of the speech that was planned, at `fps` (the corpus's rate unless given)."""
        labels, ends_s, new_fps = speech.phones.labels, speech.phones.ends_s, self.fps if fps is None else fps
        feelings, intensity = speech.emotions.per_phone(speech.phones)
        frames = self.frames(plans, labels, feelings, intensity, frame_bounds(ends_s, self.database_fps))
        made = self.resampled(frames, new_fps, int(frame_bounds(ends_s, new_fps)[-1]))
        return Motion(self.with_residual(made, speech, new_fps), new_fps, self.layout)

    def beside_lips(self, speech: Speech, fps: float, count: int) -> NDArray[np.float32]:
        """[count, C] recorded movement that is added beside the lips; 0 where the model keeps none."""
        return self.with_residual(np.zeros((count, self.layout.channels), np.float32), speech, fps)

    def with_residual(self, frames: NDArray[np.float32], speech: Speech, fps: float) -> NDArray[np.float32]:
        """Frames [T, C] with recorded movement beside the lips, as they are where the model keeps none."""
        if self.parts.residual is None:
            return frames
        return self.parts.residual.added(frames, speech, main_emotion(speech, self.emotions), fps)

    def plan(
        self,
        speech: Speech,
        *,
        emotion: str | None = None,
        constraints: Mapping[int, str] | None = None,
        look_ahead: int | None = None,
    ) -> Plan:
        """Search; `emotion` replaces the track's, `constraints` gives nodes by phone index."""
        query, heard = self.asked(speech, emotion, constraints)
        solve = self.solved
        if look_ahead is not None:
            self._require_steps()
            solve = partial(self.solved, engine=_looking_ahead(self.index, look_ahead))
        plan = plan_speech(query, solve, bridge_pauses=self.settings.bridge_pauses)
        return plan if heard is None else replace(plan, expected=heard.poses)

    def solved(self, query: Query, engine: Engine | None = None) -> Solved:
        """One stretch of speech: its cheapest path and, above temperature 0, the mean over paths around it."""
        targets, temperature = all_targets(self.nodes, query, self.weights), self.settings.temperature
        path = (engine or self.parts.engine or self.index.cheapest_path)(targets)
        cost, mixtures = cost_along(self.nodes, targets, path, self.weights), None
        if temperature > 0:
            limit, matrix = self.settings.candidates, self.parts.step_matrix
            mixtures = soft_search(self.nodes, query, targets, self.weights, path, temperature, limit, matrix, self.parts.mix)
        return Solved(path, cost, mixtures)

    def asked(
        self, speech: Speech, emotion: str | None = None, constraints: Mapping[int, str] | None = None
    ) -> tuple[Query, Heard | None]:
        """What the search is asked for, what is heard included, and what that is."""
        labels = speech.phones.told("efase").labels
        feelings = [emotion] * len(labels) if emotion else speech.emotions.per_phone(speech.phones)[0]
        query = self.query(labels, feelings, {t: self._node_index(t, name, labels) for t, name in (constraints or {}).items()})
        if self.hearing is None:
            return query, None
        heard = self.hearing.hear(speech, query.emotions, len(self.nodes), self.database_fps)
        return replace(query, heard=heard.costs), heard

    def query(self, labels: Sequence[str], feelings: Sequence[str], fixed: Mapping[int, int] | None = None) -> Query:
        """What phones in these emotions ask for; fixed: position -> node."""
        visemes, fixed = np.array([viseme_of(label) for label in labels]), fixed or {}
        silent = np.array([label == SILENCE for label in labels])
        strict = [
            label in LIP_PHONES and viseme in self._captured and t not in fixed
            for t, (label, viseme) in enumerate(zip(labels, visemes.tolist(), strict=True))
        ]
        phones = np.array([PHONES.index(label) for label in labels])
        felt = np.array([self._emotion_index(feeling) for feeling in feelings])
        return Query(np.where(silent, -1, phones), np.where(silent, -1, visemes), felt, fixed, np.array(strict))

    def stream(self, *, look_ahead: int | None = None, weakened: bool = False, fps: float | None = None) -> EfaseStream:
        """Phones one by one. Without `look_ahead`, a stretch is searched as a whole and settled by the silence after it.

        weakened: intensities below 1 will come; then every phone is searched for in neutral, too.
        """
        self._require_steps()
        return EfaseStream(self, look_ahead, weakened, self.fps if fps is None else fps)

    def explain(self, speech: Speech, *, constraints: Mapping[int, str] | None = None) -> list[dict[str, Any]]:
        """Chosen node, cost terms and runners-up for each phone."""
        plan = self.plan(speech, constraints=constraints)
        return explain(self.nodes, self.names, self.emotions, plan.query, plan.nodes, self.weights)

    def report(self, speech: Speech, *, constraints: Mapping[int, str] | None = None) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion."""
        asked = dict(constraints or {}), None
        return self._last.of(speech, asked, lambda: self._shares(self.plan(speech, constraints=constraints)))

    def _shares(self, plan: Plan) -> dict[str, float]:
        return shares(self.nodes, plan.query, plan.nodes)

    def joins(self, speech: Speech) -> Ints:
        """Frames, at the corpus's rate, at which nodes were joined that were not recorded in a row."""
        labels, bounds = speech.phones.labels, speech.phones.frame_bounds(self.fps)
        return joints(self.nodes, self.plan(speech).nodes, labels, bounds)

    def frames(
        self, plans: Sequence[Plan], labels: Sequence[str], feelings: Sequence[str], intensity: Floats, bounds: Ints
    ) -> Floats:
        """[T, C] at the database's rate; two plans are one in the emotions and one in neutral, mixed by intensity [P]."""
        frames = self._decoded(plans[0], labels, feelings, bounds)
        if len(plans) > 1:
            neutral = self._decoded(plans[1], labels, [NEUTRAL] * len(labels), bounds)
            frames = blend(neutral, frames, intensity, bounds, self.database_fps)
        if has_lips(self.layout):
            wanted = np.max([self._closures(plan, labels) for plan in plans], axis=0)
            frames = close_lips(frames, wanted, self.layout, bounds, self.database_fps)
        return by_blocks(lambda some: some.astype(np.float32), frames, np.float64)

    def resampled(self, frames: Floats, fps: float, count: int) -> NDArray[np.float32]:
        """[count, C] frames at another rate."""
        made = frames
        if fps != self.database_fps:
            new = np.arange(max(round(len(frames) / self.database_fps * fps), 1))
            made = at_rate(frames, self.database_fps, fps, np.minimum(new * self.database_fps / fps, len(frames) - 1))
            if self.layout.kind == "curves":
                low, high = frames.min(axis=0), frames.max(axis=0)
                made = by_blocks(lambda some: np.clip(some, low, high), made, np.float64)
        parts = Growing()
        for rows in row_blocks(made[:count]):
            parts.add(made[rows])
        return parts.add(np.repeat(made[-1:], max(0, count - len(made)), axis=0)).whole()

    def coordinates(self, plan: Plan, labels: Sequence[str], feelings: Sequence[str], bounds: Ints) -> Floats:
        """[T, D] PCA coordinates of a plan, silence at rest in each phone's feeling, not yet sharpened.

        Where a pose is expected of each frame, `expected_share` of it, or learned shares of both for each component: what a mean
        over recorded movements and a regression miss is not the same, so their mean is nearer than either (docs/frontier.md).
        """
        found = self.found(plan, labels, feelings, bounds)
        if plan.expected is not None and self.parts.shares is not None:
            own, expected = self.parts.shares
            return np.asarray(own * found + expected * plan.expected)
        if plan.expected is None or self.settings.expected_share == 0:
            return found
        return found + self.settings.expected_share * (plan.expected - found)

    def found(self, plan: Plan, labels: Sequence[str], feelings: Sequence[str], bounds: Ints) -> Floats:
        """[T, D] what the search found alone, joints smoothed and silence filled."""
        rest = self.parts.rest[[self._emotion_index(feeling) for feeling in feelings]]
        fps, smoothing = self.database_fps, self.settings.smoothing
        return concatenate(self.nodes, plan.nodes, labels, bounds, rest, fps, smoothing, plan.mixtures, plan.expected)

    def _decoded(self, plan: Plan, labels: Sequence[str], feelings: Sequence[str], bounds: Ints) -> Floats:
        coordinates = self.coordinates(plan, labels, feelings, bounds)
        return self._frames_of(sharpen(coordinates, self.settings.sharpening, self.database_fps))

    def _frames_of(self, coordinates: Floats) -> Floats:
        return by_blocks(lambda some: self.parts.decode(some.astype(np.float32)), coordinates, np.float64)

    def _require_steps(self) -> None:
        """A mean over paths, and a pose that is expected, look at the whole of what is said."""
        if self.settings.temperature > 0 or self.hearing or self.settings.sharpening > 0:
            raise FacesynthError(
                "this model takes means over paths or hears: it wants whole utterances; for streams and look_ahead take one "
                "trained with temperature=0 audio_weight=0 pose_weight=0 sharpening=0"
            )

    def _closures(self, plan: Plan, labels: Sequence[str]) -> Floats:
        """[P] smallest lip gap of the node at each p, b, m as it was captured (the mean of a mixture's); NaN elsewhere."""
        wanted = np.full(len(labels), np.nan)
        for k, (label, node) in enumerate(zip(labels, plan.nodes.tolist(), strict=True)):
            if label in BILABIALS and node >= 0:
                mixture = plan.mixtures[k] if plan.mixtures else None
                gaps = self._gaps_of(mixture.nodes.tolist() if mixture else [node])
                wanted[k] = np.dot(mixture.shares, gaps) if mixture else gaps[0]
        return wanted

    def _gaps_of(self, which: list[int]) -> list[float]:
        """Smallest lip gap of some nodes as they were captured."""
        new = [node for node in which if node not in self._gaps]
        if new:
            frames = self._frames_of(np.concatenate([self.nodes.motion(node) for node in new]))
            parts = np.split(gap(frames, self.layout), np.cumsum(self.nodes.lengths[new])[:-1])
            self._gaps |= {node: float(part.min()) for node, part in zip(new, parts, strict=True)}
        return [self._gaps[node] for node in which]

    def _emotion_index(self, emotion: str) -> int:
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)
        return self.emotions.index(emotion)

    def _node_index(self, t: int, name: str, labels: Sequence[str]) -> int:
        if not 0 <= t < len(labels):
            raise FacesynthError(f"there is no phone {t} to constrain; the input has phones 0 to {len(labels) - 1}")
        if labels[t] == SILENCE:
            raise FacesynthError(f"phone {t} is silence, which has no node; constrain a phone that is spoken")
        if name not in self._numbers:
            raise unknown("node", name, self._numbers)
        return self._numbers[name]

    @cached_property
    def _numbers(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.names)}


def _looking_ahead(index: SearchIndex, look_ahead: int) -> Engine:
    def path(targets: Floats) -> Ints:
        stretch = Stretch(index, look_ahead)
        for target in targets:
            stretch.push(target)
        return stretch.finish()

    return path
