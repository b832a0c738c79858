"""What is exported: a graph with named, measured ports, and the code that it must agree with."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

TOLERANCE = 1e-4
"""Largest difference, relative to the largest value, that export lets pass."""
BATCHES = (1, 3)
LENGTHS = (41, 97)
"""Sizes at which every graph is compared. None is written into a graph."""

Arrays = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class Port:
    """An input or output."""

    name: str
    dtype: str
    shape: tuple[int | str, ...]
    """A name stands for any size: batch, frames, samples, …"""
    unit: str
    rate_hz: float | None = None
    """Of the frames or samples, where there is one."""

    def to_dict(self) -> dict[str, Any]:
        """For the manifest."""
        plain: dict[str, Any] = {"name": self.name, "dtype": self.dtype, "shape": list(self.shape), "unit": self.unit}
        return plain if self.rate_hz is None else {**plain, "rate_hz": self.rate_hz}


@dataclass(frozen=True, eq=False)
class Graph:
    """One ONNX graph and what it stands for."""

    name: str
    about: str
    model: onnx.ModelProto
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    example: Callable[[int, int, np.random.Generator], dict[str, NDArray[Any]]]
    """Inputs of a batch size and a length."""
    reference: Callable[[Arrays], Sequence[NDArray[Any]]]
    """The outputs that facesynth itself computes from them."""
    approximate: bool = False
    """Kept in fewer bits: the difference is measured and stated, and no limit is put on it."""


@dataclass(frozen=True)
class Parity:
    """How far a graph is from facesynth."""

    relative: float
    """Largest difference over largest value, over all outputs and sizes."""
    sizes: tuple[tuple[int, int], ...]
    """(batch, length) compared."""


def check_parity(graph: Graph, *, seed: int = 0) -> Parity:
    """Run both at two batch sizes and two lengths; FacesynthError where they differ by more than TOLERANCE."""
    import onnxruntime

    session = onnxruntime.InferenceSession(graph.model.SerializeToString(), providers=["CPUExecutionProvider"])
    rng, worst = np.random.default_rng(seed), 0.0
    sizes = tuple(product(BATCHES, LENGTHS))
    for batch, length in sizes:
        inputs = graph.example(batch, length, rng)
        got = session.run([port.name for port in graph.outputs], inputs)
        for port, ours, theirs in zip(graph.outputs, got, graph.reference(inputs), strict=True):
            error = difference(ours, theirs)
            worst = max(worst, error)
            if error > TOLERANCE and not graph.approximate:
                raise FacesynthError(
                    f"the graph {graph.name} differs from facesynth by {error:.2g} of {port.name}'s largest value at batch "
                    f"{batch}, length {length}; {TOLERANCE:g} is allowed. Nothing was exported"
                )
    return Parity(worst, sizes)


def difference(got: NDArray[Any], wanted: NDArray[Any]) -> float:
    """Largest absolute difference over the largest absolute value; infinite where shapes differ or a value is not finite."""
    got, wanted = np.asarray(got, np.float64), np.asarray(wanted, np.float64)
    if got.shape != wanted.shape or not np.isfinite(got).all():
        return float("inf")
    return float(np.abs(got - wanted).max(initial=0) / max(float(np.abs(wanted).max(initial=0)), 1e-12))
