"""How fast the built-in head is drawn, and where the time goes.

python benchmarks/render.py [frames]

The reference, measured in the same run, is one depth map of the same mesh at the same size: one sample
per pixel, one thread, no colour. A frame has four samples per pixel, shadow, skin, eyes and hair.
"""

import sys
import time
from collections.abc import Callable

import numpy as np

from facesynth.face.draw.raster import FAR, bin_triangles, draw_depth, vertex_normals
from facesynth.face.draw.render import Renderer, available_cores
from facesynth.face.rig.arkit_rig import load_head, pose

SIZE = (1280, 720)


def seconds(work: Callable[[], object], times: int = 5) -> float:
    """The least wall time of some calls."""
    best = np.inf
    for _ in range(times):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def main(frames: int) -> None:
    start = time.perf_counter()
    rig = load_head()
    renderer = Renderer.of(rig, SIZE)
    renderer.render(rig.rest_mm)
    print(f"from nothing to the first picture: {time.perf_counter() - start:.1f} s (compiles and bakes once per installation)")

    baked = renderer.look
    position = baked.refine @ rig.rest_mm
    normal = vertex_normals(position, baked.surface.quads)
    screen = renderer.camera.project(position, SIZE)

    def reference() -> None:
        draw_depth(screen, baked.surface.quads, np.full(SIZE[::-1], FAR, np.float32))

    reference()
    stages = {
        "reference: one depth map": reference,
        "refining and normals": lambda: vertex_normals(baked.refine @ rig.rest_mm, baked.surface.quads),
        "triangles into tiles": lambda: bin_triangles(screen, renderer._drawn, *renderer._grid),
        "shadow map": lambda: renderer._shadow(position, normal),
        "hair: placing, lighting, sorting": lambda: renderer._hair(position, normal),
        "whole frame": lambda: renderer.render(rig.rest_mm),
    }
    took = {name: seconds(work) for name, work in stages.items()}
    for name, value in took.items():
        print(f"{name:34s} {1000 * value:7.1f} ms")

    weights = np.clip(np.random.default_rng(0).normal(0.1, 0.1, (frames, 52)), 0, 1)
    start, cpu = time.perf_counter(), time.process_time()
    for t in range(frames):
        renderer.render(pose(rig, weights[t], [0, 0.2 * np.sin(t / 10), 0, 0, 0, 0]))
    each, cpu_each = (time.perf_counter() - start) / frames, (time.process_time() - cpu) / frames
    cores = available_cores()
    print(f"{frames} posed frames at {SIZE[0]} x {SIZE[1]}: {1 / each:.1f} frames/s on {cores} cores")
    print(f"processor time of a frame: {1000 * cpu_each:.0f} ms, so {cores / cpu_each:.1f} frames/s where nothing else runs")
    print(f"a frame takes {took['whole frame'] / took['reference: one depth map']:.1f} times as long as the reference")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 30)
