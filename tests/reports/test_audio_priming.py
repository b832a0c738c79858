"""Silence that encoders put in front of the sound: taken off where a file or its pictures say how much, else told."""

import bringing
import numpy as np
import pytest
from closing_clips import CONTAINERS, Clip, heard_s, largest_error_s, write

from facesynth.capture.clock import clock_between
from facesynth.speech.audio import load_audio, read_sound


@pytest.mark.parametrize("suffix", sorted(CONTAINERS))
@pytest.mark.parametrize("fps", [24, 30, 60])
def test_heard_and_seen_closures_agree_in_every_container(tmp_path, suffix, fps):
    clip = Clip(pictures_s=tuple(np.arange(2 * fps) / fps), fps=fps)
    assert largest_error_s(write(tmp_path / f"a.{suffix}", clip), clip) < 0.005


@pytest.mark.parametrize("pictures", ["mpeg4", "libx264"])
@pytest.mark.parametrize("sound", ["libmp3lame", "aac", "ac3", "mp2", "pcm_s16le"])
def test_priming_in_an_avi_is_taken_off_whatever_the_pictures_were_held_back_by(tmp_path, pictures, sound):
    for fps in (25.0, 30000 / 1001, 50.0):
        clip = Clip(pictures_s=tuple(np.arange(round(2 * fps)) / fps), fps=fps)
        path = write(tmp_path / "a.avi", clip, (pictures, sound))
        assert largest_error_s(path, clip) < 0.002
        told = [remark for remark in read_sound(path).remarks if "samples were taken off" in remark]
        assert bool(told) == (sound != "pcm_s16le")


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
        ("d.ts", "mp2"),
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
