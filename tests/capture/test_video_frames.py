from contextlib import suppress

import numpy as np
import pytest
from clips import write_video

from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError


def read(path):
    with open_video(path) as video:
        return video.fps, [(time_s, image) for time_s, image in video.images]


def test_every_picture_with_its_time(tmp_path, pictures):
    fps, read_back = read(write_video(tmp_path / "täst clip.mp4", pictures))
    assert fps == 25
    assert np.allclose([time_s for time_s, _ in read_back], np.arange(12) / 25)
    for (_, image), sent in zip(read_back, pictures, strict=True):
        assert image.shape == sent.shape
        assert abs(float(image.mean()) - float(sent.mean())) < 4


def test_times_are_on_the_sounds_clock(tmp_path, pictures):
    late = read(write_video(tmp_path / "late.mp4", pictures, sound_s=1.0, first_pts=5))[1]
    assert late[0][0] == pytest.approx(0.2, abs=0.002), "the picture starts 0.2 s after the sound"
    assert late[-1][0] - late[0][0] == pytest.approx(11 / 25, abs=0.002)


@pytest.mark.parametrize("content", [b"", b"no video at all" * 50, b"\x00\x00\x01\xba" + bytes(2000), b"RIFF"])
def test_what_is_no_video_is_one_clear_error(tmp_path, content):
    path = tmp_path / "clip.mp4"
    path.write_bytes(content)
    with pytest.raises(FacesynthError, match=r"clip\.mp4"):
        read(path)


def test_a_missing_file_and_a_sound_without_pictures(tmp_path):
    from facesynth.speech.audio import save_wav

    save_wav(tmp_path / "a.wav", np.full(8000, 0.1, np.float32), 16000)
    with pytest.raises(FacesynthError, match="no pictures"):
        read(tmp_path / "a.wav")
    with pytest.raises(FacesynthError, match="does not exist"):
        read(tmp_path / "b.mp4")


def test_cut_off_and_damaged_videos_never_end_in_a_traceback(tmp_path, pictures):
    whole = write_video(tmp_path / "whole.mp4", pictures).read_bytes()
    rng = np.random.default_rng(3)
    path = tmp_path / "hurt.mp4"
    for trial in range(20):
        hurt = bytearray(whole[: int(rng.integers(1, len(whole)))]) if trial % 2 else bytearray(whole)
        for place in rng.integers(0, len(hurt), 30):
            hurt[place] = int(rng.integers(256))
        path.write_bytes(bytes(hurt))
        with suppress(FacesynthError):
            assert len(read(path)[1]) <= 2 * len(pictures)
