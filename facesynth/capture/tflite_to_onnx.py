"""From a small convolutional TensorFlow Lite model to the same model in ONNX, which onnxruntime runs everywhere.

TensorFlow Lite keeps images as [1, H, W, channels], ONNX as [1, channels, H, W]: between the input and the first
reshaping every activation is kept the second way.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

OPSET = 17
_DTYPES = {0: np.float32, 1: np.float16, 2: np.int32, 4: np.int64}
_SAME_PADDING = 0
_RELU, _RELU6 = 1, 3
_IMAGE = (0, 3, 1, 2)


def to_onnx(model: bytes) -> bytes:
    """The ONNX model that computes the same as a TensorFlow Lite model of convolutions; its input is called `input`."""
    import tflite

    try:
        source = tflite.Model.GetRootAsModel(model, 0)
        return _Conversion(source, source.Subgraphs(0)).run()
    except (struct.error, IndexError, TypeError, AttributeError, AssertionError) as error:
        raise FacesynthError(f"this is no TensorFlow Lite model that can be converted ({error})") from None


@dataclass(eq=False)
class _Conversion:
    """One model on its way: what was read, and the ONNX nodes and weights so far."""

    model: Any
    graph: Any
    nodes: list[Any] = field(default_factory=list)
    weights: list[Any] = field(default_factory=list)
    floats: dict[int, NDArray[Any]] = field(default_factory=dict)
    """Weights that the model keeps as halves and widens first, by tensor."""

    def run(self) -> bytes:
        from onnx import TensorProto, checker, helper

        first = self.graph.Inputs(0)
        self.add("Transpose", ["input"], _name(first), perm=_IMAGE)
        for index in range(self.graph.OperatorsLength()):
            self._convert(self.graph.Operators(index))
        outputs = [self.graph.Outputs(i) for i in range(self.graph.OutputsLength())]
        graph = helper.make_graph(
            self.nodes,
            "converted",
            [helper.make_tensor_value_info("input", TensorProto.FLOAT, self.shape(first))],
            [helper.make_tensor_value_info(_name(o), TensorProto.FLOAT, [None] * len(self.shape(o))) for o in outputs],
            self.weights,
        )
        whole = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9)
        checker.check_model(whole)
        return whole.SerializeToString()

    def _convert(self, operator: Any) -> None:
        import tflite

        code = self.model.OperatorCodes(operator.OpcodeIndex())
        number = max(code.BuiltinCode(), code.DeprecatedBuiltinCode())
        names = {value: key for key, value in vars(tflite.BuiltinOperator).items() if isinstance(value, int)}
        if names[number] not in _OPERATORS:
            raise FacesynthError(f"the model uses {names[number]}, which is not among {', '.join(_OPERATORS)}")
        _OPERATORS[names[number]](self, operator, list(map(int, operator.InputsAsNumpy())), int(operator.OutputsAsNumpy()[0]))

    def shape(self, tensor: int) -> list[int]:
        found = self.graph.Tensors(tensor)
        return list(map(int, found.ShapeAsNumpy())) if found.ShapeLength() else []

    def value(self, tensor: int) -> NDArray[Any]:
        """A tensor that is a constant of the model."""
        if tensor in self.floats:
            return self.floats[tensor]
        found = self.graph.Tensors(tensor)
        raw = self.model.Buffers(found.Buffer()).DataAsNumpy()
        return raw.view(_DTYPES[found.Type()]).reshape(self.shape(tensor))

    def constant(self, array: NDArray[Any], name: str) -> str:
        from onnx import numpy_helper

        self.weights.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def add(self, kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> None:
        from onnx import helper

        self.nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))

    def add_activated(self, function: int, kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> None:
        """A node, with the activation that TensorFlow Lite holds to be part of it."""
        if function == 0:
            self.add(kind, inputs, output, **attributes)
            return
        if function not in (_RELU, _RELU6):
            raise FacesynthError(f"the model uses activation {function}, which is neither ReLU nor ReLU6")
        self.add(kind, inputs, f"{output}_raw", **attributes)
        if function == _RELU:
            self.add("Relu", [f"{output}_raw"], output)
        else:
            bounds = [self.constant(np.array(bound, np.float32), f"{output}_{bound}") for bound in (0, 6)]
            self.add("Clip", [f"{output}_raw", *bounds], output)

    def options(self, operator: Any, kind: str) -> Any:
        import tflite

        table = operator.BuiltinOptions()
        found = getattr(tflite, kind)()
        found.Init(table.Bytes, table.Pos)
        return found


def _widened(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    model.floats[output] = model.value(inputs[0]).astype(np.float32)


def _convolution(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    _convolved(model, model.options(operator, "Conv2DOptions"), inputs, output, (0, 3, 1, 2), 1)


def _depthwise(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    groups = model.shape(inputs[0])[3]
    _convolved(model, model.options(operator, "DepthwiseConv2DOptions"), inputs, output, (3, 0, 1, 2), groups)


def _convolved(model: _Conversion, options: Any, inputs: list[int], output: int, order: tuple[int, ...], groups: int) -> None:
    kernel = model.value(inputs[1]).transpose(order)
    strides = [options.StrideH(), options.StrideW()]
    sides = zip(model.shape(inputs[0])[1:3], kernel.shape[2:], strides, strict=True)
    before, after = zip(*[_padding(*side) if options.Padding() == _SAME_PADDING else (0, 0) for side in sides], strict=True)
    name = _name(output)
    weights = [model.constant(kernel, f"{name}_kernel"), model.constant(model.value(inputs[2]), f"{name}_bias")]
    attributes = {"strides": strides, "pads": [*before, *after], "group": groups}
    model.add_activated(options.FusedActivationFunction(), "Conv", [_name(inputs[0]), *weights], name, **attributes)


def _padding(size: int, kernel: int, stride: int) -> tuple[int, int]:
    """TensorFlow's "same": the result has ceil(size / stride) places, the odd zero goes to the end."""
    lacking = max((-(-size // stride) - 1) * stride + kernel - size, 0)
    return lacking // 2, lacking - lacking // 2


def _prelu(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    slope = model.constant(model.value(inputs[1]).reshape(-1, 1, 1), f"{_name(output)}_slope")
    model.add("PRelu", [_name(inputs[0]), slope], _name(output))


def _relu(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    model.add("Relu", [_name(inputs[0])], _name(output))


def _sum(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    function = model.options(operator, "AddOptions").FusedActivationFunction()
    model.add_activated(function, "Add", list(map(_name, inputs)), _name(output))


def _max_pool(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    options = model.options(operator, "Pool2DOptions")
    kernel, strides = [options.FilterHeight(), options.FilterWidth()], [options.StrideH(), options.StrideW()]
    model.add("MaxPool", [_name(inputs[0])], _name(output), kernel_shape=kernel, strides=strides)


def _pad(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    amounts = model.value(inputs[1]).astype(np.int64)[list(_IMAGE)]
    pads = model.constant(np.concatenate([amounts[:, 0], amounts[:, 1]]), f"{_name(output)}_pads")
    model.add("Pad", [_name(inputs[0]), pads], _name(output))


def _reshape(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    name = _name(output)
    model.add("Transpose", [_name(inputs[0])], f"{name}_last", perm=(0, 2, 3, 1))
    shape = model.constant(np.array(model.shape(output), np.int64), f"{name}_shape")
    model.add("Reshape", [f"{name}_last", shape], name)


def _concatenation(model: _Conversion, operator: Any, inputs: list[int], output: int) -> None:
    axis = model.options(operator, "ConcatenationOptions").Axis()
    model.add("Concat", list(map(_name, inputs)), _name(output), axis=axis)


def _name(tensor: int) -> str:
    return f"t{tensor}"


_OPERATORS: Mapping[str, Callable[[_Conversion, Any, list[int], int], None]] = {
    "DEQUANTIZE": _widened,
    "CONV_2D": _convolution,
    "DEPTHWISE_CONV_2D": _depthwise,
    "PRELU": _prelu,
    "RELU": _relu,
    "ADD": _sum,
    "MAX_POOL_2D": _max_pool,
    "PAD": _pad,
    "RESHAPE": _reshape,
    "CONCATENATION": _concatenation,
}
