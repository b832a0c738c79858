"""eFASE as a method of the zoo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.closures import close_lips
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.filters import sharpen
from facesynth.inference.lips import gap, has_lips
from facesynth.inference.motion import Motion
from facesynth.inference.phones import BILABIALS, LABIODENTALS, PHONES, SILENCE, viseme_of
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Account
from facesynth.methods.efase.audio import AudioTerms, Expected
from facesynth.methods.efase.capabilities import CAPABILITIES
from facesynth.methods.efase.concatenation import Smoothing, concatenate, joints
from facesynth.methods.efase.costs import Query, Weights, target_costs
from facesynth.methods.efase.database import build_database
from facesynth.methods.efase.dense import dense_search, transition_matrix
from facesynth.methods.efase.explanation import explain, shares
from facesynth.methods.efase.intensity import blend
from facesynth.methods.efase.nodes import Floats, MotionNodes
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.plan import Plan, plan_speech
from facesynth.methods.efase.search import Path, SearchIndex, build_index, search
from facesynth.methods.efase.soft import Mixture, soft_search
from facesynth.methods.efase.trees import Forest
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.pca import Pca
from facesynth.motion.resample import resample

NODE_FIELDS = ("starts", "stops", "phones", "visemes", "emotions", "before", "after")
FOREST_FIELDS = ("order", "starts", "stops", "left", "right", "centres", "radii", "roots", "tree_of")
NEUTRAL = "neutral"
LIP_PHONES = BILABIALS | LABIODENTALS
"""Never said by another viseme class while their own has a node: everybody sees lips that do not close."""


@register(CAPABILITIES)
class Efase(Method):
    """Constrained dynamic programming over captured motion nodes (Deng & Neumann 2008).

    The weights alpha … phi are those of the cost (see `Weights`). The defaults were found by `facesynth
    tune` on the full script of the built-in performer (seed 0, 54 evaluations, 24 sentences, a database
    of 300 utterances); configs/efase_published.yaml has those of Deng 2006. `penalty` is PNT as a multiple of
    the median rule-2 transition of the database; `database_fps` the rate at which nodes are cut, `bridge_pauses`
    whether silence is a step of the search (see `plan`).

    `temperature` 0 is the paper: the cheapest path. Above 0 (in median rule-2 transitions, like `penalty`) every
    path counts by exp(-cost / temperature) and a phone is the mean of the `candidates` nodes that may stand there
    (see `soft`): nearer to the truth on average, with less motion. `audio_weight` and `pose_weight` let the sound
    speak in the target cost (see `audio`), `sharpening` raises quick movement (see `sharpening`); 0 in the paper.

    With `learn`, `fit` starts from these weights, learns all that are above 0 on sentences of the corpus that it keeps
    out of the database meanwhile (see `learning`), and leaves what it found in `config`.
    """

    pca: Pca
    node_frames: Tensor
    """[F, D] frames of all nodes."""
    node_table: Tensor
    """[7, N] the columns NODE_FIELDS of the nodes."""
    rest: Tensor
    """[E, D] rest pose in each emotion."""
    nearest: Tensor
    """[N] see `Tables.nearest`."""

    def __init__(
        self,
        components: float = 25,
        database_fps: float = 120.0,
        penalty: float = 34.37,
        alpha: float = 1.042,
        beta: float = 0.3133,
        eta: float = 0.1079,
        gamma: float = 0.3088,
        delta: float = 0.0636,
        phi: float = 0.01373,
        bridge_pauses: bool = False,
        smoothing_firm: float = 2.0,
        smoothing_loose: float = 0.5,
        smoothing_s: float = 0.025,
        smoothing_stiffness: float = 1.0,
        temperature: float = 0.0,
        candidates: int = 150,
        audio_weight: float = 0.0,
        pose_weight: float = 0.0,
        sharpening: float = 0.0,
        learn: bool = False,
    ) -> None:
        super().__init__()
        lowest = min(temperature, audio_weight, pose_weight, sharpening)
        if lowest < 0 or candidates < 1:
            raise FacesynthError(
                "temperature, audio_weight, pose_weight and sharpening must be at least 0, candidates at least 1; "
                f"got {lowest:g} and {candidates}"
            )
        self.smoothing = Smoothing(smoothing_firm, smoothing_loose, smoothing_s, smoothing_stiffness)
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.audio = AudioTerms(audio=audio_weight > 0, pose=pose_weight > 0)
        self._index: SearchIndex | None = None
        self._transitions: Tensor | None = None
        self._gaps: dict[int, float] = {}

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Cut the corpus into nodes and prepare the search.

        `seed` picks the pairs that PNT is scaled by, and the sentences that `learn` holds out.
        """
        learned = None
        if self.config["learn"]:
            from facesynth.methods.efase.learning import learn  # it needs this class

            learned = learn(corpus, self.config, seed=seed)
            self.config |= learned.settings
        self.learned_from(corpus)
        database = build_database(corpus, self.config["database_fps"], self.config["components"])
        nodes = database.nodes
        self.pca = database.pca
        self.facts = {"names": list(database.names), "unusable_phones": database.unusable, "barren": list(database.barren)}
        self.register_buffer("node_frames", torch.from_numpy(nodes.frames.astype(np.float32)))
        self.register_buffer("node_table", torch.from_numpy(np.stack([getattr(nodes, f) for f in NODE_FIELDS])))
        self.register_buffer("rest", torch.from_numpy(database.rest.astype(np.float32)))
        self.facts["median_transition"] = median_transition(self.nodes(), replace(self.weights(), pnt=1.0), seed)
        self.audio.learn(corpus, self.pca, database.names, nodes.phones, seed)
        if learned is not None:
            self.audio.count_by(learned.sound_metric, learned.pose_metric)
            self.facts["learned"] = learned.account
        self._keep_index()
        return self

    @classmethod
    def load(cls, path: Any) -> Self:
        """See `Method.load`."""
        method = super().load(path)
        wanted = ("node_frames", "node_table", "rest", "nearest", *(f"forest_{field}" for field in FOREST_FIELDS))
        if missing := [name for name in wanted if not hasattr(method, name)]:
            raise FacesynthError(f"{path} is damaged: it holds no {', '.join(missing)}; train it again")
        count, listed = method.node_table.shape[-1], len(method.facts.get("names", []))
        if count != listed or count != len(method.nearest):
            raise FacesynthError(f"{path} lists {listed} nodes but holds {count}; train it again")
        if int(method.node_table[NODE_FIELDS.index("stops")].max()) > len(method.node_frames):
            raise FacesynthError(
                f"{path} is damaged: it holds {len(method.node_frames)} frames, fewer than its nodes; train it again"
            )
        return method

    def weights(self) -> Weights:
        """The cost's parameters, PNT in the units of this database."""
        names = ("alpha", "beta", "eta", "gamma", "delta", "phi")
        pnt = self.config["penalty"] * (self.facts.get("median_transition") or 1.0)
        return Weights(pnt, **{name: self.config[name] for name in names})

    def nodes(self) -> MotionNodes:
        """The database."""
        _ = self.fitted_layout
        table = self.node_table.cpu().numpy()
        return MotionNodes(self.node_frames.cpu().numpy().astype(np.float64), *table)

    def index(self) -> SearchIndex:
        """The prepared search, made from what the model file keeps."""
        if self._index is None:
            forest = Forest(
                **{field: getattr(self, f"forest_{field}").cpu().numpy() for field in FOREST_FIELDS},
            )
            self._index = build_index(self.nodes(), self.weights(), forest, self.nearest.cpu().numpy())
        return self._index

    def plan(self, speech: Speech, *, emotion: str | None = None, constraints: Mapping[int, str] | None = None) -> Plan:
        """Search; `emotion` replaces the track's, `constraints` gives nodes by phone index."""
        query, expected = self.asked(speech, emotion, constraints)
        soften = self._soften if self.config["temperature"] > 0 else None
        plan = plan_speech(query, self._search, soften, bridge_pauses=self.config["bridge_pauses"])
        return replace(plan, expected=expected.poses)

    def asked(
        self, speech: Speech, emotion: str | None = None, constraints: Mapping[int, str] | None = None
    ) -> tuple[Query, Expected]:
        """What the search is asked for, audio costs included, and what the sound leads one to expect."""
        query = self._query(speech, emotion, constraints or {})
        if self.audio.empty:
            return query, Expected(None, None)
        labels, bounds = self._phones(speech)
        expected = self.audio.hear(speech, query.emotions, len(self.emotions), self.config["database_fps"], int(bounds[-1]))
        spoken = np.array([label != SILENCE for label in labels])
        return replace(query, heard=self.audio.costs(self.nodes(), expected, bounds, spoken, self.audio_weights())), expected

    def audio_weights(self) -> tuple[float, float]:
        """Of the sound (in this database's median transition) and of the expected pose."""
        return self.config["audio_weight"] * (self.facts.get("median_transition") or 1.0), self.config["pose_weight"]

    def _soften(self, query: Query, path: Path) -> list[Mixture]:
        nodes, weights = self.nodes(), self.weights()
        targets = np.stack([target_costs(nodes, query, t, weights) for t in range(len(query))])
        return soft_search(nodes, query, targets, weights, path.nodes, self.temperature, self.config["candidates"])

    @property
    def temperature(self) -> float:
        """In the units of this database."""
        return float(self.config["temperature"] * (self.facts.get("median_transition") or 1.0))

    def _search(self, query: Query) -> Path:
        if self.node_frames.device.type == "cpu":
            return search(self.index(), query)
        nodes, weights = self.nodes(), self.weights()
        if self._transitions is None:
            self._transitions = transition_matrix(nodes, weights, str(self.node_frames.device))
        return dense_search(nodes, query, weights, self._transitions)

    def synthesize(
        self,
        speech: Speech,
        *,
        seed: int = 0,
        fps: float | None = None,
        constraints: Mapping[int, str] | None = None,
    ) -> Motion:
        """Motion at `fps` (the corpus's rate unless given); constraints: phone index -> node name.

        One after the other, at `database_fps`: what is heard and expected (`audio`); the cheapest path of each stretch of
        speech (`search`) and, above temperature 0, the mean over paths around it (`soft`); nodes stretched to their
        phones, joints smoothed, silence filled (`concatenation`); `sharpen`; PCA decoded; the neutral rendering blended in
        where an emotion is weak; lips closed at p, b, m (`closures`); then the motion is resampled to `fps`.
        """
        _ = self.fitted_layout
        _, bounds = self._phones(speech)
        intensity = speech.emotions.per_phone(speech.phones)[1]
        layout, database_fps = self.fitted_layout, self.config["database_fps"]
        plans = [self.plan(speech, constraints=constraints)]
        frames = self._decode(speech, plans[0])
        if (intensity < 1).any() and NEUTRAL in self.emotions:
            plans.append(self.plan(speech, emotion=NEUTRAL, constraints=constraints))
            frames = blend(self._decode(speech, plans[1], NEUTRAL), frames, intensity, bounds, database_fps)
        if has_lips(layout):
            wanted = np.max([self._closures(plan, speech.phones.labels) for plan in plans], axis=0)
            frames = close_lips(frames, wanted, layout, bounds, database_fps)
        motion = Motion(frames.astype(np.float32), database_fps, layout)
        return _of_length(resample(motion, fps or self.fps), speech)

    def explain(self, speech: Speech, *, constraints: Mapping[int, str] | None = None) -> list[dict[str, Any]]:
        """Chosen node, cost terms and runners-up for each phone."""
        plan = self.plan(speech, constraints=constraints)
        return explain(self.nodes(), self.facts["names"], self.emotions, plan.query, plan.nodes, self.weights())

    def report(self, speech: Speech, *, constraints: Mapping[int, str] | None = None) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion."""
        plan = self.plan(speech, constraints=constraints)
        return shares(self.nodes(), plan.query, plan.nodes)

    def account(self, speech: Speech, *, constraints: Mapping[int, str] | None = None) -> Account:
        """The shares of `report`."""
        return Account(self.report(speech, constraints=constraints))

    def joins(self, speech: Speech) -> np.ndarray:
        """Frames, at the corpus's rate, at which nodes were joined that were not recorded in a row."""
        plan = self.plan(speech)
        labels, bounds = speech.phones.labels, speech.phones.frame_bounds(self.fps)
        return joints(self.nodes(), plan.nodes, labels, bounds)

    def rest_of(self, speech: Speech, emotion: str | None = None) -> Floats:
        """[P, D] the rest pose at each phone, in its emotion or in the one given."""
        felt = [emotion] * len(speech.phones) if emotion else speech.emotions.per_phone(speech.phones)[0]
        return self.rest.cpu().numpy().astype(np.float64)[[self._emotion_index(e) for e in felt]]

    def with_weights(self, **weights: float) -> Self:
        """The same database under other parameters of the cost, sharing its arrays."""
        other = type(self).from_config({**self.config, **weights})
        other.audio.share(self.audio)
        other.layout, other.fps, other.emotions = self.layout, self.fps, self.emotions
        other.facts, other.provenance, other.pca = dict(self.facts), self.provenance, self.pca
        for name in ("node_frames", "node_table", "rest"):
            other.register_buffer(name, getattr(self, name))
        other.facts["median_transition"] = median_transition(other.nodes(), replace(other.weights(), pnt=1.0))
        other._keep_index()
        return other

    def _keep_index(self) -> None:
        self._index, self._gaps = build_index(self.nodes(), self.weights()), {}
        forest = self._index.forest
        for field in FOREST_FIELDS:
            self.register_buffer(f"forest_{field}", torch.from_numpy(getattr(forest, field)))
        self.register_buffer("nearest", torch.from_numpy(self._index.tables.nearest))

    def _closures(self, plan: Plan, labels: Sequence[str]) -> Floats:
        """[P] smallest lip gap of the node at each p, b, m as it was captured (the mean of a mixture's); NaN elsewhere."""
        nodes, wanted = self.nodes(), np.full(len(labels), np.nan)
        for k, (label, node) in enumerate(zip(labels, plan.nodes, strict=True)):
            if label in BILABIALS and node >= 0:
                mixture = plan.mixtures[k] if plan.mixtures else None
                shut = [self._gap(nodes, int(n)) for n in (mixture.nodes if mixture else [node])]
                wanted[k] = np.dot(mixture.shares, shut) if mixture else shut[0]
        return wanted

    def _gap(self, nodes: MotionNodes, node: int) -> float:
        """Smallest lip gap of a node as it was captured."""
        if node not in self._gaps:
            self._gaps[node] = float(gap(decode(self.pca, nodes.motion(node)), self.fitted_layout).min())
        return self._gaps[node]

    def _query(self, speech: Speech, emotion: str | None, constraints: Mapping[int, str]) -> Query:
        labels, _ = self._phones(speech)
        felt = [emotion] * len(labels) if emotion else speech.emotions.per_phone(speech.phones)[0]
        fixed = {t: self._node_index(t, name, labels) for t, name in constraints.items()}
        captured = set(self.node_table[NODE_FIELDS.index("visemes")].tolist())
        strict = [label in LIP_PHONES and viseme_of(label) in captured and t not in fixed for t, label in enumerate(labels)]
        return Query(
            np.array([-1 if label == SILENCE else PHONES.index(label) for label in labels]),
            np.array([-1 if label == SILENCE else viseme_of(label) for label in labels]),
            np.array([self._emotion_index(e) for e in felt]),
            fixed,
            np.array(strict),
        )

    def _phones(self, speech: Speech) -> tuple[tuple[str, ...], np.ndarray]:
        for label in speech.phones.labels:
            viseme_of(label)
        return speech.phones.labels, speech.phones.frame_bounds(self.config["database_fps"])

    def _emotion_index(self, emotion: str) -> int:
        if emotion not in self.emotions:
            raise unknown("emotion", emotion, self.emotions)
        return self.emotions.index(emotion)

    def _node_index(self, t: int, name: str, labels: Sequence[str]) -> int:
        if not 0 <= t < len(labels):
            raise FacesynthError(f"there is no phone {t} to constrain; the input has phones 0 to {len(labels) - 1}")
        if labels[t] == SILENCE:
            raise FacesynthError(f"phone {t} is silence, which has no node; constrain a phone that is spoken")
        names = self.facts["names"]
        if name not in names:
            raise unknown("node", name, names)
        return int(names.index(name))

    def _decode(self, speech: Speech, plan: Plan, emotion: str | None = None) -> Floats:
        labels, bounds = self._phones(speech)
        rest = self.rest_of(speech, emotion)
        fps = self.config["database_fps"]
        coordinates = concatenate(
            self.nodes(), plan.nodes, labels, bounds, rest, fps, self.smoothing, plan.mixtures, plan.expected
        )
        return decode(self.pca, sharpen(coordinates, self.config["sharpening"], fps))


def decode(pca: Pca, coordinates: Floats) -> Floats:
    """PCA coordinates [T, D] to frames [T, C], in float64 outside of the module."""
    device = pca.mean.device
    return pca.decode(torch.from_numpy(coordinates).float().to(device)).cpu().numpy().astype(np.float64)


def _of_length(motion: Motion, speech: Speech) -> Motion:
    """Rounding twice can differ by a frame from rounding once; the phone track decides."""
    wanted = int(speech.phones.frame_bounds(motion.fps)[-1])
    rows = np.minimum(np.arange(wanted), len(motion) - 1)
    return Motion(motion.frames[rows], motion.fps, motion.layout)
