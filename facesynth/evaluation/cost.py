"""What a method costs: memory and the size of its file. Times are taken where the work is done."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from facesynth.methods.method import Method

MB = 1e6
_PROC = Path("/proc/self")


@dataclass
class PeakMemory:
    """Filled when the block of `peak_memory` ends."""

    mb: float = float("nan")
    """Largest resident memory of the process inside the block (1e6 bytes); NaN where the system does not tell."""


@contextmanager
def peak_memory() -> Iterator[PeakMemory]:
    """Measure the largest resident memory of the whole process, Python and torch included, inside the block.

    Linux alone lets a process reset its own high-water mark (`clear_refs`); elsewhere the answer is NaN.
    """
    peak = PeakMemory()
    try:
        (_PROC / "clear_refs").write_text("5")
    except OSError:
        yield peak
        return
    yield peak
    line = next(line for line in (_PROC / "status").read_text().splitlines() if line.startswith("VmHWM:"))
    peak.mb = int(line.split()[1]) * 1024 / MB


def model_mb(method: Method) -> float:
    """Size of the file that `Method.save` writes (1e6 bytes)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        method.save(path)
        return path.stat().st_size / MB
