"""What a method costs: time by the clock and of the processor, and memory."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MB = 1e6
_STATUS = Path("/proc/self/status")


@dataclass
class Spent:
    """Filled when the block of `stopwatch` ends."""

    clock_s: float = 0.0
    """What a clock on the wall shows: longer where other programs run beside this one."""
    processor_s: float = 0.0
    """What the processor worked for this process; one thread on an idle computer needs as long by the clock."""


@contextmanager
def stopwatch() -> Iterator[Spent]:
    """Measure the block, by the clock and by the processor."""
    spent = Spent()
    clock, processor = time.perf_counter(), time.process_time()
    yield spent
    spent.clock_s, spent.processor_s = time.perf_counter() - clock, time.process_time() - processor


def peak_speaking_mb(model: Path, corpus: Path, utterance_id: str, seed: int, speak: Mapping[str, Any]) -> float | None:
    """Largest resident memory (1e6 bytes) of a process of its own that loads a model file and speaks one utterance.

    Python, torch and the model included; nothing that was loaded for other methods. None where the system does not
    tell (any but Linux), or where such a process does not know the method.
    """
    task = json.dumps([str(model), str(corpus), utterance_id, seed, dict(speak)])
    done = subprocess.run([sys.executable, "-m", __name__, task], capture_output=True, text=True, check=False)
    answer = done.stdout.strip().rpartition("\n")[2]
    return float(answer) if done.returncode == 0 and answer else None


def peak_mb() -> float | None:
    """Largest resident memory of this process until now (1e6 bytes); None where the system does not tell."""
    if not _STATUS.is_file():
        return None
    line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024 / MB


def _speak_alone(task: str) -> None:
    from facesynth.corpus import Corpus
    from facesynth.methods.registry import load

    model, corpus, utterance_id, seed, speak = json.loads(task)
    method = load(model)
    method.synthesize(Corpus.open(corpus)[utterance_id].speech, seed=seed, **speak)
    print(peak_mb() or "")


if __name__ == "__main__":
    _speak_alone(sys.argv[1])
