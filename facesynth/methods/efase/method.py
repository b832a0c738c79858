"""eFASE as a method of the zoo."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.corpus.journal import Edits
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.assembly import Smoothing
from facesynth.inference.efase.bounds import TABLES, step_bounds
from facesynth.inference.efase.changed_bounds import changed_bounds
from facesynth.inference.efase.costs import Query, Weights
from facesynth.inference.efase.hearing import Heard
from facesynth.inference.efase.model import Efase as Speaker
from facesynth.inference.efase.model import Parts, Settings
from facesynth.inference.efase.nodes import COLUMNS, Nodes
from facesynth.inference.efase.plan import Plan
from facesynth.inference.efase.stream import EfaseStream
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Account
from facesynth.methods.efase.audio import AudioTerms
from facesynth.methods.efase.capabilities import CAPABILITIES
from facesynth.methods.efase.database import build_database
from facesynth.methods.efase.edits import Changed, EditsEditor, changed_nodes, edits_key
from facesynth.methods.efase.maps import Decode, cluster_of, frames_of, map_beside, mapped_phones, places_of_all
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.torch_search import torch_engine, torch_mix
from facesynth.methods.learn.hearing import Features
from facesynth.methods.learn.residual import Residual
from facesynth.methods.method import Method, Prepared
from facesynth.methods.registry import register
from facesynth.motion.maps.phone_map import Kind, PhoneMap
from facesynth.motion.pca import Pca

METRICS = ("sound_metric", "pose_metric")
"""Of the account of learning, the parts that are put to use."""


@register(CAPABILITIES)
class Efase(Method):
    """Constrained dynamic programming over captured motion nodes (Deng & Neumann 2008).

    The weights alpha … phi are those of the cost (see `Weights`). The defaults were found by `facesynth tune` over a real talker,
    the built-in performer, and that as articulography records it (docs/results.md); configs/efase_published.yaml has those of
    Deng 2006, configs/efase_one_performer.yaml those that the soft form starts from. `penalty` is PNT as a multiple of
    the median rule-2 transition of the database; `database_fps` the rate at which nodes are cut, `bridge_pauses`
    whether silence is a step of the search (see `plan`).

    `temperature` 0 is the paper: the cheapest path. Above 0 (in median rule-2 transitions, like `penalty`) every
    path counts by exp(-cost / temperature) and a phone is the mean of the `candidates` nodes that may stand there
    (see `soft`): nearer to the truth on average, with less motion. `audio_weight` and `pose_weight` let the sound
    speak in the target cost (see `audio`), `expected_share` is how much of the pose that is shown is the expected one in place
    of the search's (0..1; with `learn`, where shares of each component start, see `shares`), `sharpening` raises quick movement
    (see `sharpening`), `residual` is how much is added of what recorded faces do beside their lips (see `inference.residual`);
    0 in the paper.

    With `learn`, training starts from these weights and learns all that are above 0 on sentences of the corpus that it
    keeps out of the database meanwhile (see `learning`) before it fits with what it found. With `maps`, the Isomap of each
    phone's frames is kept in the model (8 bytes a frame); without, it is made when it is asked for. `features` (`log_mel`,
    `phone_net` or `both`) are what sounds are compared by and poses expected from, and poses are learned from `voices` changed
    sounds of each recording as well (see `PosePredictor`).
    """

    pca: Pca
    node_frames: Tensor
    """[F, D] frames of all nodes."""
    node_table: Tensor
    """[6, N] the COLUMNS of the nodes."""
    rest: Tensor
    """[E, D] rest pose in each emotion."""
    bounds_in: Tensor
    bounds_out: Tensor
    bounds_scale: Tensor
    """Tables of `step_bounds`."""

    def __init__(
        self,
        components: float = 25,
        database_fps: float = 120.0,
        penalty: float = 3.954,
        alpha: float = 2.124,
        beta: float = 8.259,
        eta: float = 7.027,
        gamma: float = 0.3163,
        delta: float = 1.078,
        phi: float = 1.355,
        bridge_pauses: bool = False,
        smoothing_firm: float = 2.0,
        smoothing_loose: float = 0.5,
        smoothing_s: float = 0.025,
        smoothing_stiffness: float = 1.0,
        temperature: float = 0.0,
        candidates: int = 150,
        audio_weight: float = 0.0,
        pose_weight: float = 0.0,
        expected_share: float = 0.0,
        sharpening: float = 0.0,
        residual: float = 0.0,
        learn: bool = False,
        maps: bool = True,
        features: Features = "log_mel",
        voices: int = 0,
    ) -> None:
        super().__init__()
        lowest = min(temperature, audio_weight, pose_weight, sharpening, residual)
        if lowest < 0 or candidates < 1:
            raise FacesynthError(
                "temperature, audio_weight, pose_weight, sharpening and residual must be at least 0, candidates at least 1; "
                f"got {lowest:g} and {candidates}"
            )
        if not 0 <= expected_share <= 1 or (expected_share > 0 and pose_weight == 0):
            raise FacesynthError(
                "expected_share is a share of the pose, 0 to 1, and wants a pose_weight above 0, with which a pose is expected; "
                f"got {expected_share:g} and a pose_weight of {pose_weight:g}"
            )
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.audio = AudioTerms(audio=audio_weight > 0, pose=pose_weight > 0, features=features, voices=voices)
        self.residual = Residual() if residual > 0 else None
        self._speaker: Speaker | None = None
        self._edited: tuple[Any, Self] | None = None

    @classmethod
    def prepared(cls, config: Mapping[str, Any], corpus: Corpus, seed: int) -> Prepared:
        """With `learn`, the weights learned on sentences held out; the account has the metrics and shares as well."""
        if not config["learn"]:
            return Prepared(config)
        from facesynth.methods.efase.learning import learn  # it trains this class on a part of the corpus

        learned = learn(corpus, config, seed=seed)
        return Prepared({**config, **learned.settings, "learn": False}, learned.account)

    def remember(self, account: Mapping[str, Any]) -> None:
        """Keep what was learned, and let the components of sound and pose count as it says."""
        super().remember({key: value for key, value in account.items() if key not in (*METRICS, "shares")})
        if account:
            self.count_by(*(account[metric] for metric in METRICS))
            self.set_shares(account["shares"])

    def count_by(self, sound: Sequence[float], pose: Sequence[float]) -> None:
        """Let the squared differences of each component of the sound and of the pose count by these factors."""
        self.audio.count_by(sound, pose)
        self._speaker = self._edited = None

    def set_shares(self, shares: Sequence[Sequence[float]]) -> None:
        """Of each component [2, D] so much of what the search finds and of what is expected; none: `expected_share` says it."""
        self.register_buffer("component_shares", torch.tensor(shares, dtype=torch.float32))
        self._speaker = self._edited = None

    @property
    def shares(self) -> Floats | None:
        """[2, D] what `set_shares` was told; None where `expected_share` says it."""
        shares: Tensor | None = getattr(self, "component_shares", None)
        return shares.cpu().double().numpy() if shares is not None and shares.numel() else None

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Cut the corpus into nodes and prepare the search; `seed` picks the pairs that PNT is scaled by."""
        if self.config["learn"]:
            raise FacesynthError("learn=true is learned before fit; train with facesynth.methods.training.train")
        device = self.device
        self.learned_from(corpus)
        database = build_database(corpus, self.config["database_fps"], self.config["components"])
        nodes = database.nodes
        self.pca = database.pca.to(device)
        self.facts = {"names": list(database.names), "unusable_phones": database.unusable, "barren": list(database.barren)}
        self.facts["removed"] = sorted(corpus.removed_nodes())
        self.register_buffer("node_frames", torch.from_numpy(nodes.frames.astype(np.float32)))
        self.register_buffer("node_table", torch.from_numpy(np.stack([getattr(nodes, column) for column in COLUMNS])))
        self.register_buffer("rest", torch.from_numpy(database.rest.astype(np.float32)))
        self.facts["median_transition"] = median_transition(self.nodes(), replace(self.weights(), pnt=1.0), seed)
        self.audio.learn(corpus, self.pca, database.names, nodes.phones, seed)
        if self.residual is not None:
            self.facts["no_residual"] = self.residual.learn(corpus)
        self._keep_bounds()
        self._keep_maps(keep=self.config["maps"])
        return self.to(device)

    @classmethod
    def load(cls, path: Any) -> Self:
        """See `Method.load`."""
        method = super().load(path)
        wanted = ("node_frames", "node_table", "rest", *TABLES)
        if missing := [name for name in wanted if not hasattr(method, name)]:
            raise FacesynthError(f"{path} is damaged: it holds no {', '.join(missing)}; train it again")
        count, listed = method.node_table.shape[-1], len(method.facts.get("names", []))
        if count != listed or count != method.bounds_out.shape[-1]:
            raise FacesynthError(f"{path} lists {listed} nodes but holds {count}; train it again")
        if int(method.node_table[COLUMNS.index("stops")].max()) > len(method.node_frames):
            raise FacesynthError(
                f"{path} is damaged: it holds {len(method.node_frames)} frames, fewer than its nodes; train it again"
            )
        return method

    def weights(self) -> Weights:
        """The cost's parameters, PNT in the units of this database."""
        names = ("alpha", "beta", "eta", "gamma", "delta", "phi")
        return Weights(self.config["penalty"] * self._unit, **{name: self.config[name] for name in names})

    def audio_weights(self) -> tuple[float, float]:
        """Of the sound (in this database's median transition) and of the expected pose."""
        return self.config["audio_weight"] * self._unit, self.config["pose_weight"]

    @property
    def temperature(self) -> float:
        """In the units of this database."""
        return float(self.config["temperature"] * self._unit)

    @property
    def _unit(self) -> float:
        return self.facts.get("median_transition") or 1.0

    def nodes(self) -> Nodes:
        """The database."""
        _ = self.fitted_layout
        return Nodes(self.node_frames.cpu().numpy(), *self.node_table.cpu().numpy())

    @property
    def speaker(self) -> Speaker:
        """What speaks from the trained arrays, as an exported model does."""
        if self._speaker is None:
            nodes, layout = self.nodes(), self.fitted_layout
            self._speaker = Speaker(
                Parts(
                    layout=layout,
                    fps=self.fps,
                    emotions=self.emotions,
                    nodes=nodes,
                    names=self.facts["names"],
                    rest=self.rest.cpu().numpy().astype(np.float64),
                    weights=self.weights(),
                    bounds={name: getattr(self, name).cpu().numpy() for name in TABLES},
                    settings=self.settings(),
                    decode=self._decode,
                    hearing=self.audio.heard_by(nodes, self.audio_weights()),
                    **self._search(),
                    residual=self.residual.motion(self.fps, self.config["residual"]) if self.residual else None,
                    shares=self.shares,
                )
            )
        return self._speaker

    def settings(self) -> Settings:
        """How speech is made from the nodes, in the units of this database."""
        config = self.config
        smoothing = Smoothing(*(config[f"smoothing_{name}"] for name in ("firm", "loose", "s", "stiffness")))
        return Settings(
            database_fps=config["database_fps"],
            smoothing=smoothing,
            bridge_pauses=config["bridge_pauses"],
            temperature=self.temperature,
            candidates=config["candidates"],
            sharpening=config["sharpening"],
            expected_share=config["expected_share"],
        )

    def asked(
        self, speech: Speech, emotion: str | None = None, constraints: Mapping[int, str] | None = None
    ) -> tuple[Query, Heard | None]:
        """What the search is asked for, what is heard included, and what that is."""
        return self.speaker.asked(speech, emotion, constraints)

    def plan(self, speech: Speech, *, emotion: str | None = None, constraints: Mapping[int, str] | None = None) -> Plan:
        """Search; `emotion` replaces the track's, `constraints` gives nodes by phone index."""
        return self.speaker.plan(speech, emotion=emotion, constraints=constraints)

    def synthesize(
        self,
        speech: Speech,
        *,
        constraints: Mapping[int, str] | None = None,
        edits: Edits | None = None,
        look_ahead: int | None = None,
        **options: Any,
    ) -> Motion:
        """Motion under constraints, phone index -> node name; `fps` and the rest as in `inference.efase.model`.

        edits: nodes that must not be used, and drawn ones that may be.
        """
        return self.edited(edits).speaker.synthesize(speech, constraints=constraints, look_ahead=look_ahead, **options)

    def stream(self, *, look_ahead: int | None = None, weakened: bool = False, fps: float | None = None) -> EfaseStream:
        """Phones one by one, frames as soon as they are final; see `inference.efase.model`."""
        return self.speaker.stream(look_ahead=look_ahead, weakened=weakened, fps=fps)

    def edit(self) -> EditsEditor:
        """For speech that is changed again and again; see `inference.efase.editing`."""
        return EditsEditor(self)

    def explain(
        self, speech: Speech, *, constraints: Mapping[int, str] | None = None, edits: Edits | None = None
    ) -> list[dict[str, Any]]:
        """Chosen node, cost terms and runners-up for each phone."""
        return self.edited(edits).speaker.explain(speech, constraints=constraints)

    def report(
        self, speech: Speech, *, constraints: Mapping[int, str] | None = None, edits: Edits | None = None
    ) -> dict[str, float]:
        """Shares of phones said by another phone, viseme class or emotion."""
        return self.edited(edits).speaker.report(speech, constraints=constraints)

    def account(self, speech: Speech, *, constraints: Mapping[int, str] | None = None, edits: Edits | None = None) -> Account:
        """The shares of `report`."""
        return Account(self.report(speech, constraints=constraints, edits=edits))

    def mapped_phones(self) -> tuple[str, ...]:
        """Phones that have nodes, and so a map."""
        return mapped_phones(self.nodes())

    def phone_map(self, phone: str, kind: Kind = "isomap") -> PhoneMap:
        """The frames of one phone's nodes on a plane, as it was kept in training or made now."""
        nodes, kept = self.nodes(), getattr(self, "map_points", None)
        cluster = cluster_of(*self._database(), phone)
        if kind != "isomap" or kept is None or not len(kept):
            return PhoneMap.of(cluster, kind)
        frames = frames_of(nodes, np.flatnonzero(nodes.phones == PHONES.index(phone)))
        return map_beside(cluster, frames, kept.cpu().numpy())

    def joins(self, speech: Speech) -> Ints:
        """Frames, at the corpus's rate, at which nodes were joined that were not recorded in a row."""
        return self.speaker.joins(speech)

    def with_weights(self, **weights: float) -> Self:
        """The same database under other parameters of the cost, sharing its arrays; another `expected_share` is that of all."""
        other = self._sharing(weights)
        for name in ("node_frames", "node_table", "map_points"):
            if hasattr(self, name):
                other.register_buffer(name, getattr(self, name))
        other.facts["median_transition"] = median_transition(other.nodes(), replace(other.weights(), pnt=1.0))
        other._keep_bounds()
        return other

    def edited(self, edits: Edits | None) -> Self:
        """The model with nodes removed and added; the last one made is kept."""
        key = edits_key(edits)
        if edits is None or not (edits.removed or edits.added):
            return self
        if self._edited is None or self._edited[0] != key:
            self._edited = key, self._changed(changed_nodes(self, edits))
        return self._edited[1]

    def _changed(self, changed: Changed) -> Self:
        other, nodes, device = self._sharing({}), changed.nodes, self.node_frames.device
        other.facts["names"] = changed.names
        other.audio = self.audio.of_nodes(changed.kept, nodes.phones)
        tables = {name: getattr(self, name).cpu().numpy() for name in TABLES}
        arrays = {
            "node_frames": nodes.frames,
            "node_table": np.stack([getattr(nodes, column) for column in COLUMNS]),
            **changed_bounds(self.nodes(), tables, changed.kept, nodes, self.weights()),
        }
        for name, array in arrays.items():
            other.register_buffer(name, torch.from_numpy(array).to(device))
        if hasattr(self, "map_points"):
            other.register_buffer("map_points", self.get_buffer("map_points"))
        return other

    def _sharing(self, weights: Mapping[str, float]) -> Self:
        """Another model that knows what this one learned, but no nodes."""
        other = type(self).from_config({**self.config, **weights})
        other.audio.share(self.audio)
        other.residual = self.residual if other.residual is not None else None
        other.layout, other.fps, other.emotions = self.layout, self.fps, self.emotions
        other.facts, other.provenance, other.pca = dict(self.facts), self.provenance, self.pca
        other.register_buffer("rest", self.rest)
        if self.shares is not None and "expected_share" not in weights:
            other.register_buffer("component_shares", self.get_buffer("component_shares"))
        return other

    def _keep_bounds(self) -> None:
        self._speaker = self._edited = None
        for name, table in step_bounds(self.nodes(), self.weights()).items():
            self.register_buffer(name, torch.from_numpy(table).to(self.node_frames.device))

    def _keep_maps(self, *, keep: bool) -> None:
        self.register_buffer("map_points", torch.from_numpy(places_of_all(*self._database())) if keep else torch.zeros(0, 2))

    def _database(self) -> tuple[Nodes, list[str], tuple[str, ...], float, Decode]:
        """Nodes, their names, the emotions, the rate of the frames (Hz), and what decodes them."""
        return self.nodes(), self.facts["names"], self.emotions, self.config["database_fps"], self._decode

    def _search(self) -> dict[str, Any]:
        """On another device than the processor, the searches by tensors there."""
        device, of = self.node_frames.device, (self.nodes(), self.weights())
        return {} if device.type == "cpu" else {"engine": torch_engine(*of, device), "mix": torch_mix(*of, device)}

    def _decode(self, coordinates: NDArray[np.float32]) -> NDArray[np.float32]:
        frames: NDArray[np.float32] = self.pca.decode(torch.from_numpy(coordinates).to(self.pca.mean.device)).cpu().numpy()
        return frames

    def __getstate__(self) -> dict[str, Any]:
        """For another process, without what is made anew when it is asked for."""
        return {**self.__dict__, "_speaker": None, "_edited": None}

    def _apply(self, fn: Any, recurse: bool = True) -> Self:
        """Arrays that move to another device are read anew."""
        self._speaker = self._edited = None
        return super()._apply(fn, recurse)  # type: ignore[no-untyped-call]  # torch leaves it untyped
