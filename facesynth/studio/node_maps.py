"""Maps of recorded nodes for the page: what lies where, what a place looks like on the face, and nodes that are drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.corpus.journal import ADDED, Journal, parse_node
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.capabilities import Browsing
from facesynth.methods.method import Method
from facesynth.methods.registry import require
from facesynth.motion.maps.phone_map import KINDS, Drawn, PhoneMap
from facesynth.speech.textgrid import read_textgrid

MAPS_KEPT = 6
LARGEST_PICTURE_PX = 2000


@dataclass(frozen=True)
class Picked:
    """What a place on a map stands for."""

    frame: NDArray[np.float32]
    """[1, C]"""
    inside: bool
    """Whether there is a pose; the nearest recorded one otherwise."""
    node: str
    """That the nearest frame belongs to."""


class NodeMaps:
    """The maps of one model, made when they are asked for. edits: a file of nodes that were removed and drawn."""

    def __init__(self, model: Method, edits: Path | None = None) -> None:
        self._model = require(model, Browsing).edited(Journal(edits).sum() if edits else None)
        self._made: dict[tuple[str, str], PhoneMap] = {}

    def phones(self) -> tuple[str, ...]:
        """Phones that have a map."""
        return self._model.mapped_phones()

    def map(self, phone: str, kind: str) -> PhoneMap:
        """The map of a phone."""
        if kind not in KINDS:
            raise unknown("kind of map", kind, KINDS)
        key = (phone, kind)
        if key not in self._made:
            for old in list(self._made)[: -MAPS_KEPT + 1]:
                del self._made[old]
            self._made[key] = self._model.phone_map(phone, kind)
        return self._made[key]

    def picked(self, phone: str, kind: str, place: Sequence[float]) -> Picked:
        """The pose at a place, and the node that is nearest there."""
        found = self.map(phone, kind)
        frames, mixed = found.picked([_place(place)])
        nearest = int(mixed.corners[0][mixed.shares[0].argmax()])
        return Picked(frames, bool(mixed.inside[0]), found.cluster.names[int(found.cluster.node[nearest])])

    def frames(self, phone: str, kind: str, node: str) -> tuple[NDArray[np.float32], float]:
        """[L, C] frames of a node, and their rate, Hz."""
        cluster = self.map(phone, kind).cluster
        k = cluster.place(node)
        own = cluster.frames[cluster.starts[k] : cluster.starts[k] + cluster.lengths[k]]
        return cluster.decode(own.astype(np.float32)), cluster.fps

    def drawn(self, phone: str, kind: str, path: Sequence[Sequence[float]], duration_s: float) -> tuple[Drawn, float]:
        """A node along a path that somebody drew, and the rate of its frames, Hz."""
        found = self.map(phone, kind)
        return found.drawn([_place(place) for place in path], duration_s), found.cluster.fps


def map_facts(found: PhoneMap) -> dict[str, Any]:
    """Nodes of a map, for the page; the points go beside it as numbers."""
    cluster = found.cluster
    low, high = found.plane.box
    return {
        "phone": cluster.phone,
        "map": found.kind,
        "nodes": cluster.names,
        "emotions": cluster.emotions,
        "contexts": cluster.contexts,
        "lengths": cluster.lengths.tolist(),
        "box": [*low.tolist(), *high.tolist()],
    }


def highlights(found: PhoneMap, progress: float, before: str, after: str) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Which nodes stood between these phones, and [K, 2] where each node is at a relative time."""
    return {"context": found.context_correct(before, after).tolist()}, found.time_correct(progress)


def left_by(found: PhoneMap, asked: Mapping[str, Any]) -> NDArray[np.bool_]:
    """[K] which nodes a filter by emotion and utterance leaves; an empty one leaves all."""
    wanted = ([str(value)] if (value := asked.get(name)) else None for name in ("emotion", "utterance"))
    return found.shown(*wanted)


def picture(found: PhoneMap, size: Sequence[int], shown: NDArray[np.bool_]) -> NDArray[np.float32]:
    """[height, width, 3] brightness of some nodes."""
    width, height = (min(max(int(side), 16), LARGEST_PICTURE_PX) for side in size)
    return found.picture((width, height), shown)


def recorded_at(corpus: Corpus, node: str) -> dict[str, Any]:
    """The utterance of a node, and where in it the node lies, seconds."""
    utterance, number = parse_node(node)
    if utterance == ADDED:
        raise FacesynthError(f"{node} was drawn: nobody recorded it")
    phones, _ = read_textgrid(corpus.files.phones(corpus.record(utterance).id))
    if number >= len(phones):
        raise FacesynthError(f"{utterance} has phones 0 to {len(phones) - 1}; {node} is none of them")
    return {"utterance": utterance, "start_s": float(phones.starts_s[number]), "end_s": float(phones.ends_s[number])}


def _place(place: Sequence[float]) -> tuple[float, float]:
    try:
        x, y = (float(value) for value in place)
    except (TypeError, ValueError):
        raise FacesynthError(f"a place on a map is two numbers; got {place!r:.40}") from None
    return x, y
