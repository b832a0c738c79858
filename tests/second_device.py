"""A second device on a computer that has none: its tensors hold real values, and mix with the processor's as little as a GPU's.

They say that they lie on `meta`, the one device of torch that is always there; every operation on them is run by the
processor. So `.numpy()` without `.cpu()`, a tensor made on the wrong device and an operation on tensors of both fail
here as they would on an accelerator, and the results can be compared.
"""

from contextlib import contextmanager

import torch
from torch.overrides import TorchFunctionMode
from torch.utils._mode_utils import no_dispatch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_map

DEVICE = torch.device("meta")
PLACES = (torch.ops.aten.index.Tensor, torch.ops.aten.index_put_.default, torch.ops.aten.index_put.default)
"""Whose indices may lie on the processor."""


class Elsewhere(torch.Tensor):
    """A tensor on the second device."""

    __torch_function__ = torch._C._disabled_torch_function_impl

    @staticmethod
    def __new__(cls, held):
        dense = held.layout == torch.strided
        strides = {"strides": held.stride(), "storage_offset": held.storage_offset()} if dense else {}
        return torch.Tensor._make_wrapper_subclass(
            cls, held.shape, device=DEVICE, dtype=held.dtype, layout=held.layout, **strides
        )

    def __init__(self, held):
        self.held = held

    def tolist(self):
        return self.cpu().tolist()

    @classmethod
    def __torch_dispatch__(cls, operation, types, args=(), kwargs=None):
        return run(operation, args, kwargs or {})


class _Everywhere(TorchDispatchMode):
    def __torch_dispatch__(self, operation, types, args=(), kwargs=None):
        return run(operation, args, kwargs or {})


class _FromNumbers(TorchFunctionMode):
    """Of numbers, torch makes a tensor on `meta` at once, without them: it is made on the processor and moved."""

    def __torch_function__(self, function, types, args=(), kwargs=None):
        kwargs = dict(kwargs or {})
        if function in (torch.tensor, torch.as_tensor, torch.Tensor.new_tensor) and kwargs.get("device") is not None:
            device = kwargs.pop("device")
            return function(*args, **kwargs).to(device)
        return function(*args, **kwargs)


@contextmanager
def second_device():
    """While it is there, `to(DEVICE)` and factories with `device=DEVICE` make tensors on it."""
    with _Everywhere(), _FromNumbers():
        yield DEVICE


def run(operation, args, kwargs):
    tensors = [value for value in tree_flatten((args, kwargs))[0] if isinstance(value, torch.Tensor)]
    there = any(isinstance(tensor, Elsewhere) for tensor in tensors)
    asked = kwargs.get("device")
    moves = operation in (torch.ops.aten._to_copy.default, torch.ops.aten.copy_.default)
    if there and not moves:
        _require_one_device(operation, tensors)
    owners = {id(tensor.held): tensor for tensor in tensors if isinstance(tensor, Elsewhere)}
    plain = tree_map(lambda value: value.held if isinstance(value, Elsewhere) else value, (args, kwargs))
    if asked is not None:
        plain[1]["device"] = torch.device("cpu")
    stays = torch.device(asked) == DEVICE if asked is not None else there
    result = operation(*plain[0], **plain[1])
    if there and torch.Tag.inplace_view in operation.tags:
        with no_dispatch():  # the shape that the tensor states changes as that of what it holds did
            operation(*args, **kwargs)
    return tree_map(lambda value: owners[id(value)] if id(value) in owners else _placed(value, stays), result)


def _placed(value, stays):
    return Elsewhere(value.resolve_conj().resolve_neg()) if stays and isinstance(value, torch.Tensor) else value


def _require_one_device(operation, tensors):
    """A number of the processor, and its indices, may meet tensors of another device; nothing else may."""
    strangers = [tensor for tensor in tensors if not isinstance(tensor, Elsewhere) and tensor.ndim > 0]
    if operation in PLACES:
        strangers = [tensor for tensor in strangers if tensor.dtype.is_floating_point]
    assert not strangers, f"{operation}: {[tuple(t.shape) for t in strangers]} on the processor, the others on the device"
