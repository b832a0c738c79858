"""A node drawn on a map becomes a node of a corpus."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.corpus import AddedNode, Corpus
from facesynth.corpus.motion_files import load_motion
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.capabilities import Browsing
from facesynth.methods.method import Method
from facesynth.methods.registry import require
from facesynth.motion.maps.phone_map import Kind
from facesynth.motion.resample import resample


@dataclass(frozen=True, eq=False)
class NewMotion:
    """Of a node that is to be added."""

    frames: NDArray[np.float32]
    """[L, C] in the corpus's layout, at its rate."""
    remarks: tuple[str, ...] = ()


def drawn_motion(corpus: Corpus, method: Method, phone: str, path: ArrayLike, seconds: float, kind: Kind = "isomap") -> NewMotion:
    """Along a path [m, 2] on the map of a phone, as a model of the same layout has it."""
    if (method.fitted_layout.kind, method.fitted_layout.names) != (corpus.layout.kind, corpus.layout.names):
        raise FacesynthError(f"{method.name} learned another layout than that of {corpus.path}; give a model of this corpus")
    found = require(method, Browsing).phone_map(phone, kind)
    drawn = found.drawn(path, seconds)
    motion = resample(Motion(drawn.frames, found.cluster.fps, method.fitted_layout), corpus.fps)
    remark = f"{drawn.outside} of {len(drawn.curve)} frames lie outside of the map: the nearest recorded ones stand for them"
    return NewMotion(motion.frames, (remark,) if drawn.outside else ())


def motion_from_file(corpus: Corpus, path: Path) -> NewMotion:
    """From an NPZ or a CSV such as `corpus add` takes beside a sound."""
    motion, remarks = load_motion(path, corpus.layout, corpus.fps)
    return NewMotion(motion.frames, remarks)


def read_path(path: Path) -> NDArray[np.float64]:
    """[m, 2] places on a map from a CSV of two columns, x and y, with or without a line that names them."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
        if rows and [name.strip().lower() for name in rows[0]] == ["x", "y"]:
            rows = rows[1:]
        places = np.array([[float(x), float(y)] for x, y in rows]).reshape(-1, 2)
    except (OSError, UnicodeDecodeError, csv.Error, ValueError) as error:
        raise FacesynthError(f"{path}: wanted lines of two numbers, x and y on the map ({error})") from None
    return places


def add_motion(corpus: Corpus, phone: str, emotion: str, motion: NewMotion, title: str = "") -> AddedNode:
    """Add the node; FacesynthError where there is one already that moves the same."""
    for node in corpus.added_nodes():
        same = (node.phone, node.emotion) == (phone, emotion) and node.frames.shape == motion.frames.shape
        if same and np.allclose(node.frames, motion.frames, atol=1e-3):
            raise FacesynthError(f"{node.name} is this node already; nothing was added")
    return corpus.add_node(phone, emotion, motion.frames, title)
