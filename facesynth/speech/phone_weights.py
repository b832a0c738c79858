"""The phone network's shape, and its weights by the names that its layers have, whichever engine runs them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.ear import STEP
from facesynth.speech.phone_archive import PhoneArchive

HOP, WINDOW = STEP // 2, 400
"""Samples between frames of the spectrum, and in each."""
BLOCKS, WIDTH, HEADS, KERNEL = 4, 144, 4, 31
BANDS = 80
SMALLEST_POWER = 1e-10
EPSILON = 1e-5
"""Of the norms of layers."""

Weights = Mapping[str, NDArray[Any]]


# The archive comes from a graph whose constants lost their names: convolutions are numbered in the order in which they are
# applied, and so are the matrices of each block (two of a feed-forward, two of attention, two of the last feed-forward).
def network_weights(archive: PhoneArchive) -> dict[str, NDArray[Any]]:
    """Weights by the names that they have in `PhoneNetwork`."""
    arrays = archive.weights
    convolutions, matrices = _numbered(arrays, "onnx::Conv_"), _numbered(arrays, "onnx::MatMul_")
    found = {"stem.weight": convolutions[0], "stem.bias": convolutions[1], "filters": arrays["mel_fb"]}
    found["spectrum"] = np.concatenate([arrays["stft_real_kernel"], arrays["stft_imag_kernel"]])[:, 0].T
    found |= {f"head.{kind}": arrays[f"acoustic_model.model.proj.{kind}"].squeeze() for kind in ("weight", "bias")}
    for number in range(BLOCKS):
        ours, theirs = f"blocks.{number}.", f"acoustic_model.model.blocks.{number}."
        names = ("first.wide", "first.back", "attention.heads", "attention.out", "last.wide", "last.back")
        found |= {f"{ours}{name}.weight": matrices[6 * number + k].T for k, name in enumerate(names)}
        found[f"{ours}convolution.along_time.weight"] = convolutions[2 + 2 * number]
        found[f"{ours}convolution.along_time.bias"] = convolutions[3 + 2 * number]
        for new, old in _NAMES.items():
            found |= {f"{ours}{new}.{kind}": arrays[f"{theirs}{old}.{kind}"].squeeze() for kind in ("weight", "bias")}
        found |= {f"{ours}{name}.bias": arrays[theirs + old] for name, old in _BIASES.items()}
    return {name: np.ascontiguousarray(array, np.float32) for name, array in found.items()}


_NAMES = {
    **{f"{new}.norm": f"{old}.norm" for new, old in (("first", "ffn1"), ("last", "ffn2"), ("convolution", "conv"))},
    **{
        "attention.norm": "attn_norm",
        "norm": "norm",
        "convolution.gate": "conv.pointwise1",
        "convolution.out": "conv.pointwise2",
    },
}
_BIASES = {
    **{"first.wide": "ffn1.fc1.bias", "first.back": "ffn1.fc2.bias", "last.wide": "ffn2.fc1.bias", "last.back": "ffn2.fc2.bias"},
    **{"attention.heads": "attn.in_proj_bias", "attention.out": "attn.out_proj.bias"},
}


def _numbered(arrays: Weights, prefix: str) -> list[NDArray[Any]]:
    names = [name for name in arrays if name.startswith(prefix)]
    return [arrays[name] for name in sorted(names, key=lambda name: int(name.removeprefix(prefix)))]
