"""ARKit weights from markers as a graph: the bounded least squares of `facesynth.face.solve.blendshapes`, by another road.

Coordinate descent visits weights one by one, which a graph is slow at. The problem is strictly convex, so that any
method ends in the same weights: here accelerated projected gradients on all frames at once, in coordinates in which
the shapes have length 1, until no weight moves.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.solve.blendshapes import GAP_WEIGHT, MarkerBasis, follow_gap
from facesynth.face.solve.bounded import SMOOTHING_S, solve
from facesynth.graph_builder import Builder
from facesynth.inference.layout import Layout
from facesynth.motion.arkit_names import ARKIT_NAMES

STEPS = 6000
SETTLED = 1e-8
"""No weight moves by more than this in a step."""
EXAMPLE_FPS = 30.0


def arkit_weights_graph(rig: Rig, layout: Layout) -> Graph:
    """Markers [B, T, 3K] and their rate to the 52 weights [B, T, 52]; the weights of gaze and tongue are 0."""
    basis = MarkerBasis.of(rig, layout)
    channels = basis.shapes_mm.shape[1]
    b = Builder("arkit_weights")
    inputs = (Port("frames", "float64", ("batch", "frames", channels), "mm"), Port("fps", "float64", (), "Hz"))
    frames, fps = (b.input(port.name, port.dtype, port.shape) for port in inputs)
    offsets = b.op("Sub", frames, b.constant(basis.rest_mm))
    port = Port("weights", "float64", ("batch", "frames", len(basis.shapes_mm)), "0..1")
    b.output(_gap_followed(b, basis, _solved(b, basis, offsets, fps), offsets), port.name, port.dtype, port.shape)

    def example(batch: int, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        poses = np.clip(rng.uniform(-1, 0.7, (batch, -(-count // 8) + 1, len(basis.shapes_mm))), 0, 1)
        at = np.arange(count) / 8
        low = at.astype(int)
        smooth = poses[:, low] + (at - low)[:, None] * (poses[:, low + 1] - poses[:, low])
        noise = 0.2 * rng.standard_normal((batch, count, channels))
        return {"frames": basis.rest_mm + smooth @ basis.shapes_mm + noise, "fps": np.array(EXAMPLE_FPS)}

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        return [np.stack([_weights(basis, row, float(arrays["fps"])) for row in arrays["frames"]])]

    return Graph(b.name, "52 ARKit weights of the head's markers", b.model(), inputs, (port,), example, reference)


def _weights(basis: MarkerBasis, frames: NDArray[Any], fps: float) -> NDArray[np.float64]:
    """As `solve_markers` computes them, to the end."""
    offsets, lift = frames - basis.rest_mm, _lift(basis)
    weights = np.zeros((len(frames), len(basis.shapes_mm)))
    shapes, ridge = basis.shapes_mm[basis.free] @ lift, basis.ridge[basis.free]
    weights[:, basis.free] = solve(shapes, offsets @ lift, ridge, fps=fps, tolerance=SETTLED)
    return follow_gap(basis, weights, offsets)


def _lift(basis: MarkerBasis) -> NDArray[np.float64]:
    return np.concatenate([np.eye(basis.shapes_mm.shape[1]), np.sqrt(GAP_WEIGHT) * basis.gap_rows]).T


def _solved(b: Builder, basis: MarkerBasis, offsets: str, fps: str) -> str:
    lift, free = _lift(basis), np.flatnonzero(basis.free)
    shapes = basis.shapes_mm[free] @ lift
    H = shapes @ shapes.T + np.diag(basis.ridge[free])
    length = np.sqrt(np.diag(shapes @ shapes.T))
    scaled = H / np.outer(length, length)  # of w * length
    values = np.linalg.eigvalsh(scaled)
    wanted = b.op("MatMul", offsets, b.constant(lift @ shapes.T / length))
    # mu = |A|² (smoothing fps)² is the same number for all shapes in these coordinates.
    lag = b.op("Mul", fps, b.constant(SMOOTHING_S))
    stiffness = b.op("Mul", lag, lag)
    steepest = b.op("Add", b.constant(float(values[-1])), b.op("Mul", b.constant(4.0), stiffness))
    ratio = b.op("Sqrt", b.op("Div", b.constant(float(values[0])), steepest))
    momentum = b.op("Div", b.op("Sub", b.constant(1.0), ratio), b.op("Add", b.constant(1.0), ratio))
    start = b.op("Mul", wanted, b.constant(0.0))
    body = _descent(scaled, length, (wanted, stiffness, steepest, momentum))
    solved = b.ops("Loop", 2, b.constant(STEPS, "int64"), b.constant(np.array(True)), start, start, body=body.graph())[0]
    spread = np.zeros((len(free), len(basis.shapes_mm)))
    spread[np.arange(len(free)), free] = 1 / length
    return b.op("MatMul", solved, b.constant(spread))


def _descent(scaled: NDArray[np.float64], length: NDArray[np.float64], outside: tuple[str, str, str, str]) -> Builder:
    """One step: w, look-ahead point -> the same after it; and whether to go on."""
    wanted, stiffness, steepest, momentum = outside
    shape = ("batch", "frames", len(scaled))
    body = Builder("descent")
    body.input("step", "int64", ())
    body.bool_input("going")
    w, ahead = (body.input(name, "float64", shape) for name in ("w", "ahead"))
    size = body.shape_of(ahead, 1)
    steps = body.op(
        "Sub",
        body.span(ahead, 1, 1, 2**62),
        body.op("Slice", ahead, body.ints(0), body.op("Sub", size, body.ints(1)), body.ints(1)),
    )
    before = body.op("Pad", steps, body.ints(0, 1, 0, 0, 0, 0))
    after = body.op("Pad", steps, body.ints(0, 0, 0, 0, 1, 0))
    pull = body.op("Mul", body.op("Sub", before, after), stiffness)
    slope = body.op("Add", body.op("Sub", body.op("MatMul", ahead, body.constant(scaled)), wanted), pull)
    moved = body.op("Sub", ahead, body.op("Div", slope, steepest))
    bounded = body.op("Min", body.op("Max", moved, body.constant(0.0)), body.constant(length))
    change = body.op("Sub", bounded, w)
    farther = body.op("Add", bounded, body.op("Mul", change, momentum))
    largest = body.op("ReduceMax", body.op("Abs", body.op("Div", change, body.constant(length))), keepdims=0)
    body.bool_output(body.op("Greater", largest, body.constant(SETTLED)), "going_on")
    body.output(bounded, "w_next", "float64", shape)
    body.output(farther, "ahead_next", "float64", shape)
    return body


def _gap_followed(b: Builder, basis: MarkerBasis, weights: str, offsets: str) -> str:
    """`follow_gap`: lips as far apart as the markers' where the mouth is nearly shut."""
    if not len(basis.gap_rows):
        return weights
    slopes = (basis.shapes_mm @ basis.gap_rows.T).mean(axis=1)
    close, jaw = ARKIT_NAMES.index("mouthClose"), ARKIT_NAMES.index("jawOpen")
    zero, one = b.constant(0.0), b.constant(1.0)
    asked = b.op("MatMul", offsets, b.constant(basis.gap_rows.mean(axis=0)[:, None]))
    near = b.op("Clip", b.op("Div", b.op("Sub", b.constant(6.0), asked), b.constant(4.0)), zero, one)
    ease = b.op("Mul", b.op("Mul", near, near), b.op("Sub", b.constant(3.0), b.op("Mul", b.constant(2.0), near)))
    excess = b.op("Mul", b.op("Sub", b.op("MatMul", weights, b.constant(slopes[:, None])), asked), ease)
    now_close, now_jaw = (b.span(weights, 2, k, k + 1) for k in (close, jaw))
    closed = b.op("Clip", b.op("Sub", now_close, b.op("Div", excess, b.constant(float(slopes[close])))), zero, one)
    left = b.op("Add", excess, b.op("Mul", b.op("Sub", closed, now_close), b.constant(float(slopes[close]))))
    lack = b.op("Max", b.op("Neg", left), zero)
    opened = b.op("Clip", b.op("Add", now_jaw, b.op("Div", lack, b.constant(float(slopes[jaw])))), zero, one)
    changes = [(closed, now_close, close), (opened, now_jaw, jaw)]
    for new, old, column in changes:
        picked = np.zeros((1, len(slopes)))
        picked[0, column] = 1.0
        weights = b.op("Add", weights, b.op("MatMul", b.op("Sub", new, old), b.constant(picked)))
    return weights
