from pathlib import Path

import pytest

from facesynth.corpus.files import Files, check_id
from facesynth.inference.errors import FacesynthError


@pytest.mark.parametrize(
    "name",
    [
        *("", ".", "..", "../x", "a/b", "a\\b", "/etc/passwd", ".hidden", "a\0b", "a\nb", "C:x", "+", "+:1", "e\u0301"),
        *("con", "NUL.txt", "x.", "x ", 'a"b', "a?b", "a*", "é" * 101),
    ],
)
def test_dangerous_names_are_refused(name):
    with pytest.raises(FacesynthError, match="utterance id"):
        check_id(name)


@pytest.mark.parametrize("name", ["s01", "Übung 7 喜び", "a.b", "console", "x_y-z (2)", "é" * 100])
def test_ordinary_names_pass(name):
    assert check_id(name) == name
    assert Files(Path("corpus")).audio(name) == Path("corpus/audio") / (name + ".wav")
