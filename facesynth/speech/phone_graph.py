"""The phone network as an ONNX graph: what hears phones wherever facesynth is installed, with torch or without."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.graph_builder import Builder
from facesynth.inference.errors import FacesynthError
from facesynth.inference.graphs import session_of
from facesynth.inference.phone_hearing import PhoneHearing
from facesynth.inference.phones import SILENCE
from facesynth.inference.spikes import Alphabet
from facesynth.speech.phone_archive import read_archive
from facesynth.speech.phone_labels import normalise_phone
from facesynth.speech.phone_weights import BLOCKS, EPSILON, HEADS, HOP, SMALLEST_POWER, WIDTH, WINDOW, Weights, network_weights

GLIDES = "jw"
"""What begins a token for two sounds."""
OUTPUTS = ("log_probabilities", "hidden")


@cache
def phone_hearing() -> PhoneHearing:
    """The installed network, ready to hear; FacesynthError where it is missing or changed."""
    archive = read_archive()
    session = session_of(phone_graph(network_weights(archive)).model().SerializeToString(), threads=1)

    def network(*, audio: NDArray[np.float32]) -> list[NDArray[Any]]:
        heard: list[NDArray[Any]] = session.run(OUTPUTS, {"audio": np.ascontiguousarray(audio, np.float32)})
        return heard

    return PhoneHearing(network, alphabet_of(archive.tokens))


def alphabet_of(tokens: Sequence[str]) -> Alphabet:
    """What tokens in IPA stand for on a face; marks, tones and breath stand for nothing."""
    return Alphabet(tuple(tokens), tuple(map(_phones_of, tokens)))


def _phones_of(token: str) -> tuple[str, ...]:
    """As one label; a glide and a vowel (`ja`) letter by letter, and so what is no label."""
    if token.startswith("<") or not token.strip():
        return ()
    if len(token) == 2 and token[0] in GLIDES:
        return tuple(phone for letter in token for phone in _phones_of(letter))
    try:
        return tuple(phone for phone in (normalise_phone(token, "ipa"),) if phone != SILENCE)
    except FacesynthError:
        return tuple(phone for letter in token for phone in _phones_of(letter)) if len(token) > 1 else ()


def hidden_graph(weights: Weights, layer: int) -> Builder:
    """Sound [B, S] to the output [B, T, WIDTH] of one of the blocks alone, T = 1 + S // STEP."""
    b = Builder("phone_net")
    x = _stem(b, weights, b.input("audio", "float32", ("batch", "samples")))
    for number in range(layer + 1):
        x = _block(b, weights, f"blocks.{number}.", x)
    b.output(x, OUTPUTS[1], "float32", ("batch", "frames", WIDTH))
    return b


def phone_graph(weights: Weights) -> Builder:
    """Sound [B, S] to log-probabilities [B, T, V] and the blocks' outputs [B, T, BLOCKS, WIDTH], T = 1 + S // STEP."""
    b = Builder("phones")
    x = _stem(b, weights, b.input("audio", "float32", ("batch", "samples")))
    hidden = []
    for number in range(BLOCKS):
        x = _block(b, weights, f"blocks.{number}.", x)
        hidden.append(b.op("Unsqueeze", x, b.ints(2)))
    tokens = len(weights["head.bias"])
    b.output(b.op("LogSoftmax", _linear(b, weights, "head", x), axis=-1), OUTPUTS[0], "float32", ("batch", "frames", tokens))
    b.output(b.op("Concat", *hidden, axis=2), OUTPUTS[1], "float32", ("batch", "frames", BLOCKS, WIDTH))
    return b


def _stem(b: Builder, weights: Weights, audio: str) -> str:
    """[B, T, W] log-mel bands of mirrored sound, every second frame of a convolution of them."""
    half = WINDOW // 2
    mirrored = b.op("Pad", b.op("Unsqueeze", audio, b.ints(1)), b.ints(0, 0, half, 0, 0, half), mode="reflect")
    both = b.op("Conv", mirrored, b.constant(weights["spectrum"].T[:, None]), strides=[HOP])  # [B, 402, F]
    real, imaginary = b.ops("Split", 2, b.op("Mul", both, both), axis=1, num_outputs=2)
    power = b.op("Transpose", b.op("Add", real, imaginary), perm=[0, 2, 1])
    energy = b.op("MatMul", power, b.constant(weights["filters"]))
    bands = b.op("Log", b.op("Max", energy, b.constant(SMALLEST_POWER, "float32")))
    seen = _convolved(b, weights, "stem", b.op("Transpose", bands, perm=[0, 2, 1]), pads=[1, 1], strides=[2])
    return b.op("Transpose", b.op("Gelu", seen), perm=[0, 2, 1])


def _block(b: Builder, weights: Weights, block: str, x: str) -> str:
    """A Conformer block (Gulati et al. 2020, eq. 1)."""
    half = b.constant(0.5, "float32")
    x = b.op("Add", x, b.op("Mul", _feed_forward(b, weights, f"{block}first.", x), half))
    x = b.op("Add", x, _attention(b, weights, f"{block}attention.", x))
    x = b.op("Add", x, _convolution(b, weights, f"{block}convolution.", x))
    return _normed(b, weights, f"{block}norm", b.op("Add", x, b.op("Mul", _feed_forward(b, weights, f"{block}last.", x), half)))


def _feed_forward(b: Builder, weights: Weights, part: str, x: str) -> str:
    wide = _silu(b, _linear(b, weights, f"{part}wide", _normed(b, weights, f"{part}norm", x)))
    return _linear(b, weights, f"{part}back", wide)


def _attention(b: Builder, weights: Weights, part: str, x: str) -> str:
    each = WIDTH // HEADS
    together = _linear(b, weights, f"{part}heads", _normed(b, weights, f"{part}norm", x))
    q, k, v = (
        b.op("Transpose", b.op("Reshape", third, b.ints(0, 0, HEADS, each)), perm=[0, 2, 1, 3])
        for third in b.ops("Split", 3, together, axis=2, num_outputs=3)
    )  # each [B, heads, T, W / heads]
    alike = b.op("MatMul", q, b.op("Transpose", k, perm=[0, 1, 3, 2]))
    shares = b.op("Softmax", b.op("Mul", alike, b.constant(each**-0.5, "float32")), axis=-1)
    seen = b.op("Transpose", b.op("MatMul", shares, v), perm=[0, 2, 1, 3])
    return _linear(b, weights, f"{part}out", b.op("Reshape", seen, b.ints(0, 0, WIDTH)))


def _convolution(b: Builder, weights: Weights, part: str, x: str) -> str:
    both = _linear(b, weights, f"{part}gate", _normed(b, weights, f"{part}norm", x))
    values, gate = b.ops("Split", 2, both, axis=2, num_outputs=2)
    gated = b.op("Transpose", b.op("Mul", values, b.op("Sigmoid", gate)), perm=[0, 2, 1])
    reach = weights[f"{part}along_time.weight"].shape[-1] // 2
    along = _convolved(b, weights, f"{part}along_time", gated, pads=[reach, reach], group=WIDTH)
    return _linear(b, weights, f"{part}out", _silu(b, b.op("Transpose", along, perm=[0, 2, 1])))


def _silu(b: Builder, x: str) -> str:
    return b.op("Mul", x, b.op("Sigmoid", x))


def _linear(b: Builder, weights: Weights, layer: str, x: str) -> str:
    return b.op("Add", b.op("MatMul", x, b.constant(weights[f"{layer}.weight"].T)), b.constant(weights[f"{layer}.bias"]))


def _normed(b: Builder, weights: Weights, layer: str, x: str) -> str:
    scale, shift = b.constant(weights[f"{layer}.weight"]), b.constant(weights[f"{layer}.bias"])
    return b.op("LayerNormalization", x, scale, shift, axis=-1, epsilon=EPSILON)


def _convolved(b: Builder, weights: Weights, layer: str, x: str, **attributes: Any) -> str:
    return b.op("Conv", x, b.constant(weights[f"{layer}.weight"]), b.constant(weights[f"{layer}.bias"]), **attributes)
