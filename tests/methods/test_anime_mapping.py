import dataclasses

import numpy as np
import pytest
import torch
from corpora import tiny_corpus, tiny_layout

from facesynth.inference.anime_graph.candidates import Chooser
from facesynth.inference.closures import keep_shut
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack
from facesynth.methods.anime_graph.mapping import MapSettings, Samples, fit_map
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.parallel import aligned, emotion_pairs, retakes, take_of
from facesynth.methods.anime_graph.report import MapTrial, learner, unit_cube_rms


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("mapping") / "corpus", utterances=30)


@pytest.fixture(scope="module")
def model(corpus):
    return AnimeGraph(variance=0.98).fit(corpus)


@pytest.fixture(scope="module")
def takes(corpus, model):
    return [take_of(u, model.components) for u in corpus]


def in_emotion(corpus, emotion):
    return next(u for u in corpus if u.emotion == emotion)


def sentences(shift, count=4, seed=0):
    rng = np.random.default_rng(seed)
    x = [rng.normal(size=(80, 2)) for _ in range(count)]
    return [Samples(a, a + shift(a) + 0.3 * rng.normal(size=a.shape), np.zeros(2), np.zeros(6), f"s{k}") for k, a in enumerate(x)]


def test_parallel_sentences_and_retakes_are_found(takes):
    pairs = emotion_pairs(takes, "neutral", "happy")
    assert len({a.sentence for a, _ in pairs}) >= 4
    assert all((a.sentence, a.emotion, b.emotion) == (b.sentence, "neutral", "happy") for a, b in pairs)
    assert all((a.sentence, a.emotion) == (b.sentence, b.emotion) and a.take != b.take for a, b in retakes(takes))
    assert not emotion_pairs(takes, "neutral", "sad")


def test_alignment_undoes_another_timing(takes):
    take = takes[0]
    slow = np.sort(np.concatenate([np.arange(len(take.frames)), np.arange(60, 100), np.arange(60, 100)]))
    slower = dataclasses.replace(take, components=take.components[slow] + 5, frames=take.frames[slow])
    found = aligned(take, slower, np.arange(2))
    assert np.abs(slow[found] - np.arange(len(take.frames))).max() <= 2


def test_components_are_split_into_speech_and_emotion(model):
    rows = model.facts["components"]
    kinds = {row["is"] for row in rows}
    assert {"speech", "emotion"} <= kinds
    most_mouth = max(rows, key=lambda row: row["mouth_share"])
    assert most_mouth["is"] == "speech"
    brows = [row for row in rows if row["block"] == "upper face"]
    assert any(row["is"] == "emotion" for row in brows)
    assert rows[0]["yardstick"] == "takes"


def test_split_can_be_overridden(corpus):
    model = AnimeGraph(variance=0.98, emotional_components=[1]).fit(corpus)
    assert [row["component"] for row in model.facts["components"] if row["is"] == "emotion"] == [1]
    with pytest.raises(FacesynthError, match="emotional components"):
        AnimeGraph(emotional_components=[99]).fit(corpus)


def test_without_second_takes_the_sentences_are_the_yardstick(corpus):
    firsts = corpus.subset([u.id for u in corpus if u.take == 1])
    model = AnimeGraph(variance=0.98).fit(firsts)
    assert model.facts["components"][0]["yardstick"] == "sentences"
    assert "by chance from sentence to sentence" in model.facts["findings"][0]
    assert model.maps.find(0, 1) is not None


@pytest.mark.parametrize("kernel", ["exponential", "gaussian"])
@pytest.mark.parametrize("width", ["median", "cross-validated"])
def test_a_map_learns_a_displacement_that_depends_on_the_place(kernel, width):
    def shift(x):
        return np.stack([2 + 0.8 * x[:, 1], -1 + 0 * x[:, 0]], axis=1)

    rbf = fit_map(sentences(shift, 6), MapSettings(width, kernel))
    new = np.random.default_rng(5).normal(size=(300, 2)) * 0.7
    error = np.sqrt(np.square(rbf(torch.from_numpy(new)).numpy() - shift(new)).mean())
    mean_only = np.sqrt(np.square(shift(new) - shift(new).mean(axis=0)).mean())
    assert error < (0.5 if width == "cross-validated" else 0.9) * mean_only


def test_the_papers_width_leaves_unseen_places_almost_unchanged():
    rbf = fit_map(sentences(lambda x: 3 + 0 * x), MapSettings("closest", "exponential"))
    new = torch.from_numpy(np.random.default_rng(6).normal(size=(200, 2)))
    assert rbf(new).abs().mean() < 0.5


def test_mapping_beats_doing_nothing_on_sentences_left_out(model, takes, corpus):
    trial = MapTrial(takes, corpus.layout, learner(corpus.layout, variance=0.98), centres=40)
    score = trial.score("neutral", "happy", folds=2)
    assert score.sentences >= 4
    assert score.mapped["exponential cross-validated"] < 0.6 * score.unchanged
    assert score.mapped["exponential cross-validated"] < 1.5 * score.mean_difference
    assert score.mapped[score.best] == min(score.mapped.values())
    assert set(trial.learning_curve("neutral", "happy", MapSettings(centres=40), counts=(1, 2, 99))) == {1, 2}


def test_any_motion_can_be_mapped_with_intensity(model, corpus):
    utterance = in_emotion(corpus, "neutral")
    happy = model.map_emotion(utterance.motion, "neutral", "happy")
    half = model.map_emotion(utterance.motion, "neutral", "happy", intensity=0.5)
    none = model.map_emotion(utterance.motion, "neutral", "happy", intensity=0.0)
    corner = corpus.layout.names.index("corner_l")
    lift = (happy.points - utterance.motion.points)[:, corner, 1].mean()
    assert lift > 2
    assert (half.points - utterance.motion.points)[:, corner, 1].mean() == pytest.approx(lift / 2, rel=0.05)
    np.testing.assert_allclose(none.frames, utterance.motion.frames, atol=1e-4)
    assert model.map_emotion(utterance.motion, "happy", "happy") is utterance.motion


def test_lips_still_close_after_mapping(model, corpus):
    utterance = in_emotion(corpus, "neutral")
    gap, mapped = (lip_gap(m) for m in (utterance.motion, model.map_emotion(utterance.motion, "neutral", "happy")))
    shut = gap < np.percentile(gap, 5)
    assert np.abs(mapped - gap)[shut].max() < 0.3


def test_lips_that_were_shut_are_brought_together_and_open_ones_are_left():
    layout = tiny_layout()
    before = np.tile(np.array(layout.neutral), (40, 1))
    upper, lower = layout.lip_pairs[0]
    before[20:, 3 * lower + 1] -= 12
    changed = before.copy()
    changed[:, 3 * lower + 1] -= 2
    kept = keep_shut(changed, before, layout, fps=60)
    gaps = [f[:, 3 * upper + 1] - f[:, 3 * lower + 1] for f in (before, changed, kept)]
    np.testing.assert_allclose(gaps[2][:20], gaps[0][:20])
    np.testing.assert_allclose(kept[20:], changed[20:])


def test_lips_rest_apart_where_an_emotion_has_them_apart_but_closures_stay():
    layout, fps = tiny_layout(), 60
    lower = layout.lip_pairs[0][1]
    openings = np.repeat([0, 12, 0, 12, 0], [60, 30, 6, 30, 60])  # a rest, a vowel, a p, a vowel, a rest
    before = np.tile(np.array(layout.neutral), (len(openings), 1))
    before[:, 3 * lower + 1] -= openings
    opened, shifted = before.copy(), before.copy()
    opened[:, 3 * lower + 1] -= 9
    shifted[:, 3 * lower + 1] -= 1
    widening = [(keep_shut(frames, before, layout, fps) - before)[:, 3 * lower + 1] for frames in (opened, shifted)]
    assert np.abs(widening[0][[10, 177]] + 9).max() < 1e-9  # teeth bared in pauses
    assert np.abs(widening[0][92:94] + 9 / 2).max() < 1e-9  # both lips are where half of it is, together
    assert np.abs(widening[0][[56, 128]] + 9 / 2).max() < 1e-9  # so near to a vowel it may be a p
    assert np.abs(widening[1][[10, 93, 177]] + 1 / 2).max() < 1e-9  # lips that are hardly apart are shut


def test_an_emotion_of_lower_intensity_is_nearer_to_neutral(model, corpus):
    utterance = in_emotion(corpus, "happy")
    corner = corpus.layout.names.index("corner_l")
    heights = []
    for intensity in (0.0, 0.5, 1.0):
        track = EmotionTrack.constant("happy", utterance.speech.duration_s, intensity)
        motion = model.synthesize(dataclasses.replace(utterance.speech, emotions=track))
        heights.append(motion.points[:, corner, 1].mean())
    assert heights[0] < heights[1] - 0.5 < heights[2] - 1


def test_synthesis_can_be_mapped_to_another_emotion(model, corpus):
    utterance = in_emotion(corpus, "neutral")
    corner = corpus.layout.names.index("corner_l")
    plain, happy = (model.synthesize(utterance.speech, to_emotion=e) for e in (None, "happy"))
    assert (happy.points - plain.points)[:, corner, 1].mean() > 2


def test_phones_that_an_emotion_lacks_are_mapped_from_another(model):
    only_neutral = dataclasses.replace(model.graph, emotions=np.zeros_like(model.graph.emotions))
    chooser = Chooser(only_neutral, model.chooser.maps)
    candidates = chooser.candidates(int(only_neutral.phones[0]), model.emotions.index("happy"))
    assert candidates.emotion_level == "mapped"
    assert (candidates.maps == model.maps.find(0, model.emotions.index("happy"))).all()
    node = int(candidates.nodes[0])
    assert np.abs(chooser.motion(node, int(candidates.maps[0])) - only_neutral.motion(node)).max() > 0.3


def test_maps_survive_saving(model, corpus, tmp_path):
    model.save(tmp_path / "m.safetensors")
    again = AnimeGraph.load(tmp_path / "m.safetensors")
    motion = in_emotion(corpus, "angry").motion
    a, b = (m.map_emotion(motion, "angry", "sad").frames for m in (model, again))
    np.testing.assert_array_equal(a, b)


def test_too_few_parallel_sentences_say_how_many_are_needed(model, corpus):
    motion = in_emotion(corpus, "neutral").motion
    with pytest.raises(FacesynthError, match=r"neutral to sad needs at least 3 sentences recorded in both .* has 0"):
        model.map_emotion(motion, "neutral", "sad")
    with pytest.raises(FacesynthError, match="unknown emotion 'bored'"):
        model.map_emotion(motion, "neutral", "bored")


def test_one_emotion_only_and_foreign_layouts_are_refused(model, corpus):
    neutral = corpus.subset([u.id for u in corpus if u.emotion == "neutral"])
    alone = AnimeGraph().fit(neutral)
    with pytest.raises(FacesynthError, match="corpus has 0"):
        alone.map_emotion(in_emotion(corpus, "neutral").motion, "neutral", "happy")
    layout = dataclasses.replace(tiny_layout(), names=tuple(f"p{k}" for k in range(14)))
    with pytest.raises(FacesynthError, match="own layout"):
        model.map_emotion(Motion(np.zeros((5, 42)), 120, layout), "neutral", "happy")
    with pytest.raises(FacesynthError, match="width"):
        AnimeGraph(map_width="wide")


def test_unit_cube_rms_of_a_known_shift():
    layout = tiny_layout()
    frames = np.tile(np.array(layout.neutral), (7, 1))
    shifted = frames.copy()
    shifted[:, ::3] += 1.0
    extent = np.ptp(np.concatenate([frames, shifted]).reshape(-1, 3), axis=0).max()
    assert unit_cube_rms(frames, shifted, layout) == pytest.approx(np.sqrt(1 / 3) / extent)
