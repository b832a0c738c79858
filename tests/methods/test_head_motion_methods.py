"""Methods of the head on a talker whose head follows the voice, batch and stream, with and without key poses."""

import numpy as np
import pytest
from nodding import RATE, nodding, nodding_corpus

from facesynth.evaluation.head import head_cca, head_distance
from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.keys import HeadKeys
from facesynth.inference.quaternions import from_angles, to_rotvec
from facesynth.methods.head_hmm.method import HeadHmmMethod
from facesynth.methods.head_knn.method import HeadKnnMethod
from facesynth.methods.registry import load


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return nodding_corpus(tmp_path_factory.mktemp("nod") / "corpus", 12)


@pytest.fixture(scope="module")
def knn(corpus):
    return HeadKnnMethod(starts=6, validation=3).fit(corpus)


@pytest.fixture(scope="module")
def swift(tmp_path_factory):
    """Where the speed of the head follows the voice, as what is searched for does."""
    return nodding_corpus(tmp_path_factory.mktemp("swift") / "corpus", 12, speed=True)


@pytest.fixture(scope="module")
def hmm(corpus):
    return HeadHmmMethod(clusters=8, noise=0.0, centred=False).fit(corpus)


def test_clusters_follow_a_voice_that_was_not_learned_from(hmm):
    for number in (100, 101, 102):
        speech, truth = nodding(number)
        moved = hmm.synthesize(speech)
        assert len(moved) == len(truth)
        assert (moved.frames == moved.frames[0]).all(), "the face is at rest"
        assert head_cca(moved, truth) > 0.75


def test_recorded_movements_follow_a_voice_that_was_not_learned_from(swift):
    model = HeadKnnMethod(near=0.7, rough=0.3).fit(swift)
    for number in (100, 101, 102):
        speech, truth = nodding(number, speed=True)
        moved = model.synthesize(speech)
        assert len(moved) == len(truth)
        assert (moved.frames == moved.frames[0]).all(), "the face is at rest"
        assert head_cca(moved, truth) > 0.9


def test_it_is_nearer_than_a_head_that_stays_at_rest(hmm, corpus):
    rest = np.concatenate([u.motion.head for u in corpus]).mean(axis=0)
    own, still = [], []
    for number in range(100, 106):
        speech, truth = nodding(number)
        moved = hmm.synthesize(speech)
        own.append(head_distance(moved, truth))
        moved.head[:] = rest
        still.append(head_distance(moved, truth))
    assert np.mean(own) < 0.9 * np.mean(still)


def test_searched_weights_are_a_share_each_and_beat_the_middle(knn, corpus):
    weights = knn.weights.numpy()
    assert weights.sum() == pytest.approx(1, abs=1e-5)
    assert (weights >= 0).all()
    assert knn.facts["validation_error"] < 6, "a head that stays at its mean is off by 1 in each of six channels"
    assert len(knn.facts["validated_on"]) == 3


def test_the_head_goes_to_key_poses_as_fast_as_it_was_recorded(swift):
    model = HeadKnnMethod(near=0.02, rough=0.03, away=0.95, neighbours=200).fit(swift)
    speech, _ = nodding(100, speed=True)
    pose = np.concatenate([to_rotvec(from_angles(np.radians([[5.0, 6.0, 3.0]])))[0], [0, -1, 0]])
    keys = HeadKeys(np.array([1.0]), pose[None])
    with_keys, without = model.synthesize(speech, head_keys=keys).head, model.synthesize(speech).head
    off, still_off = (np.degrees(np.linalg.norm(head[60, :2] - pose[:2])) for head in (with_keys, without))
    assert off < 0.6 * still_off
    assert np.abs(with_keys[:, 2]).max() < 1e-6, "this talker never tilts the head, and the tilt asked for counts in no norm"


def test_key_poses_beyond_the_end_are_refused(knn):
    speech, _ = nodding(100)
    with pytest.raises(FacesynthError, match=r"a key pose lies at 9 s; the speech ends at 2.000 s"):
        knn.synthesize(speech, head_keys=HeadKeys(np.array([9.0]), np.zeros((1, 6))))


@pytest.mark.parametrize("keys", [HeadKeys.none(), HeadKeys(np.array([0.0, 1.2]), np.array([[0.1] * 6, [0.2] * 6]))])
def test_a_stream_that_waits_for_the_end_is_the_whole(knn, keys):
    speech, _ = nodding(101)
    stream = knn.stream(look_ahead_s=np.inf, keys=keys, sample_rate=RATE)
    sizes = [1, 700, 160, 9000, 4, 12000]
    pieces = np.split(speech.audio, np.cumsum(sizes))
    got = np.concatenate([*(stream.push(piece) for piece in pieces), stream.finish()])
    np.testing.assert_allclose(got, knn.synthesize(speech, head_keys=keys).head, atol=1e-6)
    with pytest.raises(FacesynthError, match="finished"):
        stream.push(pieces[0])


@pytest.mark.parametrize("look_ahead_s", [0.0, 0.1, 0.5])
def test_a_stream_gives_poses_as_soon_as_it_may(knn, look_ahead_s):
    speech, truth = nodding(102)
    stream, got = knn.stream(look_ahead_s=look_ahead_s), []
    latest = 0.0
    for start in range(0, len(speech.audio), 400):
        got.append(stream.push(speech.audio[start : start + 400]))
        ready = min(start + 400, len(speech.audio)) / RATE - knn.speaker().windows.look_ahead_s - look_ahead_s
        latest = max(latest, ready - sum(map(len, got)) / knn.fps)
    poses = np.concatenate([*got, stream.finish()])
    assert latest < 2 / knn.fps
    assert poses.shape == truth.head.shape
    assert np.isfinite(poses).all()
    steps = np.linalg.norm(np.diff(poses, axis=0), axis=1)
    recorded = np.linalg.norm(knn.moves.numpy(), axis=1).max()
    assert steps.max() <= recorded * 1.001, "every step is a recorded one"


@pytest.mark.parametrize("cls", [HeadKnnMethod, HeadHmmMethod])
def test_saved_models_move_as_before(cls, corpus, tmp_path):
    model = cls(**({"near": 0.2, "rough": 0.5, "away": 0.3} if cls is HeadKnnMethod else {"clusters": 4})).fit(corpus)
    model.save(tmp_path / "head.safetensors")
    assert (tmp_path / "head.safetensors").stat().st_size < 2e6
    speech, _ = nodding(100)
    again = load(tmp_path / "head.safetensors")
    np.testing.assert_array_equal(again.synthesize(speech, seed=3).head, model.synthesize(speech, seed=3).head)
    assert again.capabilities.part == "head"


@pytest.mark.parametrize("cls", [HeadKnnMethod, HeadHmmMethod])
@pytest.mark.parametrize(
    ("heads", "message"),
    [(0, "no recording of .* has a head pose"), (1, "1 of 3 recordings of .* have a head pose in every frame; at least 2")],
)
def test_too_few_heads_are_refused_in_one_line(cls, heads, message, tmp_path):
    with pytest.raises(FacesynthError, match=message) as refusal:
        cls().fit(nodding_corpus(tmp_path / "few", 3, heads=heads))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HeadKnnMethod(neighbours=0), "head_knn wants 1 to 31 components"),
        (lambda: HeadKnnMethod(near=-1.0), "no negative weight"),
        (lambda: HeadHmmMethod(clusters=1), "head_hmm wants 2 clusters or more"),
    ],
)
def test_settings_that_cannot_be_are_refused(make, message):
    with pytest.raises(FacesynthError, match=message):
        make()


def test_noise_moves_the_head_a_little_and_by_the_seed(corpus):
    noisy = HeadHmmMethod(clusters=4, noise=0.5).fit(corpus)
    speech, _ = nodding(100)
    one, two = noisy.synthesize(speech, seed=1).head, noisy.synthesize(speech, seed=2).head
    assert 0 < np.abs(one - two).max() < 0.1
    np.testing.assert_array_equal(one, noisy.synthesize(speech, seed=1).head)
    assert np.abs(np.diff(one[:, :3], axis=0)).max() < 0.03, "it does not tremble"
