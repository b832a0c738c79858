"""Points followed in drawn footage, whose motion is known."""

import numpy as np
import pytest
import torch

from facesynth.errors import FacesynthError
from facesynth.face.texture.footage import Footage, read_footage, refuse_cuts, steady
from facesynth.face.texture.region import FaceRegion
from facesynth.face.texture.shapes import picture_points, shapes_of
from facesynth.face.texture.tracking import corners, drift, neighbours_mean, track_clips
from facesynth.face.texture.warp import sample
from facesynth.face.video import write_video

cv2 = pytest.importorskip("cv2")
HEIGHT, WIDTH = 120, 160
BOX = (40, 10, 120, 110)


@pytest.fixture(scope="module")
def texture():
    rng = np.random.default_rng(0)
    picture = cv2.GaussianBlur(rng.uniform(0, 255, (HEIGHT, WIDTH)).astype(np.float32), (0, 0), 1.6)
    return (255 * (picture - picture.min()) / np.ptp(picture)).astype(np.float32)


def drawn(texture, motion):
    """[T, H, W] the texture with motion(t, x, y) px, the displacement of the point that is at (x, y) at t = 0."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    frames = []
    for t in range(motion.length):
        back = np.stack([x, y], axis=-1)
        for _ in range(8):  # the point that comes to lie here: a fixed point, since the motion is gentle
            back = np.stack([x, y], axis=-1) - motion(t, back[..., 0], back[..., 1])
        offset = torch.from_numpy(back - np.stack([x, y], axis=-1)).float()[None]
        frames.append(sample(torch.from_numpy(texture)[None, None], offset)[0, 0].numpy())
    return np.stack(frames).round().clip(0, 255).astype(np.uint8)


class Chewing:
    """The head wanders and turns; below the middle, the face moves down and up by 4 px."""

    def __init__(self, length, phase=0.0):
        self.length, self.phase = length, phase

    def head(self, t):
        return 0.04 * np.sin(0.2 * t + self.phase), np.array(
            [3 * np.sin(0.15 * t + self.phase), 2 * np.sin(0.1 * t + self.phase)]
        )

    def face(self, t, x, y):
        opening = 4 * np.sin(0.4 * t) ** 2
        return np.stack([0 * x, opening / (1 + np.exp(-(y - 85) / 6))], axis=-1)

    def __call__(self, t, x, y):
        angle, shift = self.head(t)
        moved = np.stack([x, y], axis=-1) + self.face(t, x, y) - np.array([80, 60])
        turned = moved @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return turned + np.array([80, 60]) + shift - np.stack([x, y], axis=-1)


@pytest.fixture(scope="module")
def chewed(texture):
    motions = [Chewing(40), Chewing(25, phase=0.0)]
    region = FaceRegion.from_box(BOX, HEIGHT, WIDTH)
    return motions, track_clips([drawn(texture, motion) for motion in motions], region, 60)


def test_points_follow_the_motion(chewed):
    motions, tracks = chewed
    for motion, clip in zip(motions, tracks.clips, strict=True):
        start = tracks.reference
        wanted = np.stack([start + motion(t, start[:, 0], start[:, 1]) for t in range(motion.length)])
        error = np.linalg.norm(clip - wanted, axis=-1)
        assert np.nanmedian(error) < 0.15
        assert np.nanquantile(error, 0.95) < 0.6
    assert tracks.lost_share < 0.05
    assert tracks.lower >= 30


def test_shapes_keep_the_mouth_and_lose_the_head(chewed):
    motions, tracks = chewed
    start = tracks.reference[: tracks.lower]
    for motion, shape in zip(motions, shapes_of(tracks, 25.0), strict=True):
        wanted = np.stack([start + motion.face(t, start[:, 0], start[:, 1]) for t in range(motion.length)])
        assert np.median(np.linalg.norm(shape.points - wanted, axis=-1)) < 0.7
        back = shape.head.to_head(shape.head.to_picture(shape.points))
        np.testing.assert_allclose(back, shape.points, atol=1e-8)


def test_motion_and_back(chewed):
    shape = shapes_of(chewed[1], 25.0)[0]
    motion = shape.to_motion()
    assert motion.layout.unit == "px"
    np.testing.assert_allclose(picture_points(motion.frames), shape.points, atol=1e-3)


def test_drift_of_a_still_picture_is_nothing(texture):
    clip = np.repeat(texture.astype(np.uint8)[None], 10, axis=0)
    report = drift(clip, corners(clip[0], FaceRegion.from_box(BOX, HEIGHT, WIDTH).lower, 40))
    assert report.worst_tenth_px < 0.05
    assert report.lost_share == 0


def test_a_covered_point_is_lost_and_found_again(texture):
    clip = drawn(texture, Chewing(30))
    clip[10:16, 60:100, 60:90] = 128
    tracks = track_clips([clip], FaceRegion.from_box(BOX, HEIGHT, WIDTH), 60)
    hidden = (
        (tracks.reference[:, 0] > 68)
        & (tracks.reference[:, 0] < 82)
        & (tracks.reference[:, 1] > 70)
        & (tracks.reference[:, 1] < 90)
    )
    assert np.isnan(tracks.clips[0][12, hidden, 0]).mean() > 0.5
    assert np.isfinite(tracks.clips[0][25, hidden, 0]).mean() > 0.8
    assert all(np.isfinite(shape.points).all() for shape in shapes_of(tracks, 25.0))


def test_gaps_follow_their_neighbours():
    reference = np.random.default_rng(0).uniform(0, 10, (20, 2)).astype(np.float32)
    displacement = np.full((20, 2), 3.0, np.float32)
    displacement[4] = np.nan
    np.testing.assert_allclose(neighbours_mean(reference, displacement), 3.0, rtol=1e-6)


def test_a_blank_face_is_refused():
    with pytest.raises(FacesynthError, match="stand out"):
        track_clips([np.full((5, HEIGHT, WIDTH), 90, np.uint8)], FaceRegion.from_box(BOX, HEIGHT, WIDTH))


@pytest.mark.parametrize("box", [(0, 0, 200, 100), (50, 50, 60, 60), (90, 10, 40, 110)])
def test_boxes_outside_the_picture_are_refused(box):
    with pytest.raises(FacesynthError, match="box must lie in the picture"):
        FaceRegion.from_box(box, HEIGHT, WIDTH)


def test_masks_must_fit_the_picture():
    assert FaceRegion.from_mask(np.ones((HEIGHT, WIDTH)), HEIGHT, WIDTH).lower.all()
    with pytest.raises(FacesynthError, match="mask"):
        FaceRegion.from_mask(np.ones((4, 4)), HEIGHT, WIDTH)


def test_steady_footage_stays_and_unsteady_is_resampled():
    frames = np.arange(10, dtype=np.uint8)[:, None, None, None] * np.ones((10, 2, 2, 3), np.uint8)
    even = steady(frames, [i / 25 for i in range(10)], 25.0)
    assert (even.resampled, even.fps) == (False, 25.0)
    assert np.array_equal(even.frames, frames)
    late = steady(frames, [0, 0.04, 0.08, 0.12, 0.16, 0.36, 0.40, 0.44, 0.48, 0.52], 19.0)
    assert late.resampled
    assert late.fps == pytest.approx(25.0)
    assert len(late.frames) == 14
    assert late.frames[4, 0, 0, 0] == 4
    assert late.frames[-1, 0, 0, 0] == 9


def test_a_cut_is_found_and_talking_is_none(texture):
    smooth = cv2.GaussianBlur(texture, (0, 0), 12) * 6 % 256
    smooth = cv2.GaussianBlur(smooth, (0, 0), 6)
    calm = np.repeat(drawn(smooth, Chewing(20))[..., None], 3, axis=-1)
    refuse_cuts(Footage(calm, 25.0, False), "calm")
    other = np.concatenate([calm[:10], calm[10:, ::-1]])
    with pytest.raises(FacesynthError, match=r"cut at 0\.40 s"):
        refuse_cuts(Footage(other, 25.0, False), "both")


def test_files_are_read_and_bad_ones_refused(texture, tmp_path):
    frames = np.repeat(drawn(texture, Chewing(12))[..., None], 3, axis=-1)
    write_video(tmp_path / "clip.mp4", frames, 30)
    footage = read_footage(tmp_path / "clip.mp4")
    assert footage.frames.shape == (12, HEIGHT, WIDTH, 3)
    assert footage.fps == pytest.approx(30)
    assert not footage.resampled
    assert footage.grey.shape == (12, HEIGHT, WIDTH)
    (tmp_path / "no.mp4").write_bytes(b"not a video at all")
    with pytest.raises(FacesynthError, match="cannot be read"):
        read_footage(tmp_path / "no.mp4")


def test_sound_alone_is_refused(tmp_path):
    import soundfile

    soundfile.write(tmp_path / "only.wav", np.zeros(8000), 16000)
    with pytest.raises(FacesynthError, match="sound but no video"):
        read_footage(tmp_path / "only.wav")
