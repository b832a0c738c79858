"""Modules of torch, called as the graphs of an exported folder are: named arrays in, arrays out."""

from collections.abc import Callable, Sequence
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor


def part(function: Callable[..., Sequence[Tensor]], device: torch.device) -> Callable[..., list[NDArray[Any]]]:
    """A function of named tensors on a device, as a function of named arrays; nothing is learned through it."""

    @torch.no_grad()
    def run(**arrays: NDArray[Any]) -> list[NDArray[Any]]:
        tensors = {name: torch.from_numpy(array).to(device) for name, array in arrays.items()}
        return [result.cpu().numpy() for result in function(**tensors)]

    return run
