import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from talking_points import moved, talk

from facesynth.evaluation import variety
from facesynth.evaluation.head import head_cca, head_distance
from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion


def nodding(rotations):
    """The talking face with a head of these rotation vectors [240, 3]."""
    motion = talk()
    return Motion(motion.frames, motion.fps, motion.layout, np.concatenate([rotations, np.zeros((240, 3))], axis=1))


@pytest.fixture
def rotations():
    rng = np.random.default_rng(5)
    return np.cumsum(rng.normal(0, 0.01, (240, 3)), axis=0)


def test_identity_and_any_linear_map_of_the_rotation_correlate_fully(rotations):
    truth = nodding(rotations)
    assert head_cca(truth, truth) == pytest.approx(1)
    assert head_distance(truth, truth) == 0
    turned = rotations @ np.random.default_rng(1).normal(size=(3, 3)) + 0.2
    assert head_cca(nodding(turned), truth) == pytest.approx(1, abs=1e-5)


def test_cca_of_one_shared_axis_is_its_correlation():
    rng = np.random.default_rng(2)
    shared, own = np.linalg.qr(rng.normal(size=(240, 2)) - 0)[0].T
    shared, own = shared - shared.mean(), own - own.mean()
    mixed = 0.6 * shared / shared.std() + 0.8 * own / own.std()
    expected = np.corrcoef(mixed, shared)[0, 1]
    zero = np.zeros(240)
    value = head_cca(nodding(np.stack([mixed, zero, zero], 1)), nodding(np.stack([zero, shared, zero], 1)))
    assert value == pytest.approx(abs(expected), abs=1e-4)


def test_a_still_head_follows_nothing(rotations):
    assert head_cca(nodding(np.full((240, 3), 0.1)), nodding(rotations)) == 0
    with pytest.raises(UnavailableError, match="stands still"):
        head_cca(nodding(rotations), nodding(np.zeros((240, 3))))


def test_euler_distance_of_a_known_turn():
    yaw, pitch = (Rotation.from_euler("YXZ", angles, degrees=True).as_rotvec() for angles in ((3, 4, 0), (0, 0, 0)))
    assert head_distance(nodding(np.tile(yaw, (240, 1))), nodding(np.tile(pitch, (240, 1)))) == pytest.approx(5, rel=1e-4)


def test_without_a_head_there_is_nothing_to_compare(rotations):
    with pytest.raises(UnavailableError, match="recording has no head"):
        head_cca(nodding(rotations), talk())
    with pytest.raises(UnavailableError, match="moves no head"):
        head_distance(talk(), nodding(rotations))


def test_diversity_of_known_offsets_and_errors_of_the_mean_and_the_best():
    truth = talk()
    samples = [moved(truth, truth.frames + np.tile([0, 0, z], 12).astype(np.float32)) for z in (-1.0, 1.0, 3.0)]
    assert variety.diversity(samples) == pytest.approx((2 + 4 + 2) / 3, rel=1e-4)
    assert variety.error_of_mean(samples, truth) == pytest.approx(1, rel=1e-4)
    assert variety.error_of_best(samples, truth) == pytest.approx(1, rel=1e-4)
    with pytest.raises(FacesynthError, match="two samples"):
        variety.diversity(samples[:1])


def drawn(size, seeds=4, motion=None):
    truth = motion or talk()
    return [
        moved(truth, truth.frames + size * np.random.default_rng(seed).normal(size=truth.frames.shape)) for seed in range(seeds)
    ]


def test_the_same_motion_over_and_over_has_no_diversity_and_the_error_of_one():
    samples = [talk(delay_s=0.05)] * 3
    assert variety.diversity(samples) == 0
    alone = metric_of(samples[0])
    assert variety.error_of_mean(samples, talk()) == pytest.approx(alone)
    assert variety.error_of_best(samples, talk()) == pytest.approx(alone)


def metric_of(motion):
    return float(np.linalg.norm(motion.points - talk().points, axis=2).mean())


def test_more_noise_is_more_diversity_and_a_mean_worse_by_the_root_of_their_number():
    sizes = (0.1, 0.2, 0.4, 0.8)
    assert np.all(np.diff([variety.diversity(drawn(size)) for size in sizes]) > 0)
    assert np.all(np.diff([variety.error_of_mean(drawn(size), talk()) for size in sizes]) > 0)
    noise = np.sqrt(8 / np.pi)  # mean length of three normal numbers
    samples = drawn(1.0, seeds=16)
    assert variety.diversity(samples) == pytest.approx(noise * np.sqrt(2), rel=0.02)
    assert variety.error_of_mean(samples, talk()) == pytest.approx(noise / 4, rel=0.02)
    assert variety.error_of_best(samples, talk()) == pytest.approx(noise, rel=0.02)


@pytest.mark.parametrize("fault", ["length", "rate", "layout"])
def test_samples_that_do_not_match_are_refused(fault):
    motion = talk()
    names = tuple(reversed(motion.layout.names))
    layout = Layout(motion.layout.kind, names, motion.layout.groups, motion.layout.lip_pairs, motion.layout.neutral)
    other = {
        "length": Motion(motion.frames[:-1], motion.fps, motion.layout),
        "rate": Motion(motion.frames, 25.0, motion.layout),
        "layout": Motion(motion.frames, motion.fps, layout),
    }[fault]
    with pytest.raises(FacesynthError):
        variety.diversity([motion, other])
    for measure in (variety.error_of_mean, variety.error_of_best):
        with pytest.raises(FacesynthError):
            measure([motion, other], motion)
