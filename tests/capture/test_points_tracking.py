"""Points followed in drawn footage, whose motion is known."""

import numpy as np
import pytest
from chewing import BOX, HEIGHT, WIDTH, Chewing, drawn, skin

from facesynth.capture.points.footage import Footage, read_footage, refuse_cuts, steady
from facesynth.capture.points.reference import Reference
from facesynth.capture.points.region import FaceRegion
from facesynth.capture.points.shapes import outliers
from facesynth.capture.points.tracking import corners, drift, follow_clip, neighbours_mean
from facesynth.face.draw.video import write_video
from facesynth.inference.errors import FacesynthError
from facesynth.motion.planar import picture_points

cv2 = pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def texture():
    return skin(0)


@pytest.fixture(scope="module")
def chewed(texture):
    motions = [Chewing(40), Chewing(25, phase=0.0)]
    clips = [filmed(drawn(texture, motion)) for motion in motions]
    return motions, clips, Reference.choose(clips, FaceRegion.from_box(BOX, HEIGHT, WIDTH), 60)


def filmed(grey, fps=25.0):
    """Footage of grey pictures [T, H, W]."""
    return Footage(np.repeat(grey[..., None], 3, axis=-1), fps, False)


def test_points_follow_the_motion(chewed):
    motions, clips, reference = chewed
    for motion, clip in zip(motions, clips, strict=True):
        start = reference.points
        path = follow_clip(clip.frames[..., 0], reference.picture, start)
        wanted = np.stack([start + motion(t, start[:, 0], start[:, 1]) for t in range(motion.length)])
        error = np.linalg.norm(path - wanted, axis=-1)
        assert np.nanmedian(error) < 0.15
        assert np.nanquantile(error, 0.95) < 0.6
        _, following = reference.find(clip)
        assert following.lost_share < 0.05
        assert following.drift.median_px < 0.3
    assert reference.lower >= 30


def test_shapes_keep_the_mouth_and_lose_the_head(chewed):
    motions, clips, reference = chewed
    start = reference.points[: reference.lower]
    for motion, clip in zip(motions, clips, strict=True):
        shape, _ = reference.find(clip)
        wanted = np.stack([start + motion.face(t, start[:, 0], start[:, 1]) for t in range(motion.length)])
        assert np.median(np.linalg.norm(shape.points - wanted, axis=-1)) < 0.7
        back = shape.head.to_head(shape.head.to_picture(shape.points))
        np.testing.assert_allclose(back, shape.points, atol=1e-8)


def test_motion_and_back(chewed):
    shape, _ = chewed[2].find(chewed[1][0])
    motion = shape.to_motion(chewed[2].layout)
    assert motion.layout.unit == "px"
    np.testing.assert_allclose(picture_points(motion.frames), shape.points, atol=1e-3)


def test_a_point_that_jumps_onto_something_else_is_an_outlier():
    rng = np.random.default_rng(0)
    reference = rng.uniform(0, 100, (40, 2))
    mouth = 5 * np.sin(np.arange(30))[:, None, None] * np.where(reference[:, 1:] > 50, [0.0, 1.0], 0.0)
    fixed = reference + mouth + rng.normal(scale=0.3, size=(30, 40, 2))
    assert not outliers(reference, fixed).any()
    fixed[12:15, 7] += [9, 5]
    strayed = outliers(reference, fixed)
    assert strayed[12:15, 7].all()
    assert strayed.sum() == 3


def test_saved_points_come_back_and_bad_files_do_not(chewed, tmp_path):
    reference = chewed[2]
    reference.save(tmp_path / "points.npz")
    back = Reference.load(tmp_path / "points.npz")
    assert np.array_equal(back.points, reference.points)
    assert back.lower == reference.lower
    (tmp_path / "cut.npz").write_bytes((tmp_path / "points.npz").read_bytes()[:2000])
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("cut.npz", "other.npz", "none.npz"):
        with pytest.raises(FacesynthError, match=name):
            Reference.load(tmp_path / name)


def test_another_scene_or_another_camera_is_refused(chewed, texture):
    reference = chewed[2]
    other = np.ascontiguousarray(texture[::-1, ::-1]).astype(np.uint8)
    with pytest.raises(FacesynthError, match="speaker's points are found"):
        reference.find(filmed(np.repeat(other[None], 6, axis=0)))
    with pytest.raises(FacesynthError, match="100×60 px, those of the first clip 160×120"):
        reference.find(filmed(np.zeros((6, 60, 100), np.uint8)))


def test_drift_of_a_still_picture_is_nothing(texture):
    clip = np.repeat(texture.astype(np.uint8)[None], 10, axis=0)
    report = drift(clip, corners(clip[0], FaceRegion.from_box(BOX, HEIGHT, WIDTH).lower, 40))
    assert report.worst_tenth_px < 0.05
    assert report.lost_share == 0


def test_a_covered_point_is_lost_and_found_again(texture):
    clip = drawn(texture, Chewing(30))
    clip[10:16, 60:100, 60:90] = 128
    reference = Reference.choose([filmed(clip)], FaceRegion.from_box(BOX, HEIGHT, WIDTH), 60)
    path = follow_clip(clip, reference.picture, reference.points)
    x, y = reference.points.T
    hidden = (x > 68) & (x < 82) & (y > 70) & (y < 90)
    assert np.isnan(path[12, hidden, 0]).mean() > 0.5
    assert np.isfinite(path[25, hidden, 0]).mean() > 0.8
    shapes, following = reference.find(filmed(clip))
    assert np.isfinite(shapes.points).all()
    assert following.lost_share > 0


def test_gaps_follow_their_neighbours():
    reference = np.random.default_rng(0).uniform(0, 10, (20, 2)).astype(np.float32)
    displacement = np.full((20, 2), 3.0, np.float32)
    displacement[4] = np.nan
    np.testing.assert_allclose(neighbours_mean(reference, displacement), 3.0, rtol=1e-6)


def test_a_blank_face_is_refused():
    with pytest.raises(FacesynthError, match="stand out"):
        Reference.choose([filmed(np.full((5, HEIGHT, WIDTH), 90, np.uint8))], FaceRegion.from_box(BOX, HEIGHT, WIDTH))


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


def test_a_video_of_varying_rate_is_laid_on_a_steady_clock(texture, tmp_path):
    from clips import write_video as write_pictures

    grey = drawn(texture, Chewing(20))
    times = [*range(10), *range(15, 25)]  # five pictures were dropped
    path = write_pictures(tmp_path / "phone.mkv", np.repeat(grey[..., None], 3, axis=-1), fps=25, pts=times)
    footage = read_footage(path)
    assert footage.resampled
    assert footage.fps == pytest.approx(25, rel=0.01)
    assert len(footage.frames) == 25


def test_pictures_lie_on_the_clock_of_the_sound():
    frames = np.arange(10, dtype=np.uint8)[:, None, None, None] * np.ones((10, 2, 2, 3), np.uint8)
    late = steady(frames, [0.2 + i / 25 for i in range(10)], 25.0)
    assert (late.resampled, len(late.frames)) == (False, 15)
    assert late.frames[:, 0, 0, 0].tolist() == [0, 0, 0, 0, 0, *range(10)]


def test_a_rate_that_is_stated_wrongly_is_told_from_the_time_stamps():
    frames = np.zeros((18_000, 1, 1, 3), np.uint8)
    ntsc = 30000 / 1001
    footage = steady(frames, (np.arange(18_000) / ntsc).tolist(), 30.0)
    assert footage.fps == pytest.approx(ntsc, rel=1e-9)
    assert steady(frames[:75], (np.arange(75) / 25).round(3).tolist(), 25.0).fps == 25.0


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
    (tmp_path / "no.mp4").write_bytes(b"not a video at all")
    with pytest.raises(FacesynthError, match="cannot be read"):
        read_footage(tmp_path / "no.mp4")


def test_sound_alone_is_refused(tmp_path):
    import soundfile

    soundfile.write(tmp_path / "only.wav", np.zeros(8000), 16000)
    with pytest.raises(FacesynthError, match="no pictures in it"):
        read_footage(tmp_path / "only.wav")
