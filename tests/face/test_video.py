from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest

from facesynth.face.draw.video import exact_rate, frame_count, read_video, write_video
from facesynth.inference.errors import FacesynthError

SIZE = (48, 64)


def moving_bar(count):
    for t in range(count):
        frame = np.zeros((*SIZE, 3), np.uint8)
        frame[:, (2 * t) % SIZE[1] : (2 * t) % SIZE[1] + 8] = 255
        yield frame


def beeps(duration_s, rate):
    t = np.arange(round(duration_s * rate)) / rate
    return (0.5 * np.sin(2 * np.pi * 440 * t) * ((t % 1) < 0.5)).astype(np.float32)


@pytest.mark.parametrize("fps", [25, 30, 23.976, 29.97, Fraction(24000, 1001), 12.5])
def test_rates_are_exact(tmp_path, fps):
    path = tmp_path / "a clip – ü.mp4"
    assert write_video(path, moving_bar(9), fps) == 9
    video = read_video(path)
    assert video.fps == exact_rate(fps)
    assert video.frames.shape == (9, *SIZE, 3)


def test_names_of_rates():
    assert exact_rate(23.976) == exact_rate(23.98) == Fraction(24000, 1001)
    assert exact_rate(29.97) == Fraction(30000, 1001)
    assert exact_rate(24) == 24
    assert frame_count(10.0, 29.97) == 300


@pytest.mark.parametrize(("fps", "rate"), [(30, 16000), (Fraction(30000, 1001), 48000), (25, 44100), (30, 22050), (60, 8000)])
def test_picture_and_sound_last_as_long_and_start_together(tmp_path, fps, rate):
    duration_s = 3.21
    sound = beeps(duration_s, rate)
    write_video(tmp_path / "a.mp4", moving_bar(frame_count(duration_s, fps)), fps, sound, rate)
    video = read_video(tmp_path / "a.mp4")
    frame_s = 1 / float(fps)
    assert len(video.frames) == round(duration_s * float(fps))
    assert abs(len(video.audio) / video.sample_rate - duration_s) < frame_s
    sound = beeps(duration_s, video.sample_rate)
    assert video.audio[: len(sound)].std() == pytest.approx(sound.std(), rel=0.03)
    n = min(len(sound), len(video.audio))
    lag = np.fft.irfft(np.fft.rfft(video.audio[:n], 2 * n) * np.conj(np.fft.rfft(sound[:n], 2 * n))).argmax()
    assert min(lag, 2 * n - lag) / video.sample_rate < 0.002


def test_frames_come_back_in_order(tmp_path):
    write_video(tmp_path / "a.mp4", moving_bar(20), 25)
    for wrote, read in zip(moving_bar(20), read_video(tmp_path / "a.mp4").frames, strict=True):
        assert np.abs(wrote.astype(int) - read).mean() < 12


def rolling_waves(count, height=280, width=240):
    """Smooth pictures that move, as large as a page's panels: what threads of an encoder disagree about."""
    y, x = np.mgrid[:height, :width]
    waves = np.stack([127 + 120 * np.sin(x / 9 + k) * np.cos(y / 7 + k * x / 50) for k in range(3)], axis=2).astype(np.uint8)
    return (np.roll(waves, 3 * t, axis=1) for t in range(count))


def test_the_same_pictures_and_sound_give_the_same_bytes_on_a_loaded_machine(tmp_path):
    def write(number):
        path = tmp_path / f"{number}.mp4"
        write_video(path, rolling_waves(30), 25, beeps(1.2, 16000), 16000)
        return path.read_bytes()

    with ThreadPoolExecutor(8) as pool:
        written = set(pool.map(write, range(24)))
    assert len(written) == 1
    (content,) = written
    assert b" threads=1 " in content, "files of several threads differ now and then, and from machine to machine"
    assert b"Lavf" not in content
    assert b"Lavc" not in content


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError])
def test_an_interruption_leaves_nothing_and_keeps_the_old_file(tmp_path, failure):
    path = tmp_path / "a.mp4"
    path.write_bytes(b"old")

    def broken():
        yield from moving_bar(5)
        raise failure

    with pytest.raises(failure):
        write_video(path, broken(), 25, beeps(1, 16000))
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("frames", "fps", "audio", "rate"),
    [
        ([], 25, None, 16000),
        ([np.zeros((47, 64, 3), np.uint8)], 25, None, 16000),
        ([np.zeros((48, 64, 3), np.uint8), np.zeros((48, 66, 3), np.uint8)], 25, None, 16000),
        ([np.zeros((48, 64, 3), np.float32)], 25, None, 16000),
        ([np.zeros((48, 64, 3), np.uint8)], 0, None, 16000),
        ([np.zeros((48, 64, 3), np.uint8)], 25, np.full(10, np.nan), 16000),
        ([np.zeros((48, 64, 3), np.uint8)], 25, np.zeros(100), 0),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(tmp_path, frames, fps, audio, rate):
    with pytest.raises(FacesynthError):
        write_video(tmp_path / "a.mp4", frames, fps, audio, rate)
    assert not list(tmp_path.iterdir())


def test_a_stranger_file_is_refused(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"not a video")
    with pytest.raises(FacesynthError):
        read_video(tmp_path / "a.mp4")
