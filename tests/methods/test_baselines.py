import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout

from facesynth.corpus import Corpus, Record
from facesynth.evaluation.geometry import marker_error
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.baselines.phone_mean import PhoneMean
from facesynth.methods.baselines.ridge import ALPHAS, Ridge
from facesynth.methods.baselines.tcn import Tcn
from facesynth.methods.learn.regression import Moments

METHODS = {"mean_face": MeanFace, "phone_mean": PhoneMean, "ridge": Ridge, "tcn": lambda: Tcn(steps=80)}
QUICK = METHODS | {"tcn": lambda: Tcn(steps=3)}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=24, fps=60)


@pytest.fixture(scope="module")
def split(corpus):
    return corpus.split(seed=0, test_share=0.25)


@pytest.fixture(scope="module")
def trained(split):
    return {name: make().fit(split[0], seed=0) for name, make in METHODS.items()}


def saying(*pairs, emotion="neutral", intensity=1.0):
    """Speech of (phone, end in s) pairs, with a hum for sound."""
    track = PhoneTrack(tuple(p for p, _ in pairs), np.array([end for _, end in pairs]))
    audio = 0.1 * np.sin(np.arange(round(track.duration_s * 16000)) / 20)
    return Speech(audio, 16000, track, EmotionTrack.constant(emotion, track.duration_s, intensity))


@pytest.mark.parametrize("make", QUICK.values(), ids=QUICK)
def test_the_same_seed_learns_and_says_the_same(split, make):
    speech = split[1][split[1].ids[0]].speech
    one, other = (make().fit(split[0], seed=0).synthesize(speech).frames for _ in range(2))
    assert np.array_equal(one, other)


def test_what_hears_or_reads_beats_the_mean_face_on_other_sentences(trained, split):
    errors = {
        name: np.mean([marker_error(method.synthesize(u.speech), u.motion) for u in split[1]]) for name, method in trained.items()
    }
    assert errors["phone_mean"] < 0.8 * errors["mean_face"]
    assert errors["ridge"] < 0.95 * errors["mean_face"]
    assert errors["tcn"] < 0.95 * errors["mean_face"]


def test_one_sentence_is_too_little_for_ridge_and_says_why(corpus):
    with pytest.raises(FacesynthError, match="held-out sentences"):
        Ridge().fit(corpus.subset(corpus.ids[:1]))


def test_phone_mean_reaches_each_pose_in_the_middle_of_its_phone(trained):
    method = trained["phone_mean"]
    motion = method.synthesize(saying(("aa", 0.2), ("p", 0.4), ("aa", 0.6)))
    rows = method.facts["rows"]
    pose = method.poses[rows.index(["neutral", "p"])].numpy()
    assert motion.frames[18] == pytest.approx(pose, abs=1e-3)
    gap = motion.points[:, 9, 1] - motion.points[:, 10, 1]
    assert gap[18] == gap.min()


def test_phone_mean_holds_a_pause_and_follows_emotion_and_intensity(trained):
    method = trained["phone_mean"]
    held = method.synthesize(saying(("aa", 0.2), ("pau", 1.2), ("aa", 1.4))).frames[21:63]
    assert np.ptp(held, axis=0).max() < 1e-3
    neutral, half, sad = (method.synthesize(saying(("aa", 0.3), emotion="sad", intensity=i)).frames for i in (0, 0.5, 1))
    assert half == pytest.approx((neutral + sad) / 2, abs=1e-3)
    assert np.abs(sad - neutral).max() > 1
    assert np.array_equal(neutral, method.synthesize(saying(("aa", 0.3))).frames)


def test_phone_mean_of_a_phone_that_nobody_said_is_the_mean_face(trained):
    motion = trained["phone_mean"].synthesize(saying(("zh", 0.3)))
    assert motion.frames == pytest.approx(np.tile(trained["mean_face"].mean.numpy(), (18, 1)), abs=1e-4)


def test_missing_samples_do_not_count(corpus, tmp_path):
    holes = Corpus.create(tmp_path / "holes", performer="Holes", layout=tiny_layout(), fps=60, emotions=corpus.emotions)
    for record in corpus.usable_records[:6]:
        utterance = corpus[record.id]
        frames = utterance.motion.frames.copy()
        frames[10:40, 0:3] = np.nan
        holes.add_utterance(
            Record(record.id, record.text, emotion=record.emotion), utterance.speech, Motion(frames, 60, tiny_layout())
        )
    kept = np.concatenate([np.delete(corpus[i].motion.frames, range(10, 40), axis=0) for i in holes.ids])
    assert MeanFace().fit(holes).mean[:3].numpy() == pytest.approx(kept[:, :3].mean(axis=0), abs=1e-3)
    for make in QUICK.values():
        assert np.isfinite(make().fit(holes).synthesize(saying(("aa", 0.3))).frames).all()


def test_any_layout_and_rate(tmp_path):
    layout = Layout("curves", ("jawOpen", "mouthClose"), {"mouth": (0, 1)})
    curves = Corpus.create(tmp_path / "curves", performer="Curves", layout=layout, fps=25, emotions=("neutral",))
    for i in range(3):
        speech = saying(("pau", 0.3), ("aa", 0.7 + 0.1 * i), ("m", 1.2))
        frames = np.random.default_rng(i).uniform(0, 1, (30, 2))
        curves.add_utterance(Record(f"u{i}", f"words {i}"), speech, Motion(frames, 25, layout))
    for make in QUICK.values():
        motion = make().fit(curves).synthesize(saying(("pau", 0.3), ("aa", 1.0)))
        assert motion.frames.shape == (25, 2)


def test_ridge_solves_its_normal_equations():
    rng = np.random.default_rng(0)
    x, true = rng.normal(size=(500, 7)).astype(np.float32), rng.normal(size=(7, 3))
    y = (x @ true + 4 + 0.1 * rng.normal(size=(500, 3))).astype(np.float32)
    moments = Moments.zero(7, 3)
    for part in np.array_split(np.arange(500), 4):
        moments.add(x[part], y[part])
    centred = x - x.mean(axis=0)
    for alpha, (weights, bias) in zip(ALPHAS, moments.solutions(ALPHAS), strict=True):
        penalty = alpha * 500 * centred.var(axis=0).mean()
        expected = np.linalg.solve(centred.T @ centred + penalty * np.eye(7), centred.T @ (y - y.mean(axis=0)))
        assert weights == pytest.approx(expected, abs=1e-4)
        assert moments.error(weights, bias) == pytest.approx(np.square(x @ weights + bias - y).sum(axis=1).mean(), rel=1e-3)


def test_learning_leaves_torch_s_own_generator_as_it_was(split):
    import torch

    torch.manual_seed(5)
    before = torch.get_rng_state()
    Tcn(steps=2).fit(split[0].subset(split[0].ids[:2]), seed=3)
    Tcn(steps=2)
    assert torch.equal(before, torch.get_rng_state())
