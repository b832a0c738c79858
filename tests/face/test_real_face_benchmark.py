"""The benchmark of the real face: what a second run draws, and gaps against the recorded ones of the same clip."""

import runpy

import pytest


@pytest.fixture(scope="module")
def real_face(repository):
    return runpy.run_path(str(repository / "benchmarks" / "real_face.py"))


def row(real_face, gaps, recorded, jumps=0.0):
    return real_face["Row"](gaps, recorded, gaps, 0.0, jumps, 0.0, 0.0, 0.0, 0.0)


def test_a_second_run_draws_the_rows_that_a_clip_lacks_and_no_others(real_face):
    some = row(real_face, [1.0], [1.0])
    both, one = {"recorded": some, "lds": some, "network": some}, {"recorded": some, "lds": some}
    assert real_face["lacking"](both, [both, one]) == {"network"}
    assert real_face["lacking"](both, [both, both]) == set()
    assert real_face["lacking"](both, [both, {}]) == set(both)


def test_gaps_are_compared_with_the_same_closure_of_the_recording(real_face):
    drawn = [row(real_face, [1.0, 5.0], [0.0, 6.0], jumps=2), row(real_face, [2.0], [0.5], jumps=4)]
    recorded = [row(real_face, [0.0, 6.0], [0.0, 6.0]), row(real_face, [0.5], [0.5])]
    lines = real_face["table"]({"recorded": recorded, "lds": drawn}).splitlines()
    assert lines[0] == "2 clips, none of them learned from, 3 closures"
    found = dict(zip(*([cell.strip() for cell in line.split("|")[1:-1]] for line in (lines[2], lines[-1])), strict=True))
    assert found["smallest gap at p, b, m, median, mm"] == "2"
    assert found["more than recorded, median"] == "1", "of the differences 1, -1 and 1.5, not of the medians"
    assert found["distance from the recorded one, median"] == "1"
    assert found["jumps"] == "3"
