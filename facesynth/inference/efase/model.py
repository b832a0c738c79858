"""Phones in, motion out: at once, or phone by phone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..closures import close_lips
from ..efase.assembly import Plan, Smoothing, concatenate
from ..efase.bounds import StepBounds
from ..efase.nodes import Floats, Ints, Nodes, Query, Weights
from ..efase.search import Search
from ..efase.soft import Mixture, Softness, mixtures
from ..efase.stream import EfaseStream
from ..errors import FacesynthError, reject_options, unknown
from ..filters import at_rate, gaussian, sharpen
from ..folder import Folder
from ..graphs import Graph
from ..layout import Layout
from ..lips import gap, has_lips
from ..motion import Motion
from ..phones import SILENCE
from ..speech import frame_bounds

if TYPE_CHECKING:
    from ..efase.hearing import Heard, Hearing

BILABIALS = frozenset(["p", "b", "m"])
LIP_PHONES = BILABIALS | {"f", "v"}
NEUTRAL = "neutral"
SMOOTH_S = 0.08
OPTIONS = ("seed", "fps", "constraints", "look_ahead")


class Efase:
    """A folder exported from an `efase` model."""

    def __init__(self, folder: Folder, threads: int) -> None:
        manifest, settings, arrays = folder.manifest, folder.settings, folder.arrays()
        self.manifest, self.settings, self.fps = manifest, settings, float(manifest["fps"])
        self.layout, self.emotions = Layout.from_dict(manifest["layout"]), tuple(manifest["emotions"])
        self.database_fps = float(settings["database_fps"])
        self.phones = {phone: (index, viseme) for index, (phone, viseme) in enumerate(manifest["phones"])}
        self.nodes = Nodes.of(arrays, Weights(**settings["weights_of_cost"]))
        self.smoothing = Smoothing(**settings["smoothing"])
        self.rest = arrays["rest"].astype(np.float64)
        self.bounds = StepBounds(self.nodes, arrays)
        self._captured = set(self.nodes.visemes.tolist())
        self._names = arrays["names"].tobytes()
        self._known: dict[str, int] | None = None
        self._decode = Graph(folder, "decode", threads)
        soft = settings["temperature"] > 0
        self.softness = Softness(settings["temperature"], settings["candidates"]) if soft else None
        self.hearing: Hearing | None = None
        if settings["sound_weight"] > 0 or settings["pose_weight"] > 0:
            from ..efase.hearing import Hearing  # only models that hear need it

            self.hearing = Hearing(folder, arrays, self.nodes, threads)
        self._gaps: dict[int, float] = {}

    @property
    def names(self) -> list[str]:
        """[N] of the nodes: utterance and number of the phone in it."""
        return self._names.decode().split("\n")

    @property
    def has_lips(self) -> bool:
        """Whether the gap between the lips can be read off the layout's points."""
        return has_lips(self.layout)

    def synthesize(
        self,
        speech: Any,
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
        """
        reject_options("efase", options, OPTIONS)
        if look_ahead is not None:
            self._require_steps()
        new_fps = self.fps if fps is None else float(fps)
        if not (np.isfinite(new_fps) and new_fps > 0):
            raise FacesynthError(f"fps is {fps}; wanted a positive rate in Hz, or None for the model's {self.fps:g}")
        labels, ends_s = tuple(speech.phones.labels), np.asarray(speech.phones.ends_s, np.float64)
        feelings, intensity = speech.emotions.per_phone(speech.phones)
        weak = bool((intensity < 1).any()) and NEUTRAL in self.emotions
        plans = [self.plan(speech, constraints=constraints, look_ahead=look_ahead)]
        if weak:
            plans.append(self.plan(speech, emotion=NEUTRAL, constraints=constraints, look_ahead=look_ahead))
        frames = self.frames(plans, labels, feelings, intensity, frame_bounds(ends_s, self.database_fps))
        return Motion(self.resampled(frames, new_fps, int(frame_bounds(ends_s, new_fps)[-1])), new_fps, self.layout)

    def plan(
        self,
        speech: Any,
        *,
        emotion: str | None = None,
        constraints: Mapping[int, str] | None = None,
        look_ahead: int | None = None,
    ) -> Plan:
        """Search each stretch of speech between silences, or all of it where the model bridges pauses."""
        labels = tuple(speech.phones.labels)
        feelings = [emotion] * len(labels) if emotion else speech.emotions.per_phone(speech.phones)[0]
        fixed = {t: self._node_index(t, name, labels) for t, name in (constraints or {}).items()}
        queries = [
            self.query(label, feeling, fixed.get(t, -1)) for t, (label, feeling) in enumerate(zip(labels, feelings, strict=True))
        ]
        heard = self._heard(self.hearing, speech, queries) if self.hearing else None
        if heard is not None:
            queries = [replace(query, heard=costs) for query, costs in zip(queries, heard.costs, strict=True)]
        mixed: list[Mixture | None] = [None] * len(labels)
        nodes, cost, stretch = np.full(len(labels), -1, np.int64), 0.0, Stretch(self, look_ahead)
        whole = self.settings["bridge_pauses"]
        for t, query in enumerate(queries):
            if query.phone >= 0 or whole:
                stretch.push(query)
            if t + 1 == len(queries) or (queries[t + 1].phone < 0 and not whole):
                path = stretch.finish()
                if len(path):
                    own = slice(t + 1 - len(path), t + 1)
                    nodes[own] = path
                    cost += self.nodes.cost(queries[own], path)
                    if self.softness:
                        mixed[own] = mixtures(self.nodes, queries[own], path, self.softness)
                stretch = Stretch(self, look_ahead)
        return Plan(nodes, cost, mixed if self.softness else (), heard.poses if heard else None)

    def stream(self, *, look_ahead: int | None = None, weakened: bool = False, fps: float | None = None) -> EfaseStream:
        """Phones one by one. Without `look_ahead`, a stretch is searched as a whole and settled by the silence after it.

        weakened: intensities below 1 will come; then every phone is searched for in neutral, too.
        """
        self._require_steps()
        return EfaseStream(self, look_ahead, weakened, self.fps if fps is None else fps)

    def query(self, label: str, emotion: str, node: int = -1) -> Query:
        """What one phone asks for."""
        if label not in self.phones:
            raise unknown("phone", label, self.phones)
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)
        feeling = self.emotions.index(emotion)
        if label == SILENCE:
            return Query(-1, -1, feeling, node)
        index, viseme = self.phones[label]
        return Query(index, viseme, feeling, node, label in LIP_PHONES and viseme in self._captured and node < 0)

    def frames(
        self, plans: Sequence[Plan], labels: Sequence[str], feelings: Sequence[str], intensity: Floats, bounds: Ints
    ) -> Floats:
        """[T, C] at the database's rate; two plans are one in the emotions and one in neutral, mixed by intensity [P]."""
        moods: list[Sequence[str]] = [feelings, [NEUTRAL] * len(labels)]
        made = [self._decoded(plan, labels, mood, bounds) for plan, mood in zip(plans, moods, strict=False)]
        frames = made[0]
        if len(made) > 1:
            share = gaussian(np.repeat(intensity, np.diff(bounds)), SMOOTH_S * self.database_fps)[:, None]
            frames = made[1] + share * (made[0] - made[1])
        if self.has_lips:
            wanted = np.max([self._closures(plan, labels) for plan in plans], axis=0)
            frames = close_lips(frames, wanted, self.layout, bounds, self.database_fps)
        return frames.astype(np.float32).astype(np.float64)

    def resampled(self, frames: Floats, fps: float, count: int) -> NDArray[np.float32]:
        """[count, C] frames at another rate."""
        made = frames
        if fps != self.database_fps:
            new = np.arange(max(round(len(frames) / self.database_fps * fps), 1))
            made = at_rate(frames, self.database_fps, fps, np.minimum(new * self.database_fps / fps, len(frames) - 1))
            if self.layout.kind == "curves":
                made = np.clip(made, frames.min(axis=0), frames.max(axis=0))
        return made[np.minimum(np.arange(count), len(made) - 1)].astype(np.float32)

    def _require_steps(self) -> None:
        """A mean over paths, and a pose that is expected, look at the whole of what is said."""
        if self.softness or self.hearing or self.settings["sharpening"] > 0:
            raise FacesynthError(
                "this model takes means over paths or hears: it wants whole utterances; for streams and look_ahead export one "
                "trained with temperature=0 audio_weight=0 pose_weight=0 sharpening=0"
            )

    def _heard(self, hearing: Hearing, speech: Any, queries: Sequence[Query]) -> Heard:
        said = [self.phones[label][0] for label in speech.phones.labels]
        spoken = np.array([label != SILENCE for label in speech.phones.labels])
        bounds = frame_bounds(np.asarray(speech.phones.ends_s, np.float64), self.database_fps)
        return hearing.hear(speech, said, [query.emotion for query in queries], spoken, bounds)

    def _decoded(self, plan: Plan, labels: Sequence[str], feelings: Sequence[str], bounds: Ints) -> Floats:
        rest = self.rest[[self.emotions.index(feeling) for feeling in feelings]]
        coordinates = concatenate(self.nodes, plan, labels, bounds, rest, self.database_fps, self.smoothing)
        return self._frames_of(sharpen(coordinates, self.settings["sharpening"], self.database_fps))

    def _frames_of(self, coordinates: Floats) -> Floats:
        return self._decode(coordinates=coordinates.astype(np.float32)[None])[0][0].astype(np.float64)

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

    def _node_index(self, t: int, name: str, labels: Sequence[str]) -> int:
        if not 0 <= t < len(labels):
            raise FacesynthError(f"there is no phone {t} to constrain; the input has phones 0 to {len(labels) - 1}")
        if labels[t] == SILENCE:
            raise FacesynthError(f"phone {t} is silence, which has no node; constrain a phone that is spoken")
        if self._known is None:
            self._known = {known: n for n, known in enumerate(self.names)}
        if name not in self._known:
            raise unknown("node", name, self._known)
        return self._known[name]


class Stretch:
    """A run of phones that is searched as one; with a look-ahead, nodes are settled as it goes.

    With a look-ahead of n, the phone n before the newest one is settled on the best path that goes on from the node settled
    before it. Nothing older is looked at again.
    """

    def __init__(self, model: Efase, look_ahead: int | None) -> None:
        if look_ahead is not None and look_ahead < 1:
            raise FacesynthError(f"look_ahead is {look_ahead}; wanted at least 1 phone, or None for the whole search")
        self.search, self.look_ahead = Search(model.nodes, model.bounds), look_ahead
        self.settled: list[int] = []
        self.pushed = 0

    def push(self, query: Query) -> None:
        """The next phone."""
        self.search.push(query)
        self.pushed += 1
        if self.look_ahead is not None and self.pushed > self.look_ahead:
            self.settled.append(int(self.search.trace(self.look_ahead + 1)[0]))
            self.search.settle(self.settled[-1], self.look_ahead)

    def finish(self) -> Ints:
        """[P] a node for each phone."""
        if not self.pushed:
            return np.zeros(0, np.int64)
        rest = self.search.trace(self.pushed - len(self.settled))
        return np.concatenate([np.array(self.settled, np.int64), rest])
