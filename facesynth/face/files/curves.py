"""Curves under any names as CSV: one column each, with the time; `facesynth corpus add` reads them again."""

import csv
import io
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from facesynth.atomic import write_text

TIME = "time_s"


def write_curves(path: str | Path, names: tuple[str, ...], values: ArrayLike, fps: float) -> None:
    """Write values [T, N] under their names; nine significant digits keep every float32 exactly."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([TIME, *names])
    for number, row in enumerate(np.asarray(values, np.float64) + 0.0):
        writer.writerow([f"{number / fps:.6f}", *(f"{value:.9g}" for value in row)])
    write_text(path, text.getvalue())
