"""An import that is killed at random moments and run again."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

COMMAND = [sys.executable, "-c", "from facesynth.cli import main; main()", "corpus"]
LEFT_S = 30.0
"""After the kill, so long may workers take to notice."""


def contents(path):
    """Bytes of every file in a folder, by name."""
    return {str(file.relative_to(path)): file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


def killed_and_repeated(command, tmp_path, times, seed, new=None, forget=None, patience_s=LEFT_S):
    """Kill an import `times` times at random moments from its start on, let it run now and then, compare with an undisturbed run.

    command: the arguments of `facesynth corpus` for a folder. new: makes the empty corpus, where the import does not do so
    itself; forget: folder that is deleted before each corpus. No process of a killed import may be left after patience_s.
    """
    new = new or (lambda folder: None)
    new(tmp_path / "whole")
    start = time.monotonic()
    _finish(command(tmp_path / "whole"))
    whole_s = time.monotonic() - start
    wanted = lasting(tmp_path / "whole")
    rng = np.random.default_rng(seed)

    def begin(target):
        shutil.rmtree(target, ignore_errors=True)
        new(target)
        if forget is not None:
            shutil.rmtree(forget, ignore_errors=True)

    for trial in range(times):
        target, after_s = tmp_path / f"killed{trial // 5}", float(rng.uniform(0, 1)) * whole_s
        if trial % 5 == 0:
            begin(target)
        while not _killed([*COMMAND, *command(target)], after_s, patience_s):  # it ended before: again, and earlier
            assert lasting(target) == wanted
            begin(target)
            after_s /= 2
        if trial % 5 == 4 or trial == times - 1:
            _finish(command(target))
            assert lasting(target) == wanted


def _killed(command, after_s, patience_s):
    """Whether an import was still running when it was to be killed; whatever it had started must end with it."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        process.wait(timeout=after_s)
        return False
    except subprocess.TimeoutExpired:
        family = descendants(process.pid)
        process.kill()
        process.wait()
    assert not left_after(family, patience_s), "processes of a killed import are left"
    return True


def left_after(family, seconds):
    """Which of some processes, as `descendants` gives them, are still there after so many seconds."""
    patience = time.monotonic() + seconds
    while (
        left := [pid for pid, born in family.items() if born is not None and _born(pid) == born]
    ) and time.monotonic() < patience:
        time.sleep(0.1)
    return left


def descendants(pid):
    """Processes that a process started, and those started by them, with when they began; none where there is no /proc."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        fields = _stat(path)
        if fields:
            parents[int(path.parent.name)] = int(fields[1])
    found, new = {}, {pid}
    while new:
        new = {child for child, parent in parents.items() if parent in new}
        found |= {child: _born(child) for child in new}
    return found


def _born(pid):
    """When a process began, in ticks; None where it is no more, or has ended and waits to be looked after."""
    fields = _stat(Path(f"/proc/{pid}/stat"))
    return None if not fields or fields[0] == "Z" else fields[19]


def _stat(path):
    try:
        return path.read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return []


def _finish(command):
    subprocess.run([*COMMAND, *command], check=True, capture_output=True, timeout=1800)


def lasting(folder):
    """What a corpus holds, beside the lock and what a killed write left behind."""
    found = contents(folder)
    return {name: content for name, content in found.items() if "/.part-" not in f"/{name}" and not name.startswith(".")}
