from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from facesynth.face.texture.compose import Report, TexturedFace, coherent, nearest, ping_pong
from facesynth.face.texture.speaker import Speaker, lower_face_window
from facesynth.inference.errors import FacesynthError
from facesynth.motion.planar import HeadMaps

HEIGHT, WIDTH = 90, 120


@pytest.fixture(scope="module")
def speaker():
    """Two clips of smooth noise with 16 points whose lower half opens and shuts."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(45, 75, 4), np.linspace(40, 65, 4))
    rest = np.column_stack([x.ravel(), y.ravel()])
    clips, shapes = [], []
    for length in (12, 8):
        opening = 3 * np.sin(0.5 * np.arange(length)) ** 2
        shapes.append(rest + opening[:, None, None] * np.where(rest[:, 1:] > 55, [0.0, 1.0], 0.0))
        noise = gaussian_filter(rng.uniform(0, 255, (length, HEIGHT, WIDTH, 3)), (1, 2, 2, 0))
        clips.append((40 + 3 * (noise - noise.min())).clip(0, 255).astype(np.uint8))
    return speaker_of(np.concatenate(clips), np.concatenate(shapes), np.isin(np.arange(20), (0, 12)))


def speaker_of(pictures, shapes, starts):
    """All pictures are both training pictures, cut out, and backgrounds; the head stands still."""
    linear, shift = np.tile(np.eye(2), (len(shapes), 1, 1)), np.zeros((len(shapes), 2))
    left, top, right, bottom = lower_face_window(shapes, HeadMaps(linear, shift), HEIGHT, WIDTH)
    cut = pictures[:, top:bottom, left:right]
    return Speaker(cut, np.array([left, top]), shapes, linear, shift, starts, pictures, linear, shift, 25.0)


def test_a_recorded_shape_over_its_own_picture_is_that_picture(speaker):
    face, report = TexturedFace(speaker, fade_s=0.0), Report()
    numbers = np.arange(20)
    drawn = np.stack(list(face.draw(speaker.shapes, numbers, report, "nearest")))
    chosen = face.choose(speaker.shapes, "nearest")
    assert np.array_equal(speaker.shapes[chosen], speaker.shapes)
    own = chosen == numbers
    assert own.sum() > 10
    assert np.abs(drawn[own].astype(int) - speaker.backgrounds[own]).max() <= 1
    assert (report.frames, report.folded_triangles) == (20, 0)
    assert report.real_time_factor > 0


def test_a_moved_mouth_stays_sharp(speaker):
    from scipy.ndimage import laplace

    shapes = speaker.shapes[:8] + np.array([0.4, 0.5])
    drawn = np.stack(list(TexturedFace(speaker).draw(shapes, np.arange(8), Report())))
    inner = (slice(None), slice(45, 62), slice(50, 70))
    sharpness = [
        np.mean([laplace(picture.astype(float).mean(axis=2)).std() for picture in some[inner]])
        for some in (drawn, speaker.backgrounds[:8])
    ]
    assert sharpness[0] > 0.85 * sharpness[1]


def test_nothing_changes_outside_the_ring(speaker):
    face = TexturedFace(speaker)
    shapes = speaker.shapes[[3, 5]]
    background = np.array([14, 15])
    drawn = np.stack(list(face.draw(shapes, background, Report())))
    changed = (drawn != speaker.backgrounds[background]).any(axis=(0, 3))
    y, x = np.nonzero(changed)
    low, high = face.mesh.reference.min(axis=0), face.mesh.reference.max(axis=0)
    assert changed.any()
    assert (x >= low[0]).all()
    assert (x <= high[0]).all()
    assert (y >= low[1]).all()
    assert (y <= high[1]).all()


def test_a_moved_head_takes_the_face_along(speaker):
    shifted = replace(
        speaker,
        corner=speaker.corner + np.array([7, 4]),
        shift=speaker.shift + np.array([7.0, 4.0]),
        backgrounds=np.roll(speaker.backgrounds, (4, 7), axis=(1, 2)),
        background_shift=speaker.background_shift + np.array([7.0, 4.0]),
    )
    background = np.array([13, 14, 15])
    plain = np.stack(list(TexturedFace(speaker).draw(speaker.shapes[:3], background, Report(), "nearest")))
    moved = np.stack(list(TexturedFace(shifted).draw(shifted.shapes[:3], background, Report(), "nearest")))
    inner = np.roll(plain, (4, 7), axis=(1, 2))[:, 15:-15, 15:-15].astype(int)
    assert np.abs(moved[:, 15:-15, 15:-15] - inner).max() <= 1


def test_brightness_follows_the_background(speaker):
    dark = (speaker.backgrounds * 0.8).astype(np.uint8)
    face = TexturedFace(replace(speaker, backgrounds=dark))
    drawn = next(iter(face.draw(speaker.shapes[:1], np.array([12]), Report(), "nearest")))
    middle = (slice(45, 60), slice(52, 68))
    assert drawn[middle].mean() == pytest.approx(0.8 * speaker.backgrounds[0][middle].mean(), rel=0.03)


def test_a_shape_that_would_tear_the_picture_is_relaxed_and_told_of(speaker):
    torn = speaker.shapes[:2].copy()
    torn[0, 0] += [40, 30]
    report = Report()
    list(TexturedFace(speaker).draw(torn, np.array([0, 1]), report))
    assert (report.relaxed_frames, report.folded_triangles) == (1, 0)


def test_a_jump_is_faded_over(speaker):
    """Where the pictures jump, the step that one sees becomes smaller, and all else stays."""
    shapes = np.concatenate([speaker.shapes[2:6], speaker.shapes[15:19]])
    background = np.full(8, 14)
    hard, soft = (
        np.stack(list(TexturedFace(speaker, fade_s=fade_s).draw(shapes, background, Report(), "nearest"))).astype(float)
        for fade_s in (0.0, 0.12)
    )
    step = [np.abs(np.diff(drawn, axis=0)).mean(axis=(1, 2, 3)) for drawn in (hard, soft)]
    jump = int(step[0].argmax())
    assert step[1].max() < 0.7 * step[0].max()
    assert np.array_equal(hard[: jump + 1], soft[: jump + 1])


def test_the_coherent_path_is_the_best_of_all():
    rng = np.random.default_rng(0)
    shapes, targets, looks = rng.normal(size=(5, 3, 2)), rng.normal(size=(4, 3, 2)), rng.normal(size=(5, 6))
    starts = np.array([True, False, False, True, False])
    found = coherent(targets, shapes, looks, starts, jump_weight=0.7)
    unary = ((targets[:, None] - shapes) ** 2).sum(axis=(2, 3)) / 3
    natural = np.median([((looks[i + 1] - looks[i]) ** 2).mean() for i in (0, 1, 3)])
    scale = 0.7 * np.median(unary.min(axis=1)) / natural

    def cost(path):
        total = sum(unary[t, i] for t, i in enumerate(path))
        for i, j in pairwise(path):
            free = i == j or (j == i + 1 and not starts[j])
            total += 0 if free else scale * ((looks[i] - looks[j]) ** 2).mean()
        return total

    every = np.stack(np.meshgrid(*[np.arange(5)] * 4), axis=-1).reshape(-1, 4)
    costs = [cost(path) for path in every]
    assert cost(found) == pytest.approx(min(costs))
    assert found.tolist() == every[int(np.argmin(costs))].tolist()


def test_coherence_jumps_less_than_nearest(speaker):
    rng = np.random.default_rng(1)
    targets = speaker.shapes + rng.normal(scale=0.6, size=speaker.shapes.shape)
    jumps = []
    for path in (nearest(targets, speaker.shapes), coherent(targets, speaker.shapes, speaker.looks, speaker.clip_starts, 3.0)):
        step = np.diff(path)
        jumps.append(int(((step != 0) & (step != 1)).sum()))
    assert jumps[1] < jumps[0]


def test_saved_speakers_come_back_and_bad_files_do_not(speaker, tmp_path):
    speaker.save(tmp_path / "speaker.npz")
    back = Speaker.load(tmp_path / "speaker.npz")
    assert np.array_equal(back.pictures, speaker.pictures)
    assert np.array_equal(back.shapes, speaker.shapes)
    assert back.fps == speaker.fps
    whole = (tmp_path / "speaker.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    replace(speaker, shift=speaker.shift[:3]).save(tmp_path / "odd.npz")
    replace(speaker, pressed=np.ones(3, bool)).save(tmp_path / "few.npz")
    for name in ("cut.npz", "other.npz", "none.npz", "odd.npz", "few.npz"):
        with pytest.raises(FacesynthError, match=name):
            Speaker.load(tmp_path / name)


def test_backgrounds_go_to_and_fro():
    assert ping_pong(3, 7, 9).tolist() == [3, 4, 5, 6, 5, 4, 3, 4, 5]
    assert ping_pong(3, 4, 3).tolist() == [3, 3, 3]


def test_shapes_and_backgrounds_must_be_as_many(speaker):
    with pytest.raises(FacesynthError, match="background"):
        list(TexturedFace(speaker).draw(speaker.shapes[:3], np.array([0]), Report()))


def test_a_file_that_would_unpack_to_gigabytes_is_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("facesynth.inference.npz.LARGEST_BYTES", 1000)
    np.savez_compressed(tmp_path / "big.npz", pictures=np.zeros(5000, np.uint8))
    with pytest.raises(FacesynthError, match=r"big\.npz would unpack"):
        Speaker.load(tmp_path / "big.npz")
