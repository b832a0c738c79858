"""Processor against accelerator: warp, deformers, features, and the training of the small network.

python benchmarks/devices.py [--device cuda] [--threads 2]

Each task is run once to warm up and then as often as fits into a second; the clock is read when the device has finished.
Where there is no accelerator, the processor's times stand alone, and this is said.
"""

import argparse
import copy
import time
from collections.abc import Callable, Iterator

import numpy as np
import torch
from torch import nn

from facesynth.device import device_of
from facesynth.face.deform.mesh_distance import MeshDistanceDeformer
from facesynth.face.deform.regions import RegionDeformer
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import marker_layout
from facesynth.face.texture.mesh import ringed_mesh
from facesynth.face.texture.warp import PiecewiseAffineWarp
from facesynth.inference.errors import FacesynthError
from facesynth.methods.learn.network import RATE, Tracks, network
from facesynth.methods.learn.network import train as train_network
from facesynth.speech.mel import LogMel
from facesynth.speech.rasta_plp import RastaPlp

SECONDS = 1.0
Task = Callable[[torch.device], Callable[[], object]]
"""Given a device, puts all that it needs there, and gives what is to be timed."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="auto", help="The accelerator; auto takes CUDA where it is there.")
    parser.add_argument("--threads", type=int, default=2, help="Of the processor.")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    accelerator = device_of(options.device)
    alone = accelerator.type == "cpu"
    print(f"no accelerator is here: the processor alone, {options.threads} threads" if alone else f"cpu and {accelerator}")
    print(f"{'ms':36s} {'cpu':>10s}" + ("" if alone else f" {accelerator!s:>10s} {'ratio':>8s}"))
    for name, task in tasks():
        processor = milliseconds(task, torch.device("cpu"))
        line = f"{name:36s} {processor:10.2f}"
        if not alone:
            there = milliseconds(task, accelerator)
            line += f" {there:10.2f} {processor / there:8.1f}"
        print(line, flush=True)


def tasks() -> Iterator[tuple[str, Task]]:
    rng = np.random.default_rng(0)
    sound = torch.from_numpy(rng.normal(0, 0.1, 160_000)).float()
    yield "log-mel bands of 10 s", of_module(LogMel(), sound)
    yield "RASTA-PLP of 10 s", of_module(RastaPlp(), sound)
    yield from warps(rng)
    yield from deformers(rng)
    yield "50 steps of the small network", training(rng)


def warps(rng: np.random.Generator) -> Iterator[tuple[str, Task]]:
    for batch in (1, 16):
        mesh = ringed_mesh(rng.uniform([60, 60], [300, 230], (200, 2)))
        source = torch.from_numpy(mesh.reference).float().repeat(batch, 1, 1)
        target = source + torch.from_numpy(rng.normal(0, 0.7, source.shape)).float()
        pictures = torch.from_numpy(rng.random((batch, 3, 288, 360))).float()
        warp = PiecewiseAffineWarp(torch.from_numpy(mesh.triangles), 288, 360)
        yield f"warp of {batch} pictures, 360 x 288", of_module(warp, pictures, source, target)


def deformers(rng: np.random.Generator) -> Iterator[tuple[str, Task]]:
    try:
        rig = load_head()
    except FacesynthError as error:
        print(f"deformers are left out: {error}")
        return
    layout = marker_layout(rig)
    frames = torch.from_numpy(rng.normal(0, 1, (120, 3 * len(layout.names)))).float()
    for name, deformer in (("mesh distance", MeshDistanceDeformer), ("regions", RegionDeformer)):
        yield f"120 frames deformed by {name}", of_module(deformer(rig, layout), frames)


def training(rng: np.random.Generator) -> Task:
    def task(device: torch.device) -> Callable[[], object]:
        length = round(3 * RATE)
        arrays = [(rng.normal(size=(length, 40)), rng.normal(size=(length, 25)), np.ones(length)) for _ in range(40)]
        tracks = [Tracks(*(torch.from_numpy(array).float().to(device) for array in one)) for one in arrays]
        return lambda: train_network(network(40, 25, seed=0).to(device), tracks, 50, 0, "training")

    return task


def of_module(module: nn.Module, *given: torch.Tensor) -> Task:
    def task(device: torch.device) -> Callable[[], object]:
        there, moved = copy.deepcopy(module).to(device), [tensor.to(device) for tensor in given]
        return torch.no_grad()(lambda: there(*moved))

    return task


def milliseconds(task: Task, device: torch.device) -> float:
    """Median over runs."""
    run = task(device)
    run()
    spent: list[float] = []
    while sum(spent) < SECONDS:
        wait_for(device)
        began = time.perf_counter()
        run()
        wait_for(device)
        spent.append(time.perf_counter() - began)
    return 1000 * float(np.median(spent))


def wait_for(device: torch.device) -> None:
    if device.type != "cpu":
        torch.get_device_module(device).synchronize()


if __name__ == "__main__":
    main()
