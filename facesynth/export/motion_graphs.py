"""Linear maps of motion: principal and independent components; and the maps between emotions."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.graph_builder import Builder
from facesynth.methods.anime_graph.maps import EmotionMaps

Function = Callable[[NDArray[Any]], NDArray[Any]]


def decode_graph(matrix: NDArray[Any], mean: NDArray[Any], unit: str, fps: float, reference: Function) -> Graph:
    """Coordinates [B, T, D] to frames [B, T, C]: coordinates @ matrix + mean."""
    kind = str(matrix.dtype)
    b = Builder("decode")
    z = b.input("coordinates", kind, ("batch", "frames", len(matrix)))
    moved = b.op("Add", b.op("MatMul", z, b.constant(matrix)), b.constant(mean))
    source = Port("coordinates", kind, ("batch", "frames", len(matrix)), "components", fps)
    port = Port("frames", kind, ("batch", "frames", len(mean)), unit, fps)
    return _linear(b, "components to motion", moved, source, port, reference)


def encode_graph(matrix: NDArray[Any], mean: NDArray[Any], unit: str, fps: float, reference: Function) -> Graph:
    """Frames [B, T, C] to coordinates [B, T, D]: (frames - mean) @ matrix."""
    kind = str(matrix.dtype)
    b = Builder("encode")
    x = b.input("frames", kind, ("batch", "frames", len(mean)))
    z = b.op("MatMul", b.op("Sub", x, b.constant(mean)), b.constant(matrix))
    source = Port("frames", kind, ("batch", "frames", len(mean)), unit, fps)
    port = Port("coordinates", kind, ("batch", "frames", matrix.shape[1]), "components", fps)
    return _linear(b, "motion to components", z, source, port, reference)


def _linear(b: Builder, about: str, value: str, source: Port, port: Port, reference: Function) -> Graph:
    b.output(value, port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        return {source.name: (10 * rng.standard_normal((batch, count, source.shape[-1]))).astype(source.dtype)}  # type: ignore[arg-type]

    return Graph(b.name, about, b.model(), (source,), (port,), example, lambda arrays: [reference(arrays[source.name])])


def emotion_maps_graph(maps: EmotionMaps, fps: float) -> Graph:
    """Components [B, T, D], number of a map [] and intensity [B, T] to components [B, T, D] in the map's second emotion."""
    width = maps.shifts.shape[1]
    emotional, gaussian = maps.emotional.numpy(), maps.gaussian.numpy()
    b = Builder("emotion_maps")
    inputs = (
        Port("components", "float64", ("batch", "frames", width), "components", fps),
        Port("map", "int64", (), "row of settings.maps"),
        Port("intensity", "float64", ("batch", "frames"), "0..1", fps),
    )
    x, number, intensity = (b.input(port.name, port.dtype, port.shape) for port in inputs)

    def of_map(array: NDArray[Any]) -> str:
        return b.op("Gather", b.constant(array), number, axis=0)

    centres, coefficients = of_map(maps.centres.numpy()), of_map(maps.coefficients.numpy())
    at = b.op("Gather", x, b.constant(emotional), axis=2)
    apart = b.op("Sub", b.op("Unsqueeze", at, b.ints(2)), centres)
    squared = b.op("ReduceSum", b.op("Mul", apart, apart), b.ints(-1), keepdims=0)
    z = b.op("Div", b.op("Sqrt", squared), of_map(maps.widths.numpy()))
    exponent = b.op("Where", of_map(gaussian), b.op("Mul", z, z), z)
    moved = b.op("MatMul", b.op("Exp", b.op("Neg", exponent)), coefficients)
    spread = np.zeros((len(emotional), width))
    spread[np.arange(len(emotional)), emotional] = 1.0
    change = b.op("Add", b.op("MatMul", moved, b.constant(spread)), of_map(maps.shifts.numpy()))
    mapped = b.op("Add", x, b.op("Mul", b.op("Unsqueeze", intensity, b.ints(-1)), change))
    port = Port("mapped", "float64", ("batch", "frames", width), "components", fps)
    b.output(mapped, port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        components = rng.standard_normal((batch, count, width))
        chosen = np.array(int(rng.integers(len(maps.pairs))), np.int64)
        return {"components": components, "map": chosen, "intensity": rng.random((batch, count))}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        tensors = torch.from_numpy(arrays["components"]), int(arrays["map"]), torch.from_numpy(arrays["intensity"])
        return [maps(*tensors).numpy()]

    about = "one map for each ordered pair of emotions, by radial basis functions"
    return Graph("emotion_maps", about, b.model(), inputs, (port,), example, reference)
