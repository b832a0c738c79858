"""The cheapest path over given candidates as one graph: a scan forth that keeps where each came from, a scan back."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.graph_builder import Builder
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.steps import GivenSteps

CANDIDATES = 7
"""In comparisons; any number may come."""


def path_search_graph() -> Graph:
    """Target costs [B, T, K] and step costs [B, T - 1, K next, K previous] to a path [B, T] and its cost [B].

    Candidates that a phone lacks get a target cost of 1e30.
    """
    b = Builder("path_search")
    inputs = (
        Port("targets", "float64", ("batch", "phones", "candidates"), "cost"),
        Port("steps", "float64", ("batch", "steps", "candidates", "candidates"), "cost; rows are next, columns previous"),
    )
    targets, steps = (b.input(port.name, port.dtype, port.shape) for port in inputs)
    by_time = b.op("Transpose", targets, perm=[1, 0, 2])
    # A step from nowhere that costs nothing stands before the others: one phone is a path, too, and a scan takes no length of 0.
    batch, wide, nothing = b.shape_of(targets, 0), b.shape_of(targets, 2), b.constant(0.0, "float64")
    nowhere = b.op("Expand", nothing, b.op("Concat", batch, wide, axis=0))
    free = b.op("Expand", nothing, b.op("Concat", b.ints(1), batch, wide, wide, axis=0))
    between = b.op("Concat", free, b.op("Transpose", steps, perm=[1, 0, 2, 3]), axis=0)
    reached, origins = b.ops("Scan", 2, nowhere, by_time, between, body=_forth().graph(), num_scan_inputs=2)
    cost = b.op("ReduceMin", reached, b.ints(1), keepdims=0)
    last = b.op("ArgMin", reached, axis=1, keepdims=0)
    back = {"body": _back().graph(), "num_scan_inputs": 1, "scan_input_directions": [1], "scan_output_directions": [1]}
    _, chosen = b.ops("Scan", 2, last, origins, **back)
    path = b.op("Transpose", chosen, perm=[1, 0])
    outputs = (Port("path", "int64", ("batch", "phones"), "candidate"), Port("cost", "float64", ("batch",), "cost"))
    for value, port in zip((path, cost), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)
    about = "min-plus search over a candidate set; ties go to the first"
    return Graph("path_search", about, b.model(), inputs, outputs, _example, _reference)


def _forth() -> Builder:
    body = Builder("forth")
    phi = body.input("phi", "float64", ("batch", "candidates"))
    target = body.input("target", "float64", ("batch", "candidates"))
    step = body.input("step", "float64", ("batch", "candidates", "candidates"))
    total = body.op("Add", step, body.op("Unsqueeze", phi, body.ints(1)))
    best = body.op("Add", body.op("ReduceMin", total, body.ints(2), keepdims=0), target)
    body.output(best, "phi_next", "float64", ("batch", "candidates"))
    body.output(body.op("ArgMin", total, axis=2, keepdims=0), "origin", "int64", ("batch", "candidates"))
    return body


def _back() -> Builder:
    body = Builder("back")
    at = body.input("at", "int64", ("batch",))
    origin = body.input("origin_of", "int64", ("batch", "candidates"))
    before = body.op("Squeeze", body.op("GatherElements", origin, body.op("Unsqueeze", at, body.ints(1)), axis=1), body.ints(1))
    body.output(before, "at_next", "int64", ("batch",))
    body.output(at, "here", "int64", ("batch",))
    return body


def _example(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    shape = (batch, length, CANDIDATES)
    return {"targets": rng.random(shape), "steps": rng.random((batch, length - 1, CANDIDATES, CANDIDATES))}


def _reference(arrays: Arrays) -> list[NDArray[Any]]:
    targets, steps = (torch.from_numpy(arrays[name]).unbind(dim=1) for name in ("targets", "steps"))
    found = cheapest(targets, GivenSteps(steps))
    return [found.path.numpy(), found.cost.numpy()]
