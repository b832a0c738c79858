import os
from pathlib import Path

import pytest

from facesynth.corpus.workers import spread
from facesynth.errors import FacesynthError


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
    assert list(spread(negative, range(20), 2, "negating")) == [-n for n in range(20)]
    assert list(spread(negative, [], 2, "negating")) == []
    with pytest.raises(FacesynthError, match="1 or more"):
        list(spread(negative, [1], 0, "negating"))


def test_what_a_dead_worker_left_is_done_again(tmp_path):
    tasks = [(number, str(tmp_path / "marker")) for number in range(6)]
    assert list(spread(die_once, tasks, 2, "dying")) == [-n for n in range(6)]
    assert (tmp_path / "marker").exists()


def test_workers_that_always_die_are_one_clear_error():
    with pytest.raises(FacesynthError, match="died 3 times"):
        list(spread(die, [1, 2], 2, "dying"))
