import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from interrupted import descendants, left_after

from facesynth.corpus.workers import Workers, spread
from facesynth.inference.errors import FacesynthError


def negative(number):
    return -number


def die_once(task):
    """Ends its own process the first time that the third task is done."""
    number, marker = task
    if number == 2 and not Path(marker).exists():
        Path(marker).touch()
        os._exit(9)
    return -number


def die(number):
    os._exit(9)


def test_results_come_in_order():
    assert list(spread(negative, range(20), Workers(2), "negating")) == [-n for n in range(20)]
    assert list(spread(negative, [], Workers(2), "negating")) == []
    with pytest.raises(FacesynthError, match="1 or more"):
        Workers(0)


def test_what_a_dead_worker_left_is_done_again(tmp_path):
    tasks = [(number, str(tmp_path / "marker")) for number in range(6)]
    assert list(spread(die_once, tasks, Workers(2), "dying")) == [-n for n in range(6)]
    assert (tmp_path / "marker").exists()


def test_workers_that_always_die_are_one_clear_error():
    with pytest.raises(FacesynthError, match="died 3 times"):
        list(spread(die, [1, 2], Workers(2), "dying"))


def test_who_works_is_checked():
    with pytest.raises(FacesynthError, match="unknown engine 'rye'; did you mean ray"):
        Workers(1, "rye")
    with pytest.raises(FacesynthError, match="--engine ray"):
        Workers(1, "processes", "10.0.0.1:6379")


def test_ray_that_is_absent_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(FacesynthError, match=r"facesynth\[ray\]"):
        list(spread(negative, [1], Workers(1, "ray"), "negating"))


def left_alone(seconds):
    time.sleep(seconds)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="who is whose child is read in /proc")
def test_workers_end_when_their_parent_is_killed():
    code = "from test_workers import left_alone; from facesynth.corpus.workers import Workers, spread\n"
    code += "if __name__ == '__main__': list(spread(left_alone, [60] * 4, Workers(2), 'sleeping'))"
    here = Path(__file__)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(here.parent), str(here.parent.parent)])}
    parent = subprocess.Popen([sys.executable, "-c", code], env=environment)
    patience = time.monotonic() + 60
    while len(family := descendants(parent.pid)) < 3:  # two workers, and what looks after their semaphores
        assert time.monotonic() < patience
        time.sleep(0.2)
    parent.kill()
    parent.wait()
    assert not left_after(family, 30)
