"""Writing an ONNX graph operator by operator.

The modules that are exported are short, and a graph that is written down has no traced length in it, no operator that
onnxruntime lacks (its convolutions and some transforms know no float64), and is the same in every version of torch.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike, NDArray
from onnx import TensorProto, helper, numpy_helper

from facesynth.inference.folder import OPSET

IR_VERSION = 9
"""Read by onnxruntime 1.20 and newer."""
TYPES = {"float16": TensorProto.FLOAT16, "float32": TensorProto.FLOAT, "float64": TensorProto.DOUBLE, "int64": TensorProto.INT64}

Shape = Sequence[int | str]
"""A dimension is a number, or a name where any size may come."""


class Builder:
    """Nodes, constants, inputs and outputs of one graph; values are handed around by name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self._inputs: list[onnx.ValueInfoProto] = []
        self._outputs: list[onnx.ValueInfoProto] = []

    def input(self, name: str, dtype: str, shape: Shape) -> str:
        """Declare an input."""
        self._inputs.append(helper.make_tensor_value_info(name, TYPES[dtype], list(shape)))
        return name

    def bool_input(self, name: str) -> str:
        """Declare a truth value, as the body of a Loop takes."""
        self._inputs.append(helper.make_tensor_value_info(name, TensorProto.BOOL, []))
        return name

    def bool_output(self, value: str, name: str) -> None:
        """Declare a truth value to be an output."""
        self._nodes.append(helper.make_node("Identity", [value], [name]))
        self._outputs.append(helper.make_tensor_value_info(name, TensorProto.BOOL, []))

    def output(self, value: str, name: str, dtype: str, shape: Shape) -> None:
        """Declare a value to be an output called `name`."""
        self._nodes.append(helper.make_node("Identity", [value], [name]))
        self._outputs.append(helper.make_tensor_value_info(name, TYPES[dtype], list(shape)))

    def constant(self, value: ArrayLike, dtype: str | None = None) -> str:
        """An array that belongs to the graph."""
        array = np.ascontiguousarray(np.asarray(value, dtype))
        name = f"{self.name}_c{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(array.reshape(np.shape(value)), name))
        return name

    def ints(self, *values: int) -> str:
        """A shape, a list of axes or of positions."""
        return self.constant(np.array(values, np.int64))

    def op(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """One operator with one output."""
        return self.ops(kind, 1, *inputs, **attributes)[0]

    def ops(self, kind: str, count: int, *inputs: str, **attributes: Any) -> list[str]:
        """One operator with `count` outputs."""
        outputs = [f"{self.name}_v{len(self._nodes)}_{k}" for k in range(count)]
        self._nodes.append(helper.make_node(kind, list(inputs), outputs, **attributes))
        return outputs

    def shape_of(self, value: str, axis: int) -> str:
        """[1] size of one dimension."""
        return self.op("Shape", value, start=axis, end=axis + 1)

    def span(self, value: str, axis: int, start: int, stop: int) -> str:
        """value[..., start:stop, ...] along an axis; a stop of 2**62 is the end."""
        return self.op("Slice", value, self.ints(start), self.ints(stop), self.ints(axis))

    def graph(self) -> onnx.GraphProto:
        """For a body of Scan, Loop or If."""
        return helper.make_graph(self._nodes, self.name, self._inputs, self._outputs, self._constants)

    def model(self) -> onnx.ModelProto:
        """The finished, checked model."""
        model = helper.make_model(
            self.graph(), opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, producer_name="facesynth"
        )
        onnx.checker.check_model(model)
        return model


def dft(length: int, bins: NDArray[np.int64], transform: int) -> NDArray[np.float64]:
    """[length, 2 len(bins)] cosines and sines: frames @ this is the transform at some bins, real parts first."""
    angle = 2 * np.pi * np.outer(np.arange(length), bins) / transform
    return np.hstack([np.cos(angle), -np.sin(angle)])


def power_spectrum(b: Builder, frames: str, window: NDArray[Any], bins: NDArray[np.int64], transform: int, dtype: str) -> str:
    """|DFT|² [..., bins] of frames [..., L]: one matrix product with the window inside."""
    count = len(bins)
    both = b.op("MatMul", frames, b.constant(window[:, None].astype(np.float64) * dft(len(window), bins, transform), dtype))
    squares = b.op("Mul", both, both)
    real, imaginary = b.ops("Split", 2, squares, b.ints(count, count), axis=-1)
    return b.op("Add", real, imaginary)
