"""Frames per second of the piecewise-affine warp at 360×288, beside two other ways in the same run.

python benchmarks/warp.py            (scikit-image is needed for the comparison only)

The warp draws where each pixel is read from, which kornia then reads. `displaced` is the way before kornia: it draws
how far each pixel is moved, makes the grid of places from that, and reads it by `grid_sample`.
"""

import argparse
import time

import numpy as np
import torch

from facesynth.face.texture.mesh import mesh_of
from facesynth.face.texture.warp import PiecewiseAffineWarp

HEIGHT, WIDTH, POINTS = 288, 360, 200


def scene(frames: int, seed: int = 0):
    """A noise picture, a mesh over all of it, and vertices that wander by about a pixel."""
    rng = np.random.default_rng(seed)
    picture = rng.random((HEIGHT, WIDTH, 3), np.float32)
    rim = [(x, y) for x in np.linspace(0, WIDTH - 1, 7) for y in (0, HEIGHT - 1)]
    rim += [(x, y) for y in np.linspace(0, HEIGHT - 1, 6)[1:-1] for x in (0, WIDTH - 1)]
    mesh = mesh_of(rng.uniform([8, 8], [WIDTH - 9, HEIGHT - 9], (POINTS, 2)), np.array(rim))
    targets = mesh.vertices(mesh.reference[:POINTS] + rng.normal(scale=0.7, size=(frames, POINTS, 2)))
    return picture, mesh, targets


def displaced(warp, pictures, source, target):
    moved = warp.interpolate(target, source - target)
    scale = torch.tensor([2 / (WIDTH - 1), 2 / (HEIGHT - 1)])
    y, x = torch.meshgrid(torch.arange(HEIGHT), torch.arange(WIDTH), indexing="ij")
    grid = (torch.stack([x, y], dim=-1) + moved) * scale - 1
    return torch.nn.functional.grid_sample(pictures, grid, mode="bilinear", padding_mode="border", align_corners=True)


def ours(picture, mesh, targets, batch: int = 4) -> dict[str, tuple[float, float]]:
    """Frames per second, and per second of processor time, of both ways, in turn."""
    warp = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), HEIGHT, WIDTH)
    pictures = torch.from_numpy(picture).permute(2, 0, 1)[None].repeat(batch, 1, 1, 1)
    source = torch.from_numpy(mesh.reference).float().repeat(batch, 1, 1)
    moved = torch.from_numpy(targets).float()
    ways = {"facesynth": warp, "displaced": lambda *arrays: displaced(warp, *arrays)}
    drawn = [way(pictures, source, moved[:batch]) for way in ways.values()]
    torch.testing.assert_close(*drawn, atol=1e-4, rtol=0)
    frames = len(moved) // batch * batch
    seconds = {name: np.zeros(2) for name in ways}
    for first in range(0, frames, batch):
        for name, way in ways.items():
            began = np.array([time.perf_counter(), time.process_time()])
            way(pictures, source, moved[first : first + batch])
            seconds[name] += [time.perf_counter(), time.process_time()] - began
    return {name: tuple(frames / spent) for name, spent in seconds.items()}


def scikit_image(picture, mesh, targets) -> tuple[float, float]:
    from skimage.transform import PiecewiseAffineTransform, warp

    began, worked = time.perf_counter(), time.process_time()
    for target in targets:
        transform = PiecewiseAffineTransform.from_estimate(target, mesh.reference)
        warp(picture, transform, order=1, mode="edge")
    return len(targets) / (time.perf_counter() - began), len(targets) / (time.process_time() - worked)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    picture, mesh, targets = scene(options.frames)
    print(f"{WIDTH}x{HEIGHT}, {len(mesh.reference)} vertices, {len(mesh.triangles)} triangles, {options.threads} threads")
    speeds = ours(picture, mesh, targets)
    for name, (each_second, alone) in speeds.items():
        print(f"{name:13s} {each_second:8.1f} frames/s, {alone:8.1f} frames per second of processor time")
    (fast, fast_alone), (_, before) = speeds.values()
    print(f"for the same processor time facesynth draws {fast_alone / before:.2f} times what the way before kornia does")
    try:
        slow, slow_alone = scikit_image(picture, mesh, targets[:4])
    except ImportError:
        print("scikit-image is not installed: no comparison")
        return
    print(f"scikit-image  {slow:8.1f} frames/s, {slow_alone:8.1f} frames per second of processor time")
    print(f"facesynth is {fast / slow:.0f} times as fast; for the same processor time {fast_alone / slow_alone:.0f} times")


if __name__ == "__main__":
    main()
