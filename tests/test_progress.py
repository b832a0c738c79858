"""Progress where standard error is no terminal."""

import time

from facesynth import progress
from facesynth.progress import track


def test_a_log_gets_a_line_now_and_then(capsys, monkeypatch):
    clock = iter(range(0, 1000, 20))
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    assert list(track("abcd", "letters")) == list("abcd")
    assert capsys.readouterr().err.splitlines() == ["letters: 1 of 4 after 40 s", "letters: 3 of 4 after 80 s"]


def test_what_is_quick_says_nothing(capsys):
    assert list(track(iter("abcd"), "letters")) == list("abcd")
    assert capsys.readouterr().err == ""
    assert progress.LINE_EVERY_S > 2
