"""An import that is killed at random moments and run again."""

import shutil
import subprocess
import sys
import time

import numpy as np

COMMAND = [sys.executable, "-c", "from facesynth.cli import main; main()", "corpus", "add"]


def contents(path):
    """Bytes of every file in a folder, by name."""
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


def killed_and_repeated(options, tmp_path, times, seed, new=None, forget=None):
    """Kill the import `times` times at random moments, let it run now and then, compare with an undisturbed run.

    new: makes the empty corpus, where the import does not do so itself; forget: folder that is deleted before each corpus.
    """
    new = new or (lambda folder: None)
    new(tmp_path / "whole")
    start = time.monotonic()
    _finish(tmp_path / "whole", options)
    whole_s = time.monotonic() - start
    wanted = _lasting(tmp_path / "whole")
    rng = np.random.default_rng(seed)
    for trial in range(times):
        target = tmp_path / f"killed{trial // 5}"
        if trial % 5 == 0:
            new(target)
            if forget is not None:
                shutil.rmtree(forget, ignore_errors=True)
        process = subprocess.Popen(
            [*COMMAND, str(target), *options, "--jobs", "1"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            process.wait(timeout=float(rng.uniform(0.3, 1.0)) * whole_s)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if trial % 5 == 4 or trial == times - 1:
            _finish(target, options)
            assert _lasting(target) == wanted


def _finish(target, options):
    subprocess.run([*COMMAND, str(target), *options, "--jobs", "1"], check=True, capture_output=True, timeout=180)


def _lasting(folder):
    """What a corpus holds, beside the lock and what a killed write left behind."""
    found = contents(folder)
    return {name: content for name, content in found.items() if "/.part-" not in name and not name.startswith(".")}
