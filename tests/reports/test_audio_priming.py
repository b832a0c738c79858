"""Silence that encoders put in front of the sound: taken off where a file or its pictures say how much, else told."""

import bringing
import numpy as np
import pytest
from closing_clips import CONTAINERS, Clip, at_30_fps, heard_s, largest_error_s, write

from facesynth.capture.clock import clock_between
from facesynth.speech.audio import load_audio, read_sound


@pytest.mark.parametrize(
    ("suffix", "fps"), [(s, fps) for s in sorted(CONTAINERS) for fps in (30, 60) if s != "avi" or fps == 30]
)  # the generator writes AVI at 30 fps
def test_heard_and_seen_closures_agree_in_every_container(tmp_path, suffix, fps):
    clip = Clip(pictures_s=at_30_fps(2.0) if fps == 30 else tuple(np.arange(120) / 60))
    assert largest_error_s(write(tmp_path / f"a.{suffix}", clip), clip) < 0.02


@pytest.mark.parametrize("suffix", ["mp4", "mov", "mkv", "webm", "ts", "flv"])
def test_priming_that_is_known_is_taken_off_without_a_word(tmp_path, suffix):
    path = write(tmp_path / f"a.{suffix}")
    np.testing.assert_allclose(heard_s(path), Clip().closures_s, atol=0.002)
    assert read_sound(path).remarks == ()


@pytest.mark.parametrize(
    ("name", "codec"),
    [
        ("a.aac", "aac"),
        ("a.ts", "aac"),
        ("b.ts", "libmp3lame"),
        ("a.mp3", "libmp3lame"),
        ("a.mp2", "mp2"),
        ("c.ts", "ac3"),
        ("a.eac3", "eac3"),
    ],
)
def test_streams_that_say_nothing_are_told(tmp_path, name, codec):
    path = write(tmp_path / name, codecs=("", codec), pictures=False)
    if name == "a.mp3":  # its first frame states the priming; players cut such files at will
        whole = path.read_bytes()
        path.write_bytes(whole[whole.index(b"\xff\xfb", whole.index(b"Info")) :])
    np.testing.assert_allclose(heard_s(path), Clip().closures_s, atol=0.002)
    (remark,) = read_sound(path).remarks
    assert remark.startswith("the file does not say how much silence its")


def test_raw_aac_beside_a_video(tmp_path):
    video = write(tmp_path / "a.mp4")
    sound = write(tmp_path / "a.aac", codecs=("", "aac"), pictures=False)
    clock = clock_between(*load_audio(video), *load_audio(sound))
    assert abs(clock.offset_s) < 0.005


def test_speak_and_corpus_tell_the_uncertainty(tmp_path, talker):
    path = write(tmp_path / "take.aac", codecs=("", "aac"), pictures=False)
    np.savez(tmp_path / "take.npz", frames=np.full((2 * bringing.FPS, 4), 0.2, np.float32), fps=float(bringing.FPS))
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n2.0 pau\n", encoding="utf-8")
    report, account = bringing.added(bringing.corpus_of(tmp_path), path, tmp_path / "take.npz", tmp_path / "take.lab")
    assert "1024 samples were taken off" in report["remarks"]["take"][0]
    assert "1024 samples were taken off" in account
    _, facts = bringing.spoken(talker, path, tmp_path, "--phones", tmp_path / "take.lab")
    assert any("1024 samples were taken off" in remark for remark in facts["remarks"])
