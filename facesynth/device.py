"""Where tensors live: the processor, or an accelerator beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from facesynth.inference.errors import FacesynthError, unknown

if TYPE_CHECKING:
    import torch

DEVICES = ("auto", "cpu", "cuda", "mps")


def device_of(name: str) -> torch.device:
    """The device that a person names: one of DEVICES, or a numbered one such as cuda:1; FacesynthError where it is not there.

    `auto` is a CUDA device, or else the processor: Apple's (mps) has no float64, which maps and sound features need.
    """
    import torch

    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    kind, _, number = name.partition(":")
    if kind not in DEVICES or (number and not number.isdecimal()):
        raise unknown("device", name, DEVICES)
    count = {"cuda": torch.cuda.device_count(), "mps": int(torch.backends.mps.is_available())}.get(kind, 1)
    if int(number or 0) >= count:
        there = ", ".join(f"{kind}:{i}" for i in range(count)) or "none of the kind"
        raise FacesynthError(f"there is no device {name} here (found: {there}); take auto or cpu")
    return torch.device(name)
