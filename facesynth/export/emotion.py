"""The emotion detector as graphs: the front end of its features, and the machine with its probabilities."""

from itertools import combinations

import numpy as np

from facesynth.export.folder import Content
from facesynth.export.graph import Graph, Port
from facesynth.export.phones import phone_network_graph
from facesynth.export.speech_graphs import cepstrum_graph, mel_cepstra_graph
from facesynth.graph_builder import Builder
from facesynth.inference.emotion_track import HOP_S, WINDOW_S
from facesynth.inference.pitch import RATE
from facesynth.methods.emotion.detector import EmotionDetector
from facesynth.methods.emotion.pairwise import DEGREE
from facesynth.methods.emotion.probabilities import CLOSEST_TO_CERTAIN
from facesynth.methods.parts import part
from facesynth.speech.mel_cepstra import MelCepstra


def emotion_content(detector: EmotionDetector) -> Content:
    """Everything that the runtime needs of a trained detector."""
    front = mel_cepstra_graph(detector.front) if isinstance(detector.front, MelCepstra) else cepstrum_graph(detector.front, RATE)
    heard = (phone_network_graph(),) if detector.settings.features == "voice_and_phone_net" else ()
    return Content(
        graphs=(front, machine_graph(detector), *heard),
        settings={
            "features": detector.settings.features,
            "feature_count": len(detector.shift),
            "normalise": detector.settings.normalise,
            "classifier": detector.settings.classifier,
            "kernel": detector.machine.kernel,
        },
        latency={
            "look_ahead_s": WINDOW_S,
            "about": f"a stream reads windows of {WINDOW_S:g} s (window_s) every {HOP_S:g} s (hop_s); "
            "a reading is final when its window is full",
        },
        sample_rate=RATE,
    )


def machine_graph(detector: EmotionDetector) -> Graph:
    """Features [B, F] to margins [B, pairs], calibrated probabilities [B, K] and the decision [B]."""
    machine, classes = detector.machine, len(detector.emotions)
    width, pairs = len(detector.shift), list(combinations(range(classes), 2))
    b = Builder("machine")
    x = b.input("features", "float64", ("batch", width))
    scaled = b.op("Mul", b.op("Sub", x, b.constant(detector.shift.numpy())), b.constant(detector.scale.numpy()))
    margins = b.op("Add", _similarity(b, scaled, detector, width), b.constant(machine.offsets.numpy()))
    slopes, offsets = machine.sigmoids.numpy().T
    exponent = b.op("Add", b.op("Mul", margins, b.constant(slopes)), b.constant(offsets))
    probabilities = _coupled(b, b.op("Sigmoid", b.op("Neg", exponent)), classes)
    first, second = np.array(pairs).T
    won = b.op("Cast", b.op("Greater", margins, b.constant(0.0, "float64")), to=11)
    lost = b.op("Sub", b.constant(1.0, "float64"), won)
    votes = [b.op("MatMul", side, b.constant(np.eye(classes)[who])) for side, who in ((won, first), (lost, second))]
    ranked = b.op("Sub", b.op("Sum", *votes), b.constant(np.arange(classes) / (classes + 1)))
    outputs = (
        Port("margins", "float64", ("batch", len(pairs)), "none"),
        Port("probabilities", "float64", ("batch", classes), "0..1"),
        Port("decision", "int64", ("batch",), "index of the emotion"),
    )
    decision = b.op("ArgMax", ranked, axis=-1, keepdims=0)
    for value, port in zip((margins, probabilities, decision), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)

    judge = part(detector.judge, detector.shift.device)
    shift, spread = detector.shift.numpy(), 1 / np.maximum(detector.scale.numpy(), 1e-9)
    return Graph(
        "machine",
        "a classifier of pairs: margins, Platt's sigmoids, coupled probabilities; the decision is by votes",
        b.model(),
        (Port("features", "float64", ("batch", width), "see settings.features"),),
        outputs,
        lambda batch, count, rng: {"features": shift + spread * rng.standard_normal((batch * count, width))},
        lambda arrays: judge(**arrays),
    )


def _similarity(b: Builder, x: str, detector: EmotionDetector, width: int) -> str:
    machine = detector.machine
    weights = b.constant(machine.weights.numpy().T)
    if machine.kernel == "linear":
        return b.op("MatMul", x, weights)
    vectors = machine.vectors.numpy()
    inner = b.op("MatMul", x, b.constant(vectors.T))
    if machine.kernel == "polynomial":
        scaled = b.op("Div", inner, b.constant(float(width)))
        return b.op("MatMul", b.op("Pow", scaled, b.constant(float(DEGREE))), weights)
    own = b.op("ReduceSum", b.op("Mul", x, x), b.ints(-1), keepdims=1)
    total = b.op("Add", own, b.constant(np.square(vectors).sum(axis=1)))
    squared = b.op("Max", b.op("Sub", total, b.op("Mul", inner, b.constant(2.0))), b.constant(0.0))
    return b.op("MatMul", b.op("Exp", b.op("Div", squared, b.constant(-float(width)))), weights)


# Wu, Lin and Weng 2004: p minimises pᵀ Q p with sum p = 1. ONNX solves no linear systems, so p_K = 1 - sum of the others
# is put in, which leaves a symmetric positive definite system of K - 1 unknowns; elimination without pivoting is safe on it.
def _coupled(b: Builder, pairwise: str, classes: int) -> str:
    safe = b.op("Clip", pairwise, b.constant(CLOSEST_TO_CERTAIN), b.constant(1 - CLOSEST_TO_CERTAIN))
    count = classes * (classes - 1) // 2
    columns = b.ops("Split", count, safe, axis=1, num_outputs=count) if count > 1 else [safe]
    r: dict[tuple[int, int], str] = {}
    for (i, j), column in zip(combinations(range(classes), 2), columns, strict=True):
        r[i, j], r[j, i] = column, b.op("Sub", b.constant(1.0), column)
    Q = {(i, j): b.op("Neg", b.op("Mul", r[j, i], r[i, j])) for i in range(classes) for j in range(classes) if i != j}
    for i in range(classes):
        Q[i, i] = b.op("Sum", *(b.op("Mul", r[j, i], r[j, i]) for j in range(classes) if j != i))
    last, rest = classes - 1, range(classes - 1)
    H = {(i, j): _reduced(b, Q, i, j, last) for i in rest for j in rest}
    g = {i: b.op("Sub", Q[last, last], Q[i, last]) for i in rest}
    for k in rest:
        for i in range(k + 1, classes - 1):
            factor = b.op("Div", H[i, k], H[k, k])
            for j in range(k + 1, classes - 1):
                H[i, j] = b.op("Sub", H[i, j], b.op("Mul", factor, H[k, j]))
            g[i] = b.op("Sub", g[i], b.op("Mul", factor, g[k]))
    p: dict[int, str] = {}
    for i in reversed(rest):
        left = g[i]
        for j in range(i + 1, classes - 1):
            left = b.op("Sub", left, b.op("Mul", H[i, j], p[j]))
        p[i] = b.op("Div", left, H[i, i])
    p[last] = b.op("Sub", b.constant(1.0), b.op("Sum", *(p[i] for i in rest)))
    solved = b.op("Max", b.op("Concat", *(p[i] for i in range(classes)), axis=1), b.constant(0.0))
    return b.op("Div", solved, b.op("ReduceSum", solved, b.ints(1), keepdims=1))


def _reduced(b: Builder, Q: dict[tuple[int, int], str], i: int, j: int, last: int) -> str:
    """Q_ij - Q_iK - Q_Kj + Q_KK."""
    return b.op("Add", b.op("Sub", b.op("Sub", Q[i, j], Q[i, last]), Q[last, j]), Q[last, last])
