import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.capture.clock import Clock, Recorder, clock_between, on_clock
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion

RATE = 16000


def syllables(seconds, seed=0):
    """Noise in bursts of 0.1 to 0.3 s, as loud as speech, as a function of time (s)."""
    rng = np.random.default_rng(seed)
    starts = np.cumsum(rng.uniform(0.1, 0.35, int(seconds / 0.2) + 20))
    levels = rng.uniform(0.02, 1, len(starts))

    def loudness(times_s):
        index = np.clip(np.searchsorted(starts, times_s) - 1, 0, None)
        return levels[index] * (times_s >= 0) * (times_s <= seconds)

    return loudness


def recorded(loudness, seconds, offset_s=0.0, drift=0.0, noise=0.0, rate=RATE, seed=1):
    """What a microphone hears whose clock started `offset_s` before and runs faster by `drift`."""
    rng = np.random.default_rng(seed)
    times_s = (np.arange(int(seconds * rate)) / rate - offset_s) / (1 + drift)
    return (0.3 * loudness(times_s) * rng.standard_normal(len(times_s)) + noise * rng.standard_normal(len(times_s))).astype(
        np.float32
    )


@pytest.mark.parametrize(("offset_s", "drift"), [(0.0, 0.0), (0.7312, 0.0), (-0.4, 0.0), (2.5, 3e-4), (0.1, -5e-4)])
def test_offset_and_drift_are_found(offset_s, drift):
    loudness = syllables(60)
    camera = recorded(loudness, 60, noise=0.01)
    sound = recorded(loudness, 60, offset_s, drift, rate=44100, seed=2)
    clock = clock_between(camera, RATE, sound, 44100)
    assert clock.offset_s == pytest.approx(offset_s, abs=0.003)
    assert clock.drift == pytest.approx(drift, abs=1e-4)


def test_a_short_clip_has_an_offset_and_no_drift():
    loudness = syllables(3)
    clock = clock_between(recorded(loudness, 3), RATE, recorded(loudness, 4, 0.25, seed=3), RATE)
    assert clock.offset_s == pytest.approx(0.25, abs=0.003)
    assert clock.drift == 0
    assert not clock.drift_known
    assert "too short to tell" in str(clock)


def test_fifteen_seconds_are_too_short_to_tell_a_drift():
    loudness = syllables(15)
    clock = clock_between(recorded(loudness, 15), RATE, recorded(loudness, 15, 0.1, drift=3e-4, seed=5), RATE)
    assert clock.offset_s == pytest.approx(0.1, abs=0.006)
    assert "drift +0 ppm" not in str(clock)
    assert "drift +300 ppm" in str(Clock(0.1, 3e-4, 0.9))


def test_the_place_of_each_clip_in_one_long_recording_is_found():
    loudness = syllables(90)
    recorder = Recorder.of(recorded(loudness, 90, noise=0.01, rate=44100), 44100)
    for start_s in (0.0, 31.7, 82.0):
        clip = recorded(lambda times, start_s=start_s: loudness(times + start_s), 6, noise=0.01, seed=3)
        part = recorder.part_of(clip, RATE)
        assert len(part) / 44100 == pytest.approx(6, abs=0.01)
        assert clock_between(clip, RATE, part, 44100).offset_s == pytest.approx(0, abs=0.004)
    with pytest.raises(FacesynthError, match="nowhere in the recorder's"):
        recorder.part_of(recorded(syllables(6, seed=8), 6, seed=9), RATE)


def test_another_takes_sound_is_refused():
    with pytest.raises(FacesynthError, match="another take"):
        clock_between(recorded(syllables(20), 20), RATE, recorded(syllables(20, seed=9), 20, seed=4), RATE)
    with pytest.raises(FacesynthError, match=r"0\.2 s"):
        clock_between(np.zeros(100, np.float32), RATE, np.zeros(RATE, np.float32), RATE)


def test_motion_moves_with_the_clock_and_gaps_with_it():
    layout = tiny_layout()
    times = np.arange(100) / 50
    frames = np.tile(np.sin(2 * np.pi * times)[:, None], (1, layout.channels)).astype(np.float32)
    frames[60:64] = np.nan
    eyes = np.tile([[1.0, 0.1, 0.0]], (100, 1))
    moved = on_clock(Motion(frames, 50, layout, eyes=eyes), Clock(0.31, 0.001, 1.0))
    wanted = np.sin(2 * np.pi * ((np.arange(len(moved)) / 50 - 0.31) / 1.001))
    seen = np.isfinite(moved.frames[:, 0])
    assert np.abs(moved.frames[seen, 0] - wanted[seen]).max() < 1e-3
    assert not seen[:15].any(), "before the camera ran nothing is known"
    assert seen[16:75].all()
    assert not seen[76:79].any()
    assert moved.head is None
    assert np.nanmax(moved.eyes[:, 0]) == 1
