"""The linear dynamical system as graphs: sound to features, uniform numbers to innovations, both to frames."""

from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from facesynth.export.expectation import hearing_graphs
from facesynth.export.folder import Content
from facesynth.export.graph import Graph, Port
from facesynth.graph_builder import Builder, power_spectrum
from facesynth.inference.heard_input import ARRAYS
from facesynth.methods.lds.method import LDS
from facesynth.speech.periodogram import COEFFICIENTS, FLOOR, RATE, STEP


def lds_content(model: LDS) -> Content:
    """Everything that the runtime needs of a trained system."""
    return Content(
        graphs=(*_hearing(model), innovations_graph(model), rollout_graph(model)),
        settings=asdict(model.settings),
        latency={
            "look_ahead_s": model.speaker().look_ahead_s,
            "about": "frame t is final when the sound up to t / fps + look_ahead_s is known; streaming equals the whole",
        },
        sample_rate=RATE,
        arrays={}
        if model.listener is None
        else {f"heard_{name}": getattr(model.listener, name).cpu().numpy() for name in ARRAYS},
    )


def _hearing(model: LDS) -> tuple[Graph, ...]:
    return (features_graph(model),) if model.listener is None else hearing_graphs(model.listener.hearing)


def features_graph(model: LDS) -> Graph:
    """Windows of sound [B, T, L] to the periodogram [B, T, S 256] and the system's input [B, T, m]."""
    part, periodogram = model.features, model.periodogram
    length, coefficients = periodogram.length, COEFFICIENTS * periodogram.parts
    width, each = len(part.scale), periodogram.bins_each
    b = Builder("features")
    windows = b.input("windows", "float32", ("batch", "frames", length))
    if periodogram.around:
        places = STEP * np.arange(periodogram.parts)[:, None] + np.arange(len(periodogram.window))
        windows = b.op("Gather", windows, b.constant(places), axis=2)
    bins = np.arange(1, 1 + COEFFICIENTS * each)
    power = power_spectrum(b, windows, periodogram.window.numpy(), bins, 2 * COEFFICIENTS * each, "float32")
    if each > 1:
        averaging = np.repeat(np.eye(COEFFICIENTS), each, axis=0) / each
        power = b.op("MatMul", power, b.constant(averaging, "float32"))
    if periodogram.scale == "log":
        power = b.op("Log", b.op("Add", power, b.constant(FLOOR, "float32")))
    if periodogram.around:
        power = b.op("Reshape", power, b.ints(0, 0, coefficients))
    components = b.op("MatMul", b.op("Sub", power, b.constant(part.pca.mean.numpy())), b.constant(part.pca.basis.numpy()))
    scaled = b.op("Div", components, b.constant(part.scale.numpy()))
    held = b.op("Min", b.op("Max", scaled, b.constant(part.low.numpy())), b.constant(part.high.numpy()))
    outputs = (
        Port("periodogram", "float32", ("batch", "frames", coefficients), f"{periodogram.scale} power", model.fps),
        Port("features", "float32", ("batch", "frames", width), "standard deviations", model.fps),
    )
    for value, port in zip((power, held), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)

    return Graph(
        "features",
        "windows of the sound, each centred on its frame, to the input of the system",
        b.model(),
        (Port("windows", "float32", ("batch", "frames", length), "full scale 1", RATE),),
        outputs,
        lambda batch, count, rng: {"windows": (0.1 * rng.standard_normal((batch, count, length))).astype(np.float32)},
        lambda arrays: model.speaker().features(**arrays),
    )


def innovations_graph(model: LDS) -> Graph:
    """Uniform numbers [B, T, p] in 0..1 to innovations [B, T, p]: the inverse of each source's cumulative histogram."""
    part = model.innovations
    p = len(part.edges)
    b = Builder("innovations")
    uniform = b.input("uniform", "float32", ("batch", "frames", p))
    cumulative, places = part.cumulative.numpy(), part.edges.numpy()
    # np.interp on a rising staircase: each step adds its share of the way, clipped to 0..1.
    rise = np.maximum(np.diff(cumulative, axis=1), 1e-30)
    above = b.op("Sub", b.op("Unsqueeze", uniform, b.ints(-1)), b.constant(cumulative[:, :-1]))
    share = b.op("Clip", b.op("Div", above, b.constant(rise, "float32")), b.constant(0.0, "float32"), b.constant(1.0, "float32"))
    steps = b.op("Mul", share, b.constant(np.diff(places, axis=1), "float32"))
    sources = b.op("Add", b.op("ReduceSum", steps, b.ints(-1), keepdims=0), b.constant(places[:, 0]))
    port = Port("innovations", "float32", ("batch", "frames", p), "standard deviations of the shape", model.fps)
    b.output(b.op("MatMul", sources, b.constant(part.mixing.numpy().T)), port.name, port.dtype, port.shape)

    return Graph(
        "innovations",
        "independent uniform numbers in 0..1 to the noise that drives the system",
        b.model(),
        (Port("uniform", "float32", ("batch", "frames", p), "0..1", model.fps),),
        (port,),
        lambda batch, count, rng: {"uniform": rng.random((batch, count, p)).astype(np.float32)},
        lambda arrays: model.speaker().innovations(**arrays),
    )


def rollout_graph(model: LDS) -> Graph:
    """Features [B, T, m], innovations [B, T, p] and a state [B, n] to frames [B, T, C] and the state after them."""
    layout, system, shape = model.fitted_layout, model.rollout, model.shape
    n, p = len(system.A), len(system.C)
    C, D = (matrix.numpy() for matrix in system.shown)
    m = system.B.shape[1] - p
    b = Builder("rollout")
    inputs = (
        Port("features", "float32", ("batch", "frames", m), "standard deviations", model.fps),
        Port("innovations", "float32", ("batch", "frames", p), "standard deviations of the shape", model.fps),
        Port("state", "float32", ("batch", n), "none"),
    )
    u, e, state = (b.input(port.name, port.dtype, port.shape) for port in inputs)
    drive = b.op("Concat", u, e, axis=-1)
    push = b.op("Transpose", b.op("MatMul", drive, b.constant(system.B.numpy().T)), perm=[1, 0, 2])
    after, states = b.ops("Scan", 2, state, push, body=_step(system.A.numpy()).graph(), num_scan_inputs=1)
    seen = b.op("MatMul", b.op("Transpose", states, perm=[1, 0, 2]), b.constant(C.T))
    components = b.op("Add", seen, b.op("MatMul", drive, b.constant(D.T)))
    decoder = shape.scale.numpy()[:, None] * shape.pca.basis.numpy().T
    frames = b.op("Add", b.op("MatMul", components, b.constant(decoder)), b.constant(shape.pca.mean.numpy()))
    if layout.kind == "curves":
        frames = b.op("Clip", frames, b.constant(0.0, "float32"), b.constant(1.0, "float32"))
    outputs = (
        Port("frames", "float32", ("batch", "frames", layout.channels), layout.unit, model.fps),
        Port("state_after", "float32", ("batch", n), "none"),
    )
    for value, port in zip((frames, after), outputs, strict=True):
        b.output(value, port.name, port.dtype, port.shape)

    return Graph(
        "rollout",
        "the system itself, a scan over frames: feed it pieces and hand the state on",
        b.model(),
        inputs,
        outputs,
        lambda batch, count, rng: {
            "features": rng.standard_normal((batch, count, m)).astype(np.float32),
            "innovations": (0.1 * rng.standard_normal((batch, count, p))).astype(np.float32),
            "state": rng.standard_normal((batch, n)).astype(np.float32),
        },
        lambda arrays: model.speaker().rollout(**arrays),
    )


def _step(A: NDArray[np.float32]) -> Builder:
    """x, push -> A x + push, x."""
    body = Builder("step")
    x = body.input("x", "float32", ("batch", len(A)))
    push = body.input("push", "float32", ("batch", len(A)))
    moved = body.op("Add", body.op("MatMul", x, body.constant(A.T)), push)
    body.output(moved, "x_next", "float32", ("batch", len(A)))
    body.output(x, "x_here", "float32", ("batch", len(A)))
    return body
