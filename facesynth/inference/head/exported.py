"""From a folder to a model of the head."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..folder import Folder
from ..graphs import Graph
from .hmm import HeadHmm, Network
from .knn import HeadKnn, KnnSettings, Recorded
from .search import Scales


def load_head_knn(folder: Folder, threads: int) -> HeadKnn:
    """The model that `head_knn` was exported to."""
    manifest, settings = folder.manifest, folder.settings
    arrays = _doubles(folder)
    near, rough, away = (float(weight) for weight in settings["weights"])
    scales = Scales(arrays["move_scale"], arrays["pose_scale"])
    recorded = Recorded(arrays["coefficients"], arrays["moves"], arrays["rest"], scales, float(settings["pitch_hz"]))
    return HeadKnn(
        folder.layout,
        arrays["frame"].astype(np.float32),
        float(manifest["fps"]),
        tuple(manifest["emotions"]),
        KnnSettings(int(settings["neighbours"]), (near, rough, away), int(settings["beam"])),
        recorded,
        Graph(folder, "project", threads),
        manifest,
    )


def load_head_hmm(folder: Folder, threads: int) -> HeadHmm:
    """The model that `head_hmm` was exported to."""
    manifest, arrays = folder.manifest, _doubles(folder)
    network = Network(arrays["log_start"], arrays["log_step"], folder.arrays()["clusters"])
    return HeadHmm(
        folder.layout,
        arrays["frame"].astype(np.float32),
        float(manifest["fps"]),
        tuple(manifest["emotions"]),
        network,
        arrays["means"],
        arrays["spreads"],
        Graph(folder, "log_likelihood", threads),
        manifest,
    )


def _doubles(folder: Folder) -> dict[str, NDArray[Any]]:
    return {name: array.astype(np.float64) for name, array in folder.arrays().items()}
