"""The phone network as a graph and as a folder that hears phones without torch."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from facesynth.export.builder import Builder
from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.graph import Graph, Port
from facesynth.export.weights import Weights, stored_as
from facesynth.inference.ear import FRAMES_PER_S, RATE, STEP, WHOLE
from facesynth.speech.phone_archive import NOTICE
from facesynth.speech.phone_network import (
    BLOCKS,
    HEADS,
    HOP,
    SMALLEST_POWER,
    WIDTH,
    WINDOW,
    Attention,
    Convolution,
    FeedForward,
    PhoneNetwork,
    alphabet_of,
    phone_network,
)


def export_phones(folder: str | Path, weights: Weights = "float32") -> dict[str, Any]:
    """Write the network that hears phones; returns the manifest."""
    network = phone_network()
    latency = {"look_ahead_s": WHOLE.look_ahead_s, "about": "of whole sounds; a stream states its own"}
    alphabet = alphabet_of(network.tokens)
    settings = {"tokens": list(alphabet.tokens), "phones_of_tokens": list(map(list, alphabet.phones)), "notice": NOTICE}
    content = Content((phone_graph(network),), settings, latency, RATE)
    data = {"performer": "unknown", "licences": ["Apache-2.0 (weights)"], "consents": ["not stated by hama 1.7.0"]}
    return write_folder(folder, Subject("phones", data, None, None, ()), stored_as(content, weights))


def phone_graph(network: PhoneNetwork) -> Graph:
    """Sound [B, S] to log-probabilities [B, T, V] and the blocks' outputs [B, T, BLOCKS, WIDTH], T = 1 + S // STEP."""
    b = Builder("phones")
    x = _stem(b, network, b.input("audio", "float32", ("batch", "samples")))
    hidden = []
    for block in network.blocks:
        x = _block(b, block, x)
        hidden.append(b.op("Unsqueeze", x, b.ints(2)))
    tokens = len(network.tokens)
    outputs = (
        Port("log_probabilities", "float32", ("batch", "frames", tokens), "natural logarithm", FRAMES_PER_S),
        Port("hidden", "float32", ("batch", "frames", BLOCKS, WIDTH), "none", FRAMES_PER_S),
    )
    values = b.op("LogSoftmax", _linear(b, network.head, x), axis=-1), b.op("Concat", *hidden, axis=2)
    for value, port in zip(values, outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)
    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", RATE)
    about = "IPA tokens that are said (CTC), and what four Conformer blocks made of the sound"
    return Graph("phones", about, b.model(), (sound,), outputs, _sound, lambda arrays: network.part(**arrays))


def _sound(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    return {"audio": (0.1 * rng.standard_normal((batch, STEP * length + 7))).astype(np.float32)}


def _stem(b: Builder, network: PhoneNetwork, audio: str) -> str:
    """[B, T, W] log-mel bands of mirrored sound, every second frame of a convolution of them."""
    half = WINDOW // 2
    mirrored = b.op("Pad", b.op("Unsqueeze", audio, b.ints(1)), b.ints(0, 0, half, 0, 0, half), mode="reflect")
    kernels = network.spectrum.T[:, None].numpy()
    both = b.op("Conv", mirrored, b.constant(kernels), strides=[HOP])  # [B, 402, F]
    real, imaginary = b.ops("Split", 2, b.op("Mul", both, both), axis=1, num_outputs=2)
    power = b.op("Transpose", b.op("Add", real, imaginary), perm=[0, 2, 1])
    energy = b.op("MatMul", power, b.constant(network.filters.numpy()))
    bands = b.op("Log", b.op("Max", energy, b.constant(SMALLEST_POWER, "float32")))
    seen = _convolved(b, network.stem, b.op("Transpose", bands, perm=[0, 2, 1]), pads=[1, 1], strides=[2])
    return b.op("Transpose", b.op("Gelu", seen), perm=[0, 2, 1])


def _block(b: Builder, block: Any, x: str) -> str:
    """A `Block`, which a list of modules gives as any module."""
    half = b.constant(0.5, "float32")
    x = b.op("Add", x, b.op("Mul", _feed_forward(b, block.first, x), half))
    x = b.op("Add", x, _attention(b, block.attention, x))
    x = b.op("Add", x, _convolution(b, block.convolution, x))
    return _normed(b, block.norm, b.op("Add", x, b.op("Mul", _feed_forward(b, block.last, x), half)))


def _feed_forward(b: Builder, part: FeedForward, x: str) -> str:
    return _linear(b, part.back, _silu(b, _linear(b, part.wide, _normed(b, part.norm, x))))


def _attention(b: Builder, part: Attention, x: str) -> str:
    each = WIDTH // HEADS
    together = _linear(b, part.heads, _normed(b, part.norm, x))
    q, k, v = (
        b.op("Transpose", b.op("Reshape", third, b.ints(0, 0, HEADS, each)), perm=[0, 2, 1, 3])
        for third in b.ops("Split", 3, together, axis=2, num_outputs=3)
    )  # each [B, heads, T, W / heads]
    alike = b.op("MatMul", q, b.op("Transpose", k, perm=[0, 1, 3, 2]))
    shares = b.op("Softmax", b.op("Mul", alike, b.constant(each**-0.5, "float32")), axis=-1)
    seen = b.op("Transpose", b.op("MatMul", shares, v), perm=[0, 2, 1, 3])
    return _linear(b, part.out, b.op("Reshape", seen, b.ints(0, 0, WIDTH)))


def _convolution(b: Builder, part: Convolution, x: str) -> str:
    values, gate = b.ops("Split", 2, _linear(b, part.gate, _normed(b, part.norm, x)), axis=2, num_outputs=2)
    gated = b.op("Transpose", b.op("Mul", values, b.op("Sigmoid", gate)), perm=[0, 2, 1])
    reach = part.along_time.kernel_size[0] // 2
    along = _convolved(b, part.along_time, gated, pads=[reach, reach], group=WIDTH)
    return _linear(b, part.out, _silu(b, b.op("Transpose", along, perm=[0, 2, 1])))


def _silu(b: Builder, x: str) -> str:
    return b.op("Mul", x, b.op("Sigmoid", x))


def _linear(b: Builder, layer: nn.Linear, x: str) -> str:
    return b.op("Add", b.op("MatMul", x, b.constant(layer.weight.T.numpy())), b.constant(layer.bias.numpy()))


def _normed(b: Builder, layer: nn.LayerNorm, x: str) -> str:
    scale, shift = b.constant(layer.weight.numpy()), b.constant(layer.bias.numpy())
    return b.op("LayerNormalization", x, scale, shift, axis=-1, epsilon=layer.eps)


def _convolved(b: Builder, layer: nn.Conv1d, x: str, **attributes: Any) -> str:
    weights = [b.constant(value.numpy()) for value in (layer.weight, layer.bias) if value is not None]
    return b.op("Conv", x, *weights, **attributes)
