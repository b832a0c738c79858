"""Video whose rate varies: motion lies at the true times of the pictures."""

import numpy as np
import pytest
from closing_clips import Clip, largest_error_s, opening, seen_s, write

from facesynth.capture.track import at_regular_times
from facesynth.capture.video import open_video
from facesynth.motion.irregular import steady_rate

PAUSE = tuple(t for t in np.arange(75) / 25 if not 1.2 < t < 1.7)
CHANGE = (*np.arange(15) / 15, *(1 + np.arange(60) / 30))
TREMBLING = tuple(np.arange(90) / 30 + np.round(np.random.default_rng(0).uniform(-0.008, 0.008, 90), 3) + 0.008)
VARYING = {
    "pause": (PAUSE, (0.4, 0.9, 2.1, 2.6)),
    "15 then 30": (CHANGE, (0.4, 0.8, 1.7, 2.5)),
    "trembling": (TREMBLING, (0.4, 1.1, 2.0)),
}


@pytest.mark.parametrize("suffix", ["mp4", "mov", "mkv", "webm", "ts"])
@pytest.mark.parametrize("kind", sorted(VARYING))
def test_closures_are_seen_when_they_are_heard(tmp_path, suffix, kind):
    pictures_s, closures_s = VARYING[kind]
    clip = Clip(closures_s, 3.0, pictures_s)
    assert largest_error_s(write(tmp_path / f"a.{suffix}", clip), clip) < 0.02


def test_pictures_of_an_avi_that_lie_in_another_order_than_they_are_shown(tmp_path):
    path = write(tmp_path / "a.avi", Clip(), ("libx264", "pcm_s16le"))
    assert np.abs(seen_s(path) - Clip().closures_s).max() < 0.02
    with open_video(path) as video:
        times_s = [time_s for time_s, _ in video.images]
    np.testing.assert_allclose(np.diff(times_s), 1 / 30, atol=0.002)


@pytest.mark.parametrize(("kind", "fps", "error"), [("pause", 25, 1e-6), ("15 then 30", 30, 0.05), ("trembling", 30, 0.02)])
def test_motion_is_that_of_the_talker_at_the_true_times(kind, fps, error):
    pictures_s, closures_s = VARYING[kind]
    clip = Clip(closures_s, 3.0, pictures_s)
    times_s = np.array(pictures_s)
    rate, even = steady_rate(times_s, 21.0)
    assert not even
    assert rate == fps
    found = at_regular_times(opening(clip, times_s)[:, None].astype(np.float32), times_s, rate)[:, 0]
    truth = opening(clip, np.arange(len(found)) / rate)
    seen = np.isfinite(found)
    assert np.abs(found - truth)[seen].max() < error
    between = np.diff(times_s).max() > 0.3
    assert seen[:-1].all() != between, "a pause of half a second stays a gap; nothing else is one"


def test_pictures_at_regular_times_stay_as_they_are():
    signal = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    for times_s in (np.arange(50) / 25, np.round(np.arange(50) / 25, 3)):
        assert np.array_equal(at_regular_times(signal, times_s, 25.0), signal)
