"""What tables say of a face that rests: nothing, where resting would win."""

from importlib import import_module

import numpy as np
import pytest
from talking_points import face, phones

from facesynth.evaluation.judge import shut_opening
from facesynth.inference.speech import EmotionTrack, Speech

TRACK = phones(("ah", 0.2), ("p", 0.4), ("ah", 0.6), ("p", 0.8))


class Said:
    """A recording of `ah p` twice: how far lips are open at each."""

    def __init__(self, opening, *gaps):
        self.motion = face(np.repeat([opening, gaps[0], opening, gaps[1]], 12))
        self.speech = Speech(np.zeros(12800, np.float32), 16000, TRACK, EmotionTrack.constant("neutral", 0.8))


class Recordings(list):
    """As much of a corpus as is asked for."""

    @property
    def ids(self):
        return tuple(map(str, range(len(self))))

    def subset(self, ids):
        return Recordings(self[int(one)] for one in ids)


PARTING, NEVER = Recordings([Said(8.0, 0.0, 1.0), Said(8.0, 0.5, 2.0)]), Recordings([Said(6.2, 5.0, 6.0), Said(6.2, 5.5, 6.5)])
NARROW = Recordings([Said(3.0, 0.0, 0.5)])


def test_what_counts_as_shut_is_told_where_lips_part():
    assert shut_opening(PARTING, [PARTING, Recordings()]) == pytest.approx(2.0, abs=1e-4)


@pytest.mark.parametrize(("tested", "learned"), [(NEVER, PARTING), (PARTING, NARROW)])
def test_closures_are_refused_where_a_face_that_rests_would_be_shut(tested, learned):
    """By the mean of what is tested, or by that of what a method learned from."""
    assert np.isnan(shut_opening(tested, [learned]))


@pytest.fixture
def table(monkeypatch, repository):
    monkeypatch.syspath_prepend(repository / "benchmarks")
    return import_module("frontier_table")


def test_the_frontiers_table_leaves_out_what_is_not_told(table):
    resting = face(np.full(48, 1.5))
    assert np.isnan(table.figures(resting, NEVER[0], shut_opening(NEVER, []))[3:]).all(), "neither closures nor false ones"
    assert table.cells(np.array([[1.5, 1.0, np.nan, 0.5], [1.7, 0.8, np.nan, np.nan]])) == "1.600 | 0.90 |  | 0.50"


def test_rows_are_told_from_those_that_were_made_alike(table, capsys):
    """A row that is 0.1 mm nearer in each of ten clips; one whose other is not there says nothing."""
    errors = np.linspace(1.0, 2.0, 10)[:, None]
    table.made_alike({"network, sharpened": errors, "anime graph soft, sharpened": errors - 0.1, "anime graph soft": errors})
    assert capsys.readouterr().out.splitlines() == [
        "- anime graph soft, sharpened, nearer than network, sharpened by 0.1000 mm, in 10 of 10 clips, p = 0.002"
    ]
