import itertools
from pathlib import Path

import numpy as np
import pytest
from clips import write_video

from facesynth.capture import track as tracking
from facesynth.capture.detection import Detector, Face, _distinct
from facesynth.capture.kept_tracks import kept_track
from facesynth.capture.square import Square
from facesynth.capture.track import track_face
from facesynth.capture.tracker import Seen, Tracker
from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError


class Faces:
    """A detector that finds what it is told to."""

    def __init__(self, *xs):
        self.found = [Face(Square(x, 50.0, 40.0), 0.9) for x in xs]

    def faces(self, image):
        return self.found


def tracker(face, *xs):
    return Tracker(face, Faces(*xs), object(), object())


def test_several_faces_are_refused_or_chosen_from_the_left():
    with pytest.raises(FacesynthError, match=r"2 faces.*--face"):
        tracker(None, 20, 80)._find(None)
    with pytest.raises(FacesynthError, match="2 faces"):
        tracker(None, 20, 80).check_alone(None)
    tracker(2, 20, 80).check_alone(None)
    assert tracker(2, 20, 80)._find(None).x_px == 80
    assert tracker(None, 20)._find(None).side_px == 60
    with pytest.raises(FacesynthError, match="face 3"):
        tracker(3, 20, 80)._find(None)
    assert tracker(None)._find(None) is None


def test_a_face_that_was_lost_is_found_where_it_was():
    lost = tracker(1, 20, 80)
    lost._last = Square(75.0, 50.0, 60.0)
    assert lost._find(None).x_px == 80


def test_one_face_found_twice_is_one_and_bystanders_are_passed_over():
    large, again, small = Face(Square(50, 50, 40), 0.9), Face(Square(53, 50, 42), 0.8), Face(Square(150, 50, 12), 0.95)
    assert _distinct([large, again, small]) == [large]
    assert _distinct([]) == []


class Script:
    """A tracker that sees what a list says: log odds of a face for each picture, None where there is none."""

    def __init__(self, logits):
        self.logits = iter(logits)

    def check_alone(self, image):
        pass

    def follow(self, image):
        logit = next(self.logits)
        return None if logit is None else Seen(np.full((468, 3), image.mean(), np.float32), np.zeros((2, 2), np.float32), logit)


def test_dropped_pictures_and_damaged_ones_are_gaps(tmp_path, pictures, monkeypatch):
    monkeypatch.setattr(tracking, "Tracker", lambda face: Script([20, 20, None, 20, 3, 20, 21, 20, 20, 20, 20, 20]))
    path = write_video(tmp_path / "a.mp4", pictures, pts=[0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13])
    track = track_face(path)
    assert len(track.points_px) >= 14 or track.fps != 25
    if track.fps == 25:
        assert np.flatnonzero(~track.present).tolist() == [2, 4, 7, 8]


def test_a_video_without_a_face_is_refused(tmp_path, pictures, monkeypatch):
    monkeypatch.setattr(tracking, "Tracker", lambda face: Script([None] * 12))
    with pytest.raises(FacesynthError, match="shows a face in 0 of 12"):
        track_face(write_video(tmp_path / "a.mp4", pictures))


def test_a_face_is_followed_once_and_a_damaged_track_again(tmp_path, pictures, monkeypatch):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))
    made = []
    monkeypatch.setattr(tracking, "Tracker", lambda face: made.append(face) or Script([20.0] * 12))
    path = write_video(tmp_path / "a.mp4", pictures)
    first = kept_track(path)
    assert np.array_equal(kept_track(path).points_px, first.points_px)
    assert made == [None]
    kept_track(path, face=1)
    assert made == [None, 1]
    for kept in (tmp_path / "cache" / "tracks").iterdir():
        kept.write_bytes(kept.read_bytes()[:100])
    assert np.array_equal(kept_track(path).points_px, first.points_px)
    assert len(made) == 3


def test_a_real_talker_agrees_with_mediapipe_itself(landmark_models, recordings):
    """468 points within 2.5 % of the eye distance of those that a newer model of MediaPipe recorded; the irises within 1.5 %."""
    clip = recordings("grid_s26") / "bgbsza.mpg"
    recorded = np.load(clip.with_name("bgbsza_mediapipe.npz"))
    track = track_face(clip)
    theirs = recorded["landmarks"][..., :2] * [360, 288]
    ours = track.points_px[recorded["frame"] - 1, :, :2]
    eyes_px = np.linalg.norm(theirs[:, 33] - theirs[:, 263], axis=1)
    off = np.linalg.norm(ours - theirs[:, :468], axis=2) / eyes_px[:, None]
    assert np.median(off) < 0.025
    irises = np.linalg.norm(track.irises_px[recorded["frame"] - 1] - theirs[:, [468, 473]], axis=2) / eyes_px[:, None]
    assert np.median(irises) < 0.015


def test_a_real_face_is_found_upright_tilted_and_small_and_two_are_two(landmark_models, recordings):
    clip = Path(recordings("grid_s26")) / "bgbsza.mpg"
    with open_video(clip) as video:
        image = next(iter(video.images))[1]
    detector = Detector()
    (face,) = detector.faces(image)
    beside = np.concatenate([image, image], axis=1)
    assert [round(found.square.x_px) for found in detector.faces(beside)] == pytest.approx(
        [face.square.x_px, face.square.x_px + 360], abs=12
    )
    far = np.zeros((1152, 1440, 3), np.uint8)
    far[500:788, 300:660] = image
    (small,) = detector.faces(far)
    assert small.square.x_px == pytest.approx(face.square.x_px + 300, abs=12)
    assert Tracker().follow(np.zeros_like(image)) is None


@pytest.mark.slow
def test_ten_clips_of_a_real_talker_agree_in_points_and_in_the_opening_of_the_lips(landmark_models, recordings):
    off, alike = [], []
    for clip in sorted(recordings("grid_s26").glob("*.mpg")):
        recorded = np.load(clip.with_name(f"{clip.stem}_mediapipe.npz"))
        theirs = recorded["landmarks"][..., :2] * [360, 288]
        ours = kept_track(clip).points_px[recorded["frame"] - 1, :, :2]
        eyes_px = np.linalg.norm(theirs[:, 33] - theirs[:, 263], axis=1)
        off.append(np.nanmedian(np.linalg.norm(ours - theirs[:, :468], axis=2) / eyes_px[:, None]))
        gaps = [(points[:, 14, 1] - points[:, 13, 1]) / eyes_px for points in (ours, theirs)]
        known = np.isfinite(gaps[0])
        alike.append(np.corrcoef(gaps[0][known], gaps[1][known])[0, 1])
    assert len(off) == 10
    assert np.median(off) < 0.025
    assert np.median(alike) >= 0.88


def test_of_two_talkers_side_by_side_one_must_be_chosen(landmark_models, recordings, tmp_path):
    from facesynth.capture.video import open_video

    beside = []
    for name in ("bgbsza", "lrbi7p"):
        with open_video(recordings("grid_s26") / f"{name}.mpg") as video:
            beside.append([image for _, image in itertools.islice(video.images, 30)])
    images = [np.hstack(pair) for pair in zip(*beside, strict=True)]
    path = write_video(tmp_path / "two.mp4", images)
    with pytest.raises(FacesynthError, match="--face"):
        track_face(path)
    left, right = (track_face(path, face) for face in (1, 2))
    for track, low in ((left, 0), (right, 360)):
        middle = np.nanmedian(track.points_px[:, 4, 0])
        assert low < middle < low + 360
    assert np.nanmedian(left.points_px[:, 4, 0]) < np.nanmedian(right.points_px[:, 4, 0])
    with pytest.raises(FacesynthError, match="3"):
        track_face(path, 3)
