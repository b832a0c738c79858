import runpy

import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout
from scipy.optimize import nnls

from facesynth.corpus import Corpus, Record
from facesynth.evaluation.geometry import marker_error
from facesynth.inference.coarticulation.blending import WeightModels, blend_key_shapes
from facesynth.inference.coarticulation.model import CLASS_OF, hold_keys
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import bilabial_spans, gap, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONE_INDEX, PHONES, VISEME_CLASSES
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.coarticulation.decomposition import cosine_weights, decompose, linear_weights
from facesynth.methods.coarticulation.keys import learn_keys
from facesynth.methods.coarticulation.method import Coarticulation
from facesynth.methods.coarticulation.recordings import samples_of, track_of, transitions_of
from facesynth.methods.coarticulation.transitions import (
    PENALTIES,
    by_classes,
    fit_polynomials,
    fitting_cost,
    learn_models,
)

FPS = 100.0
SIZE = len(VISEME_CLASSES)


def saying(*pairs, emotion="neutral"):
    """Speech of (phone, length in s) pairs, silent: co-articulation does not hear."""
    track = PhoneTrack(tuple(p for p, _ in pairs), np.cumsum([length for _, length in pairs]))
    audio = np.zeros(round(track.duration_s * 16000), np.float32)
    return Speech(audio, 16000, track, EmotionTrack.constant(emotion, track.duration_s))


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=24, fps=60)


@pytest.fixture(scope="module")
def split(corpus):
    return corpus.split(seed=0, test_share=0.25)


@pytest.fixture(scope="module")
def model(split):
    return Coarticulation(triphones=3).fit(split[0])


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("stiffness", [0.0, 0.3])
def test_weights_are_those_of_scipys_non_negative_least_squares(count, stiffness):
    rng = np.random.default_rng(count)
    frames, samples, prior = rng.standard_normal((60, 5)), rng.standard_normal((60, count, 5)), rng.random((60, count))
    found = decompose(frames, samples, prior, stiffness)
    for frame, sample, drawn, weights in zip(frames, samples, prior, found, strict=True):
        tall = np.vstack([sample.T, np.sqrt(stiffness) * np.eye(count)])
        wanted, _ = nnls(tall, np.concatenate([frame, np.sqrt(stiffness) * drawn]))
        assert weights == pytest.approx(wanted, abs=1e-8)


def test_weights_rebuild_what_is_made_of_the_samples():
    rng = np.random.default_rng(0)
    samples, weights = rng.standard_normal((40, 3, 6)), rng.random((40, 3))
    frames = np.einsum("tk,tkd->td", weights, samples)
    assert decompose(frames, samples, np.zeros((40, 3)), 0.0) == pytest.approx(weights, abs=1e-8)


def test_samples_at_rest_give_the_straight_line():
    prior = linear_weights(np.linspace(0, 1, 7), 2)
    assert decompose(np.zeros((7, 4)), np.zeros((7, 2, 4)), prior, 1e-12) == pytest.approx(prior)


# A talker whose every move is known: shapes of its own for each phone, weights (1 - t)(1 + a t) and t (1 + b (1 - t)) with
# another a and b for each pair of viseme classes. At t = 0 and 1 a shape stands alone, so the middle of a phone is its key.
@pytest.fixture(scope="module")
def known_talker():
    rng = np.random.default_rng(1)
    spoken = ["aa", "iy", "m", "s", "ow"]
    keys = np.zeros((len(PHONES), 6))
    keys[[PHONE_INDEX[p] for p in spoken]] = rng.standard_normal((len(spoken), 6))
    bends = rng.uniform(-0.4, 0.9, (SIZE, SIZE, 2))
    zero = np.zeros((SIZE, SIZE))
    starting = np.stack([zero + 1, bends[..., 0] - 1, -bends[..., 0], zero], axis=-1)
    ending = np.stack([zero, 1 + bends[..., 1], -bends[..., 1], zero], axis=-1)
    models = WeightModels(np.stack([starting, ending], axis=2), np.zeros((0, 3), np.int64), np.zeros((0, 3, 4)))
    tracks = []
    for _ in range(30):
        labels = [str(rng.choice(spoken)) for _ in range(8)]
        phones = PhoneTrack(tuple(labels), np.cumsum(2 * rng.integers(3, 8, 8)) / FPS)
        numbers = np.array([PHONE_INDEX[label] for label in labels])
        times_s = np.arange(round(phones.duration_s * FPS)) / FPS
        frames = blend_key_shapes(phones, CLASS_OF[numbers], keys[numbers], models, times_s)
        tracks.append(track_of(frames, phones, FPS))
    return tracks, keys, models, [PHONE_INDEX[p] for p in spoken]


def test_a_talker_made_of_known_shapes_and_polynomials_is_found_back(known_talker):
    tracks, keys, models, spoken = known_talker
    found_keys = learn_keys(samples_of(tracks), shrink=0, context=0)
    assert found_keys.phones[spoken] == pytest.approx(keys[spoken])
    transitions = transitions_of(tracks, 2, 0.0)
    found = learn_models(transitions, transitions_of([], 3, 0.0), SIZE, degree=3, pull=0, least=1)
    pairs = [pair for pair in by_classes(transitions) if pair[0] != pair[1]]
    assert len(pairs) >= 12
    for pair in pairs:
        assert found.diphones[pair] == pytest.approx(models.diphones[pair], abs=1e-6)


def test_the_fitting_cost_is_nothing_from_the_talkers_own_degree_on(known_talker):
    kinds = [transitions_of(known_talker[0], 2, 0.0)]
    kinds = [type(kinds[0])(*(getattr(kinds[0], n)[kinds[0].classes[:, 0] != kinds[0].classes[:, 1]] for n in vars(kinds[0])))]
    costs = [fitting_cost(kinds, degree, 0.0) for degree in (1, 2, 3)]
    assert costs[0] > 1
    assert costs[1:] == pytest.approx([0, 0], abs=1e-9)
    assert fitting_cost(kinds, 3, PENALTIES[-1]) > fitting_cost(kinds, 3, PENALTIES[1]) > costs[2]


def test_a_pair_nobody_recorded_has_the_common_polynomials_and_none_at_all_a_cosine(known_talker):
    tracks, *_ = known_talker
    nothing = transitions_of([], 3, 0.0)
    some = learn_models(transitions_of(tracks, 2, 0.0), nothing, SIZE, degree=3, pull=20, least=1)
    assert np.array_equal(some.diphones[0, 0], some.diphones[10, 11])
    none = learn_models(transitions_of([], 2, 0.0), nothing, SIZE, degree=3, pull=20, least=1)
    t = np.linspace(0, 1, 9)
    assert np.vander(t, 4, increasing=True) @ none.diphones[1, 2].T == pytest.approx(cosine_weights(t), abs=0.02)


def test_a_strong_pull_draws_every_pair_to_the_common_one(known_talker):
    transitions = transitions_of(known_talker[0], 2, 0.0)
    common = fit_polynomials(transitions.times, transitions.weights, 3)
    drawn = learn_models(transitions, transitions_of([], 3, 0.0), SIZE, degree=3, pull=1e9, least=1)
    assert drawn.diphones == pytest.approx(np.tile(common, (SIZE, SIZE, 1, 1)), abs=1e-3)


def test_motion_is_as_long_as_the_phones_and_complete(model):
    for speech in (saying(("pau", 0.4), ("aa", 0.213), ("p", 0.1)), saying(("m", 0.1)), saying(("pau", 3.0))):
        motion = model.synthesize(speech)
        assert len(motion) == round(speech.duration_s * 60)
        assert np.isfinite(motion.frames).all()


def test_it_is_nearer_than_the_mean_face_on_other_sentences(model, split):
    assert len(model.triphone_keys)
    mean = MeanFace().fit(split[0])
    neutral = [u for u in split[1] if set(u.speech.emotions.labels) == {"neutral"}]
    ours, theirs = (np.mean([marker_error(m.synthesize(u.speech), u.motion) for u in neutral]) for m in (model, mean))
    assert ours < 0.8 * theirs


def test_lips_close_at_p_b_and_m_as_in_the_recordings(model, split):
    for utterance in split[1]:
        phones, motion = utterance.speech.phones, model.synthesize(utterance.speech)
        spans = bilabial_spans(phones, 60)
        assert (
            max(narrowest_gaps(motion.frames.astype(float), motion.layout, spans), default=0) < model.facts["closed_gap"] + 1e-3
        )


def test_a_saved_model_says_the_same(model, split, tmp_path):
    model.save(tmp_path / "model.safetensors")
    loaded = Coarticulation.load(tmp_path / "model.safetensors")
    speech = split[1][split[1].ids[0]].speech
    assert np.array_equal(loaded.synthesize(speech).frames, model.synthesize(speech).frames)


def of_kind(corpus, folder, kind):
    """The corpus' lower face as another kind of layout: landmarks from the front, or heights as curves."""
    names = corpus.layout.names[4:14]
    layout = Layout(kind, names) if kind == "curves" else Layout(kind, names, lip_pairs=((5, 6),))
    made = Corpus.create(folder, performer="Other", layout=layout, fps=60, emotions=corpus.emotions, licence="CC0-1.0")
    for utterance in corpus:
        points = utterance.motion.points[:, 4:14]
        frames = points[..., :2].reshape(len(points), -1) if kind == "landmarks" else 0.5 + points[..., 1] / 400
        record = next(r for r in corpus.records if r.id == utterance.id)
        made.add_utterance(
            Record(record.id, record.text, record.sentence, record.emotion), utterance.speech, Motion(frames, 60, layout)
        )
    return Corpus.open(folder)


@pytest.mark.parametrize("kind", ["landmarks", "curves"])
def test_landmarks_and_curves_are_learned_too(corpus, tmp_path, kind):
    other = of_kind(corpus, tmp_path / kind, kind)
    learned = Coarticulation().fit(other)
    utterance = next(u for u in other if set(u.speech.emotions.labels) == {"neutral"})
    motion = learned.synthesize(utterance.speech)
    spread = np.abs(utterance.motion.frames - utterance.motion.frames.mean(axis=0)).mean()
    assert np.abs(motion.frames - utterance.motion.frames[: len(motion)]).mean() < 0.7 * spread
    if kind == "curves":
        assert 0 <= motion.frames.min() <= motion.frames.max() <= 1


def test_shapes_of_closures_are_reached_in_the_middle_of_the_phone_and_nothing_else_is_moved():
    phones = PhoneTrack(("aa", "m", "aa", "s"), np.array([0.2, 0.3, 0.5, 0.6]))
    keys = np.array([[1.0], [0.25], [1.0], [0.5]])
    held = hold_keys(np.ones((60, 1)), keys, phones, 100)[:, 0]
    assert held[20:30].min() == pytest.approx(0.25)
    assert held[:15] == pytest.approx(1)
    assert held[36:] == pytest.approx(1)


def test_two_minutes_are_enough(tmp_path):
    small = tiny_corpus(tmp_path / "two", utterances=60, fps=25)
    assert sum(u.motion.duration_s for u in small) < 120
    train, test = small.split(seed=0, test_share=0.2)
    learned, mean = Coarticulation().fit(train), MeanFace().fit(train)
    neutral = [u for u in test if set(u.speech.emotions.labels) == {"neutral"}]
    ours, theirs = (np.mean([marker_error(m.synthesize(u.speech), u.motion) for u in neutral]) for m in (learned, mean))
    assert ours < 0.7 * theirs


def test_phones_nobody_recorded_are_named_and_take_the_shape_of_their_class(model):
    assert "zh" in model.facts["phones_without_sample"]
    keys = model.speaker().parts.keys.phones
    assert np.isfinite(keys).all()
    assert np.linalg.norm(keys[PHONE_INDEX["d"]] - keys[PHONE_INDEX["t"]]) < np.linalg.norm(
        keys[PHONE_INDEX["d"]] - keys[PHONE_INDEX["aa"]]
    )


@pytest.mark.parametrize("setting", [{"degree": 0}, {"pull": -1.0}, {"components": 0.0}])
def test_settings_that_cannot_be_are_refused_in_one_line(setting):
    with pytest.raises(FacesynthError, match="coarticulation wants") as told:
        Coarticulation(**setting)
    assert "\n" not in str(told.value)


def test_recordings_without_a_complete_middle_are_refused_in_one_line(tmp_path):
    layout = tiny_layout()
    holes = Corpus.create(tmp_path / "holes", performer="Gap", layout=layout, fps=60, emotions=("neutral",))
    speech = saying(("aa", 0.2), ("m", 0.1))
    frames = np.tile(np.array(layout.neutral, np.float32), (18, 1))
    frames[[3, 4, 5, 6, 7, 8, 9, 13, 14, 15, 16], 0] = np.nan
    holes.add_utterance(Record("one", "am", "one", "neutral"), speech, Motion(frames, 60, layout))
    with pytest.raises(FacesynthError, match="no phone of .* has complete motion") as told:
        Coarticulation().fit(Corpus.open(tmp_path / "holes"))
    assert "\n" not in str(told.value)


def test_options_that_do_not_exist_are_refused(model):
    with pytest.raises(FacesynthError, match="temperature"):
        model.synthesize(saying(("aa", 0.2)), temperature=1)


def test_a_layout_without_lips_leaves_frames_alone(model):
    assert gap(model.synthesize(saying(("m", 0.2))).frames, tiny_layout()).min() < 2


def test_the_training_script_trains_and_says_what_it_found(corpus, repository, tmp_path, capsys):
    path = tmp_path / "made.safetensors"
    script = runpy.run_path(str(repository / "train" / "coarticulation.py"))
    script["main"]([str(corpus.path), "--config", str(repository / "configs" / "coarticulation_paper.yaml"), "-o", str(path)])
    told = capsys.readouterr().out
    assert "error on sentences left out" in told
    assert Coarticulation.load(path).config["context"] == 0
