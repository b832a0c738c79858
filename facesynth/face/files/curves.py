"""Curves under any names as CSV: one column each, with the time; `facesynth corpus add` reads them again."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from facesynth.atomic import atomic_path

TIME = "time_s"


def write_curves(path: str | Path, names: tuple[str, ...], values: ArrayLike, fps: float) -> None:
    """Write values [T, N] under their names; nine significant digits keep every float32 exactly."""
    with atomic_path(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([TIME, *names])
        for number, row in enumerate(np.asarray(values)):
            writer.writerow([f"{number / fps:.6f}", *(f"{float(value) + 0.0:.9g}" for value in row)])
