"""From an exported folder to a model."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..efase.assembly import Smoothing
from ..efase.bounds import TABLES
from ..efase.costs import Weights
from ..efase.hearing import Hearing, PhoneSounds, PoseDistances
from ..efase.model import Efase, Parts, Settings
from ..efase.nodes import COLUMNS, Nodes
from ..errors import FacesynthError
from ..expectation import Standard, exported_bands, exported_expectation
from ..folder import Folder
from ..graphs import Graph
from ..phones import PHONES, viseme_of
from ..residual import exported_residual

Arrays = Mapping[str, NDArray[Any]]

SOUND = ("nodes", "centre", "basis", "size")
"""Parts of `PhoneSounds` that a folder keeps as sound_nodes and so on."""


def load_efase(folder: Folder, threads: int) -> Efase:
    """The model in a folder that `efase_content` filled."""
    manifest, settings, arrays = folder.manifest, folder.settings, folder.arrays()
    if manifest["phones"] != [[phone, viseme_of(phone)] for phone in PHONES]:
        raise FacesynthError(f"{folder.path} knows other phones than this runtime; export the model again")
    nodes, decode = stored_nodes(arrays), Graph(folder, "decode", threads)
    return Efase(
        Parts(
            layout=folder.layout,
            fps=float(manifest["fps"]),
            emotions=tuple(manifest["emotions"]),
            nodes=nodes,
            names=arrays["names"].tobytes().decode().split("\n"),
            rest=arrays["rest"].astype(np.float64),
            weights=Weights(**settings["weights_of_cost"]),
            bounds={name: arrays[name] for name in TABLES},
            settings=Settings(**{**settings["speaking"], "smoothing": Smoothing(**settings["speaking"]["smoothing"])}),
            decode=lambda coordinates: decode(coordinates=coordinates[None])[0][0],
            hearing=_hearing(folder, arrays, nodes, threads),
            residual=exported_residual(folder, arrays),
            shares=arrays.get("shares"),
            manifest=manifest,
        )
    )


def stored_nodes(arrays: Arrays) -> Nodes:
    """The nodes of a folder's arrays; frames in 8 bits have a scale beside them."""
    frames = arrays["node_frames"].astype(np.float32, copy=False)
    if "node_frames_scale" in arrays:
        frames = frames * arrays["node_frames_scale"]
    return Nodes(frames, *(arrays[name].astype(np.int64) for name in COLUMNS))


def _hearing(folder: Folder, arrays: Arrays, nodes: Nodes, threads: int) -> Hearing | None:
    sound_weight, pose_weight = folder.settings["sound_weight"], folder.settings["pose_weight"]
    if not (sound_weight > 0 or pose_weight > 0):
        return None
    sounds = expectation = distances = None
    if sound_weight > 0:
        nodes_heard, centre, basis, size = (arrays[f"sound_{name}"] for name in SOUND)
        standard = Standard(arrays["sound_mean"], arrays["sound_deviation"])
        sounds = PhoneSounds(nodes_heard, centre, basis, size, standard)
    if pose_weight > 0:
        expectation = exported_expectation(folder, arrays, threads)
        distances = PoseDistances(nodes, arrays["pose_metric"])
    return Hearing(exported_bands(folder, threads), sounds, sound_weight, expectation, distances, pose_weight)
