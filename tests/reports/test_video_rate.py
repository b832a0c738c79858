"""Video whose rate varies: motion lies at the true times of the pictures."""

import bringing
import numpy as np
import pytest
from closing_clips import Clip, clicks_of, largest_error_s, opening, peaks, seen_s, write
from seen_faces import SCALE_PX, face_mm

from facesynth.capture.landmarks import GROUPS, LIP_PAIRS
from facesynth.capture.track import at_regular_times
from facesynth.capture.tracker import Seen
from facesynth.capture.video import open_video
from facesynth.corpus import Corpus
from facesynth.motion.irregular import steady_rate
from facesynth.speech.audio import load_audio

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


class MouthReader:
    """A tracker that reads how far the drawn lips are apart, and lays a face of 468 points with lips so far apart."""

    def __init__(self, face=None):
        self._rest_mm = face_mm()

    def check_alone(self, image):
        pass

    def follow(self, image):
        opened = 1 - (image[25:55, 20:44].mean() - 30) / 170
        points = self._rest_mm.copy()
        points[list(GROUPS["lower_lip"]), 1] -= 12 * opened
        return Seen((points * SCALE_PX * [1, -1, -1] + [320, 240, 0]).astype(np.float32), np.zeros((2, 2), np.float32), 20.0)


AT_60 = tuple(t for t in np.arange(180) / 60 if not 1.2 < t < 1.7)
THROUGH_THE_COMMAND = [
    ("mp4", "15 then 30", *VARYING["15 then 30"]),
    ("mkv", "trembling", *VARYING["trembling"]),
    ("webm", "60 with a pause", AT_60, (0.4, 0.9, 2.1, 2.6)),
    ("ts", "60, then 30", (*np.arange(60) / 60, *(1 + np.arange(60) / 30)), (0.4, 0.8, 1.7, 2.5)),
    ("mov", "30, one in four lost", tuple(np.delete(np.arange(90) / 30, slice(3, None, 4))), (0.4, 1.1, 2.0)),
]


@pytest.mark.parametrize(("suffix", "kind", "pictures_s", "closures_s"), THROUGH_THE_COMMAND)
def test_corpus_add_lays_closures_where_they_are_heard(tmp_path, monkeypatch, suffix, kind, pictures_s, closures_s):
    monkeypatch.setattr("facesynth.capture.track.Tracker", MouthReader)
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))
    path = write(tmp_path / f"take.{suffix}", Clip(closures_s, 3.0, pictures_s))
    (tmp_path / "take.lab").write_text("0.5 pau\n2.5 aa\n3.0 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", path, tmp_path / "take.lab", "--performer", "A")
    assert report["added"] == ["take"], report
    assert any("the video's rate varies" in remark for remark in report["remarks"]["take"]), kind
    assert "the video's rate varies" in account
    corpus = Corpus.open(tmp_path / "c")
    motion, upper, lower = corpus["take"].motion, *np.array(LIP_PAIRS).T
    apart = np.linalg.norm(motion.points[:, upper] - motion.points[:, lower], axis=2).mean(axis=1)
    heard = clicks_of(*load_audio(corpus.files.audio("take")))
    seen = peaks(-np.nan_to_num(apart, nan=float(np.nanmax(apart)))) / motion.fps
    assert motion.fps > 29.9
    assert len(seen) == len(heard) == len(closures_s), (heard, seen)
    assert np.abs(heard - seen).max() < 0.02
