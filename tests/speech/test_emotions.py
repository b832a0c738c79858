import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack
from facesynth.speech.emotions import read_emotions, write_emotions


def read(tmp_path, text, duration_s=3.0):
    (tmp_path / "e.csv").write_text(text)
    return read_emotions(tmp_path / "e.csv", duration_s)


def test_round_trip(tmp_path):
    track = EmotionTrack(("happy", "sad"), np.array([1.25, 3.0]), np.array([0.5, 1.0]))
    write_emotions(tmp_path / "ü b" / "e.csv", track)
    got = read_emotions(tmp_path / "ü b" / "e.csv", 3.0)
    assert got.labels == track.labels
    np.testing.assert_allclose(got.ends_s, track.ends_s, atol=1e-6)
    np.testing.assert_allclose(got.intensities, track.intensities, atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "end_s,emotion,intensity\n1,neutral,1\n2,happy,0.4\n",
        "\ufeffstart_s, end_s, emotion, intensity\n1, 2, Happy, 0.4\n2, 2.5, happy, 0.4\n",
        "1 neutral\n\n# half happy\n2 happy 0.4\n",
    ],
)
def test_three_ways_of_saying_it(tmp_path, text):
    got = read(tmp_path, text)
    assert got.ends_s[-1] == 3.0
    assert got.labels[got.index_at(0.5)] == "neutral"
    assert got.labels[got.index_at(1.5)] == "happy"
    assert got.intensities[got.index_at(1.5)] == 0.4
    assert got.labels[got.index_at(2.9)] == "happy"


def test_intensity_is_one_where_nothing_is_said(tmp_path):
    assert read(tmp_path, "end_s,emotion\n3,angry\n").intensities.tolist() == [1.0]


def test_what_lies_beyond_the_sound_is_cut(tmp_path):
    got = read(tmp_path, "1 happy\n2 sad\n9 angry\n", duration_s=1.5)
    assert got.labels == ("happy", "sad")
    assert got.ends_s.tolist() == [1.0, 1.5]


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("end_s,emotion,intensity\n1,happy,1\nx,sad,1\n", "line 3"),
        ("end_s,emotion,intensity\n1,happy,1.5\n", "line 2.*1.5"),
        ("end_s,emotion,intensity\n1,happy,nan\n", "line 2"),
        ("end_s,emotion,intensity\n2,happy,1\n1,sad,1\n", "line 3.*follow"),
        ("end_s,emotion,intensity\n1,,1\n", "line 2"),
        ("end_s,emotion,intensity\n1,happy,1,2\n", "line 2"),
        ("end_s,emotion,force\n1,happy,1\n", "line 1.*force"),
        ("emotion,intensity\nhappy,1\n", "line 1.*end_s"),
        ("1 happy\n0.5 sad\n", "line 2"),
        ("1 happy 0.5 and more\n", "line 1"),
        ("inf happy\n", "line 1"),
        ("", "names no emotion"),
    ],
)
def test_bad_lines_are_named(tmp_path, text, where):
    with pytest.raises(FacesynthError, match=where):
        read(tmp_path, text)


def test_files_that_are_none(tmp_path):
    with pytest.raises(FacesynthError, match="no such file"):
        read_emotions(tmp_path / "absent.csv", 1.0)
    (tmp_path / "e.csv").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(FacesynthError, match="UTF-8"):
        read_emotions(tmp_path / "e.csv", 1.0)
