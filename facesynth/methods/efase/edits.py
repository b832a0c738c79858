"""Nodes taken from a trained database, and drawn ones added to it, without training anew.

What a model learned of its recordings (principal components, the scale of its penalties, what it hears) stays; nodes, their
bounds, places on maps and sounds change. A node after a removed one has no captured predecessor, as after training without it.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from facesynth.corpus.journal import ADDED, AddedNode, Edits, Journal, parse_node
from facesynth.inference.arrays import Ints
from facesynth.inference.efase.editing import EfaseDraft, EfaseEditor
from facesynth.inference.efase.kept import Memory
from facesynth.inference.efase.nodes import COLUMNS, Nodes
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES, SILENCE, viseme_of
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.motion.resample import resample

if TYPE_CHECKING:
    from facesynth.methods.efase.method import Efase

EDITORS = 4
"""Of databases that are kept: an edit that is taken back is found there."""


def read_edits(path: str | Path, phones: PhoneTrack) -> Edits:
    """A corpus's edits.jsonl, or a file of the same kind."""
    if not Path(path).is_file():
        raise FacesynthError(f"{path}: there is no such file; wanted edits as in a corpus's edits.jsonl")
    return Journal(Path(path)).sum()


def edits_key(edits: Edits | None) -> tuple[Any, ...] | None:
    """What a database is changed by, to be remembered by."""
    if edits is None:
        return None
    added = tuple((one.name, one.phone, one.emotion, one.frames.tobytes()) for one in edits.added)
    return (edits.removed, added)


@dataclass(frozen=True, eq=False)
class Changed:
    """What edits make of a database."""

    nodes: Nodes
    """Those kept, then those added."""
    kept: Ints
    """[K] which of the old ones."""
    names: list[str]


def changed_nodes(model: "Efase", edits: Edits) -> Changed:
    """Nodes of a model after edits; what the model was trained without, or with, stays so."""
    names: list[str] = model.facts["names"]
    known, gone_before = set(names), set(model.facts.get("removed", ()))
    strange = sorted(edits.removed - known - gone_before)
    for name in (one for one in strange if parse_node(one)[0] != ADDED):  # a drawn node may go before any model had it
        raise unknown("node to remove", name, names)
    old, new = model.nodes(), [one for one in edits.added if one.name not in known]
    for one in edits.added:
        if one.name in known and not _is_node(model, one, names.index(one.name)):
            raise FacesynthError(
                f"{one.name} was another node when this model was trained; give the drawn one another name (its line number)"
            )
    pieces = [_encoded(model, one) for one in new]
    kept = np.array([k for k, name in enumerate(names) if name not in edits.removed], np.int64)
    if not len(kept) + len(new):
        raise FacesynthError("the edits remove every node; restore some")
    left, lengths = old.take(kept), np.array([len(piece) for piece in pieces], np.int64)
    stops = len(old.frames) + np.cumsum(lengths)
    added = {
        "starts": stops - lengths,
        "stops": stops,
        "phones": np.array([PHONES.index(one.phone) for one in new], np.int64),
        "visemes": np.array([viseme_of(one.phone) for one in new], np.int64),
        "emotions": np.array([model.emotions.index(one.emotion) for one in new], np.int64),
        "before": np.full(len(new), -1, np.int64),
    }
    frames = np.concatenate([old.frames, *pieces]) if pieces else old.frames
    columns = {name: np.concatenate([getattr(left, name), added[name]]) for name in COLUMNS}
    return Changed(
        replace(left, frames=frames, **columns), kept, [*(names[k] for k in kept.tolist()), *(one.name for one in new)]
    )


def _is_node(model: "Efase", node: AddedNode, place: int) -> bool:
    """Whether a drawn node is one that the model learned from."""
    nodes, piece = model.nodes(), _encoded(model, node)
    said = (PHONES[nodes.phones[place]], model.emotions[nodes.emotions[place]])
    known = nodes.motion(place)
    return said == (node.phone, node.emotion) and piece.shape == known.shape and np.allclose(piece, known, atol=1e-3)


def _encoded(model: "Efase", node: AddedNode) -> np.ndarray:
    """[L, D] a drawn node in the model's coordinates, at the rate of its database."""
    if node.phone not in PHONES or node.phone == SILENCE:
        raise unknown(f"phone of the drawn node {node.name}", node.phone, [phone for phone in PHONES if phone != SILENCE])
    if node.emotion not in model.emotions:
        raise unknown(f"emotion of the drawn node {node.name}", node.emotion, model.emotions)
    channels = model.fitted_layout.channels
    if node.frames.ndim != 2 or node.frames.shape[1] != channels or not np.isfinite(node.frames).all():
        raise FacesynthError(f"the drawn node {node.name} has frames {list(node.frames.shape)}; wanted [L, {channels}], finite")
    motion = resample(Motion(node.frames, model.fps, model.fitted_layout), model.config["database_fps"])
    return model.pca.encode(torch.from_numpy(motion.frames).to(model.pca.mean.device)).cpu().numpy()


class EditsEditor:
    """An editor of a model whose nodes may change as well: `edits` is one more option."""

    def __init__(self, model: "Efase") -> None:
        self.model = model
        self._editors: Memory[EfaseEditor] = Memory(EDITORS)
        self._last: EfaseDraft | None = None

    def change(self, speech: Speech, *, seed: int = 0, edits: Edits | None = None, **options: Any) -> EfaseDraft:
        """See `EfaseEditor.change`."""
        editor = self._editors.of(edits_key(edits), lambda: EfaseEditor(self.model.edited(edits).speaker))
        self._last = editor.change(speech, seed=seed, after=self._last, **options)
        return self._last
