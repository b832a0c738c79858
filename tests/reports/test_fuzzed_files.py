"""Files with one thing changed: read, or refused in one line; never a traceback, a crash, a hang or a gigabyte."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from fuzzing import KINDS, MOST_S

HERE = Path(__file__).parent


@pytest.mark.parametrize("trials", [25, pytest.param(2000, marks=pytest.mark.slow)])
def test_one_thing_changed_is_right_or_one_clear_line(tmp_path, trials):
    pytest.importorskip("c3d")
    pytest.importorskip("ezc3d")
    paths = os.pathsep.join([str(HERE), str(HERE.parent), *sys.path])
    run = subprocess.run(
        [sys.executable, str(HERE / "fuzzing.py"), str(tmp_path), str(trials), *KINDS],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    told = json.loads(run.stdout.splitlines()[-1])
    assert set(told) == set(KINDS)
    for kind, facts in told.items():
        assert not facts["failed"], (kind, facts["failed"][:5])
        assert facts["slowest_s"] < MOST_S, kind
        assert min(facts["read"], facts["refused"]) > 0.02 * trials, (kind, facts)
