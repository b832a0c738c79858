"""The piecewise-affine warp as a graph: triangle by triangle, then one bilinear look-up for each pixel."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from facesynth.export.graph import Arrays, Graph, Port
from facesynth.face.texture.filling import EDGE
from facesynth.face.texture.warp import PiecewiseAffineWarp
from facesynth.graph_builder import Builder

EXAMPLE_POINTS = 12


def warp_graph() -> Graph:
    """Pictures [B, c, H, W] whose vertices lie at source [B, V, 2], redrawn with them at target [B, V, 2] px."""
    b = Builder("warp")
    inputs = (
        Port("pictures", "float32", ("batch", "channels", "height", "width"), "any"),
        Port("source", "float32", ("batch", "vertices", 2), "px (x, y)"),
        Port("target", "float32", ("batch", "vertices", 2), "px (x, y)"),
        Port("triangles", "int64", ("faces", 3), "vertex numbers"),
    )
    pictures, source, target, triangles = (b.input(port.name, port.dtype, port.shape) for port in inputs)
    height, width = b.shape_of(pictures, 2), b.shape_of(pictures, 3)
    y, x = (_coordinates(b, size) for size in (height, width))
    grid_x = b.op("Expand", b.op("Unsqueeze", x, b.ints(0)), b.op("Concat", height, width, axis=0))
    grid_y = b.op("Expand", b.op("Unsqueeze", y, b.ints(1)), b.op("Concat", height, width, axis=0))
    corners = b.op("Cast", b.op("Concat", target, b.op("Sub", source, target), axis=2), to=11)
    by_face = b.op("Transpose", b.op("Gather", corners, triangles, axis=1), perm=[1, 0, 2, 3])  # [F, B, 3, 4]
    shape = b.op("Concat", b.shape_of(pictures, 0), height, width, b.ints(2), axis=0)
    nothing = b.op("ConstantOfShape", shape, value=_zero())
    shift = b.ops("Scan", 1, nothing, by_face, body=_draw(grid_x, grid_y).graph(), num_scan_inputs=1)[0]
    place = b.op("Add", shift, b.op("Concat", b.op("Unsqueeze", grid_x, b.ints(2)), b.op("Unsqueeze", grid_y, b.ints(2)), axis=2))
    extent = b.op("Cast", b.op("Max", b.op("Sub", b.op("Concat", width, height, axis=0), b.ints(1)), b.ints(1)), to=11)
    unit = b.op("Sub", b.op("Mul", place, b.op("Div", b.constant(2.0), extent)), b.constant(1.0))
    read = {"mode": "linear", "padding_mode": "border", "align_corners": 1}
    port = Port("warped", "float32", ("batch", "channels", "height", "width"), "any")
    b.output(b.op("GridSample", pictures, b.op("Cast", unit, to=1), **read), port.name, port.dtype, port.shape)
    about = "piecewise-affine warp of pictures between two placements of a mesh"
    return Graph(b.name, about, b.model(), inputs, (port,), _example, _reference)


def _zero() -> Any:
    from onnx import numpy_helper

    return numpy_helper.from_array(np.zeros(1, np.float64))


def _coordinates(b: Builder, size: str) -> str:
    """[n] 0 … n - 1."""
    whole = b.op("Range", b.constant(0, "int64"), b.op("Squeeze", size), b.constant(1, "int64"))
    return b.op("Cast", whole, to=11)


def _draw(grid_x: str, grid_y: str) -> Builder:
    """Shift [B, H, W, 2], one triangle [B, 3, 4] -> the shift with that triangle drawn over it."""
    body = Builder("draw")
    shift = body.input("shift", "float64", ("batch", "height", "width", 2))
    corners = body.input("corners", "float64", ("batch", 3, 4))
    at = [[body.op("Unsqueeze", _entry(body, corners, k, c), body.ints(1, 2)) for c in range(4)] for k in range(3)]
    (ax, ay), (bx, by), (cx, cy) = ((p[0], p[1]) for p in at)
    abx, aby, acx, acy = (body.op("Sub", *pair) for pair in ((bx, ax), (by, ay), (cx, ax), (cy, ay)))
    area = body.op("Sub", body.op("Mul", abx, acy), body.op("Mul", aby, acx))
    flat = body.op("Less", body.op("Abs", area), body.constant(1e-12))
    safe = body.op("Where", flat, body.constant(1e30), area)
    px, py = body.op("Sub", grid_x, ax), body.op("Sub", grid_y, ay)
    v = body.op("Div", body.op("Sub", body.op("Mul", px, acy), body.op("Mul", py, acx)), safe)
    w = body.op("Div", body.op("Sub", body.op("Mul", abx, py), body.op("Mul", aby, px)), safe)
    u = body.op("Sub", body.op("Sub", body.constant(1.0), v), w)
    # A pixel as near to an edge as EDGE px belongs to the triangle: distance to an edge = share * area / its length.
    inside = body.op("Not", flat)
    edges = ((u, (body.op("Sub", cx, bx), body.op("Sub", cy, by))), (v, (acx, acy)), (w, (abx, aby)))
    for share, (dx, dy) in edges:
        length = body.op("Sqrt", body.op("Add", body.op("Mul", dx, dx), body.op("Mul", dy, dy)))
        slack = body.op("Div", body.op("Mul", body.constant(-EDGE), length), body.op("Abs", safe))
        inside = body.op("And", inside, body.op("GreaterOrEqual", share, slack))
    drawn = []
    for c in (2, 3):
        parts = [body.op("Mul", share, at[k][c]) for k, share in enumerate((u, v, w))]
        drawn.append(body.op("Unsqueeze", body.op("Sum", *parts), body.ints(3)))
    over = body.op("Where", body.op("Unsqueeze", inside, body.ints(3)), body.op("Concat", *drawn, axis=3), shift)
    body.output(over, "shift_next", "float64", ("batch", "height", "width", 2))
    return body


def _entry(body: Builder, corners: str, k: int, c: int) -> str:
    """[B] one number of each corner row."""
    return body.op("Gather", body.op("Gather", corners, body.constant(k, "int64"), axis=1), body.constant(c, "int64"), axis=1)


def _example(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    height, width = length, length + 9
    points = rng.uniform(0.15, 0.85, (EXAMPLE_POINTS, 2)) * (width, height)
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (width - 1, height - 1)
    reference = np.concatenate([points, corners])
    moves = rng.uniform(-1, 1, (2, batch, EXAMPLE_POINTS, 2))
    both = np.tile(reference, (2, batch, 1, 1))
    both[:, :, :EXAMPLE_POINTS] += moves
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    waves = [np.sin(0.11 * (k + 1) * x + 0.07 * y + k) for k in range(3)]
    pictures = np.tile(np.stack(waves), (batch, 1, 1, 1)).astype(np.float32)
    triangles = Delaunay(reference).simplices.astype(np.int64)
    return {
        "pictures": pictures,
        "source": both[0].astype(np.float32),
        "target": both[1].astype(np.float32),
        "triangles": triangles,
    }


def _reference(arrays: Arrays) -> list[NDArray[Any]]:
    pictures, source, target = (torch.from_numpy(arrays[name]) for name in ("pictures", "source", "target"))
    warp = PiecewiseAffineWarp(torch.from_numpy(arrays["triangles"]), *pictures.shape[2:])
    return [warp(pictures, source, target).numpy()]
