"""Smaller folders: large constants kept in 16 or 8 bits. They are widened when they are used; nothing is computed in them."""

from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from facesynth.export.folder import Content
from facesynth.inference.errors import unknown

Weights = Literal["float32", "float16", "int8"]
LARGE = 1024
"""Constants of fewer numbers stay as they are, and so do vectors: one of 8 bits would shift the face."""
SMALLER_ARRAYS = ("node_frames", "frames", "features", "residual_frames")
"""Arrays of a database that may be kept in fewer bits."""


def stored_as(content: Content, weights: Weights) -> Content:
    """The same content with its large constants kept in `weights`; float32 changes nothing.

    Such a folder is an approximation: its graphs are compared with those of full precision, not with the limit of
    exact ones, and the manifest states the difference.
    """
    if weights not in get_args(Weights):
        raise unknown("kind of weights", weights, get_args(Weights))
    if weights == "float32":
        return content
    graphs = tuple(replace(graph, model=_smaller(graph.model, weights), approximate=True) for graph in content.graphs)
    arrays = {name: _rounded(array, weights) if name in SMALLER_ARRAYS else array for name, array in content.arrays.items()}
    scales = {
        f"{name}_scale": _scale(array) for name, array in content.arrays.items() if name in SMALLER_ARRAYS and weights == "int8"
    }
    settings = {**content.settings, "stored_as": weights}
    rounding = {
        name: _harm(content.arrays[name], arrays[name], scales.get(f"{name}_scale")) for name in SMALLER_ARRAYS if name in arrays
    }
    return replace(content, graphs=graphs, arrays={**arrays, **scales}, settings=settings, rounding=rounding)


def _smaller(model: onnx.ModelProto, weights: Weights) -> onnx.ModelProto:
    small = onnx.ModelProto()
    small.CopyFrom(model)
    kept: list[onnx.TensorProto] = []
    widening: list[onnx.NodeProto] = []
    for tensor in model.graph.initializer:
        array: NDArray[Any] = numpy_helper.to_array(tensor)
        if array.size < LARGE or array.ndim < 2 or array.dtype.kind != "f":
            kept.append(tensor)
            continue
        kind = tensor.data_type
        kept.append(numpy_helper.from_array(_rounded(array, weights), f"{tensor.name}_small"))
        if weights == "float16":
            widening.append(helper.make_node("Cast", [f"{tensor.name}_small"], [tensor.name], to=kind))
            continue
        kept.append(numpy_helper.from_array(_scale(array).astype(array.dtype), f"{tensor.name}_scale"))
        widening.append(helper.make_node("Cast", [f"{tensor.name}_small"], [f"{tensor.name}_wide"], to=kind))
        widening.append(helper.make_node("Mul", [f"{tensor.name}_wide", f"{tensor.name}_scale"], [tensor.name]))
    nodes = [*widening, *model.graph.node]
    del small.graph.initializer[:], small.graph.node[:]
    small.graph.initializer.extend(kept)
    small.graph.node.extend(nodes)
    onnx.checker.check_model(small)
    return small


def _rounded(array: NDArray[Any], weights: Weights) -> NDArray[Any]:
    if weights == "float16":
        return array.astype(np.float16)
    return np.round(array / _scale(array)).astype(np.int8)


def _harm(exact: NDArray[Any], kept: NDArray[Any], scale: NDArray[Any] | None) -> dict[str, float]:
    """How far the kept numbers are from the exact ones, in the unit of the array."""
    wide = kept.astype(np.float64) * (1.0 if scale is None else scale)
    away = np.abs(wide - exact)
    return {"mean": float(away.mean()), "most": float(away.max())} if away.size else {"mean": 0.0, "most": 0.0}


def _scale(array: NDArray[Any]) -> NDArray[np.float32]:
    """[..., 1, columns] what 1 stands for in each column."""
    largest = np.abs(array).max(axis=tuple(range(array.ndim - 1)), keepdims=True) if array.ndim > 1 else np.abs(array).max()
    scale: NDArray[np.float32] = np.maximum(np.asarray(largest, np.float64) / 127, 1e-20).astype(np.float32)
    return scale
