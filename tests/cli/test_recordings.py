"""Files of sound that a command is given as a folder."""

import pytest

from facesynth.cli.recordings import recordings
from facesynth.corpus.add.recordings import AUDIO, VIDEO
from facesynth.inference.errors import FacesynthError


def test_a_folder_gives_what_corpus_add_takes_as_sound(tmp_path):
    with pytest.raises(FacesynthError, match="holds no sound"):
        recordings([tmp_path])
    for suffix in (*AUDIO, *VIDEO, ".txt", ".csv", ".TextGrid"):
        (tmp_path / f"a{suffix}").touch()
    (tmp_path / "B.WAV").touch()
    (tmp_path / "._a.wav").touch()
    found = recordings([tmp_path])
    assert {path.name for path in found} == {f"a{suffix}" for suffix in AUDIO | VIDEO} | {"B.WAV"}
    assert found == sorted(found)
