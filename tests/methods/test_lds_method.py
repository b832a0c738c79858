import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from corpora import tiny_corpus, tiny_layout

from facesynth.config import load_config
from facesynth.corpus import Corpus, Record
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import bilabial_spans, lip_gap
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.lds.innovations import Innovations
from facesynth.methods.lds.learned_input import learned_input
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.noise_amounts import noise_amounts, noise_gains
from facesynth.methods.lds.plots import plot_innovations, plot_orders
from facesynth.methods.lds.prediction import innovations, one_step
from facesynth.methods.lds.recordings import Piece
from facesynth.methods.lds.rollout import Rollout
from facesynth.methods.lds.selection import folds, plainest_good
from facesynth.methods.lds.system import Clip
from facesynth.methods.registry import load
from facesynth.speech.periodogram import Periodogram

QUICK = {
    "hears": "periodogram",
    "features": 4,
    "components": 4,
    "rows": 6,
    "lead_ms": 0,
    "deterministic_order": 2,
    "stochastic_order": 2,
}


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("lds") / "tiny", utterances=8, fps=60)


@pytest.fixture(scope="module")
def model(corpus):
    return LDS(**QUICK).fit(corpus)


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """Curves that follow the loudness of their sound through a first-order system, with noise: 12 clips of 4 s."""
    rng = np.random.default_rng(0)
    layout = Layout("curves", ("jaw", "smile", "brow"))
    path = tmp_path_factory.mktemp("driven") / "corpus"
    corpus = Corpus.create(path, performer="Driven", layout=layout, fps=30, emotions=("neutral",), synthetic=True)
    for i in range(12):
        loudness = np.repeat(rng.uniform(0.0, 1.0, 40), 3)
        audio = rng.normal(size=120 * 533) * 0.1 * np.repeat(loudness, 533)
        jaw = np.convolve(loudness, 0.6 * 0.4 ** np.arange(10))[:120]
        frames = 0.1 + np.outer(jaw, [0.6, 0.2, 0]) + 0.01 * rng.laplace(size=(120, 3))
        corpus.add_utterance(Record(f"c{i:02d}", sentence=f"c{i:02d}"), said(audio, 533 * 30), Motion(frames, 30, layout))
    return corpus


def said(audio, rate):
    seconds = len(audio) / rate
    track = EmotionTrack.constant("neutral", seconds)
    return Speech(audio.astype(np.float32), rate, PhoneTrack(("pau",), np.array([seconds])), track)


def test_the_default_choices_beat_the_mean_pose(driven):
    train, test = driven.subset(driven.ids[:9]), driven.subset(driven.ids[9:])
    model = LDS(hears="periodogram", features=2, components=2).fit(train)
    mean = np.concatenate([utterance.motion.frames for utterance in train]).mean(axis=0)
    for utterance in test:
        truth = utterance.motion.frames
        drawn = model.synthesize(utterance.speech, noise=0).frames
        assert ((drawn - truth) ** 2).mean() < 0.4 * ((mean - truth) ** 2).mean()


def test_one_step_prediction_beats_no_change(driven):
    facts = LDS(hears="periodogram", features=2, components=2, lead_ms=0).fit(driven).facts
    assert min(facts["stochastic_order"]["errors"]) < facts["no_change_error"]


def test_length_rate_and_layout_are_those_learned(corpus, model):
    for utterance in list(corpus)[:3]:
        motion = model.synthesize(utterance.speech)
        assert len(motion) == utterance.speech.phones.frame_bounds(60)[-1]
        assert (motion.fps, motion.layout) == (60, tiny_layout())
        assert np.isfinite(motion.frames).all()


def test_same_seed_same_motion_and_no_noise_no_seed(corpus, model):
    speech = corpus[corpus.ids[0]].speech
    one, same, other = (model.synthesize(speech, seed=seed).frames for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.allclose(one, other)
    assert np.array_equal(model.synthesize(speech, seed=1, noise=0).frames, model.synthesize(speech, seed=2, noise=0).frames)


def test_noise_moves_samples_away_from_the_deterministic_part_in_proportion(corpus, model):
    speech = corpus[corpus.ids[0]].speech
    plain, half, full = (model.synthesize(speech, seed=1, noise=noise).frames for noise in (0, 0.5, 1))
    np.testing.assert_allclose(half - plain, (full - plain) / 2, atol=1e-3)


def test_a_sample_is_nearer_than_the_mean_pose(driven):
    train, test = driven.subset(driven.ids[:9]), driven.subset(driven.ids[9:])
    model = LDS(hears="periodogram", features=8, components=2).fit(train)
    mean = np.concatenate([utterance.motion.frames for utterance in train]).mean(axis=0)
    for utterance in test:
        truth = utterance.motion.frames
        drawn = model.synthesize(utterance.speech, seed=5).frames
        assert ((drawn - truth) ** 2).mean() < ((mean - truth) ** 2).mean()


def test_lips_are_shut_without_noise_where_they_were_recorded_shut(corpus, model):
    spans = [(u, a, b) for u in corpus for a, b in bilabial_spans(u.speech.phones, 60) if b - a > 3]
    assert len(spans) > 3
    for utterance, start, stop in spans:
        plain, sample = (model.synthesize(utterance.speech, seed=2, noise=noise) for noise in (0, 1))
        middle = slice(start + 1, stop - 1)
        np.testing.assert_allclose(sample.frames[middle], plain.frames[middle], atol=1e-3)
        assert lip_gap(sample)[start:stop].min() < model.facts["closed_gap"] + 0.1


def test_the_papers_noise_is_everywhere(corpus):
    paper = {"context_ms": 0, "fitted_to": "steps", "own_means": False, "noise_by_state": False, "close_lips": False}
    model = LDS(**QUICK, **paper).fit(corpus)
    speech = corpus[corpus.ids[0]].speech
    unknown = replace(speech, phones=PhoneTrack(("pau",), speech.phones.ends_s[-1:]))
    np.testing.assert_array_equal(model.synthesize(speech, seed=2).frames, model.synthesize(unknown, seed=2).frames)


def test_amounts_and_gains_of_noise_are_what_was_left():
    rng = np.random.default_rng(0)
    states = np.repeat([1, 2, 0], 4000)
    left = rng.normal(size=(12000, 2)) * np.where(states == 1, 2.0, 1.0)[:, None] * [1.0, 0.1]
    shape = np.stack([np.sqrt(1.5) * rng.normal(size=12000), rng.normal(size=12000)], axis=1)
    amounts = noise_amounts([left], [states], np.ones(2))
    assert amounts["vowel"] == pytest.approx(2 * amounts["consonant"], rel=0.05)
    assert amounts["closure"] == 0
    gains = noise_gains([shape], [left], [states], amounts)
    assert gains.tolist() == [0, 1]  # the first is left over more than explained; of the second hardly anything is


def test_the_learned_input_of_a_recording_does_not_come_from_itself():
    """Noise teaches nothing about noise: an input that had seen its own recording would follow it."""
    rng = np.random.default_rng(0)
    pieces = [
        Piece(f"s{k}", rng.normal(size=32000).astype(np.float32), 0, np.zeros((60, 2), np.float32), np.full(60, 4), [])
        for k in range(4)
    ]
    shapes = [rng.normal(size=(60, 2)) for _ in pieces]
    _, inputs = learned_input(pieces, shapes, Periodogram(30.0, context_ms=200.0), 24)
    alike = np.corrcoef(np.concatenate(inputs).T, np.concatenate(shapes).T)[:2, 2:]
    assert np.abs(np.diag(alike)).max() < 0.3


def test_a_saved_model_speaks_the_same(corpus, model, tmp_path):
    model.save(tmp_path / "model.safetensors")
    speech = corpus[corpus.ids[1]].speech
    back = load(tmp_path / "model.safetensors")
    assert isinstance(back, LDS)
    assert np.array_equal(back.synthesize(speech, seed=3).frames, model.synthesize(speech, seed=3).frames)


def test_fits_repeat(corpus, model):
    again = LDS(**QUICK).fit(corpus)
    assert json.dumps(again.facts) == json.dumps(model.facts)
    assert all(torch.equal(a, b) for a, b in zip(again.state_dict().values(), model.state_dict().values(), strict=True))


def test_frame_by_frame_is_the_whole(model):
    rng = torch.Generator().manual_seed(0)
    u, e = torch.randn(50, 4, generator=rng), torch.randn(50, 4, generator=rng)
    whole, last = model.rollout(u, e, model.rollout.rest())
    state, frames = model.rollout.rest(), []
    for one_u, one_e in zip(u, e, strict=True):
        frame, state = model.rollout(one_u[None], one_e[None], state)
        frames.append(frame)
    torch.testing.assert_close(torch.cat(frames), whole, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(state, last, atol=1e-5, rtol=1e-5)
    first, state = model.rollout(u[:20], e[:20], model.rollout.rest())
    second, _ = model.rollout(u[20:], e[20:], state)
    torch.testing.assert_close(torch.cat([first, second]), whole, atol=1e-5, rtol=1e-5)


def test_rollout_is_the_double_precision_simulation():
    from simulated_lds import random_truth

    truth = random_truth(0)
    rng = np.random.default_rng(0)
    u, e = rng.normal(size=(300, 2)), rng.normal(size=(300, 3))
    rollout = Rollout.of(truth.deterministic, truth.stochastic)
    got, _ = rollout(torch.from_numpy(u).float(), torch.from_numpy(e).float(), rollout.rest())
    np.testing.assert_allclose(got, truth.deterministic.simulate(u) + truth.stochastic.simulate(e), atol=1e-4)


def test_drawn_innovations_have_the_moments_of_the_recorded():
    rng = np.random.default_rng(0)
    mixing = rng.normal(size=(3, 3))
    e = rng.laplace(scale=np.sqrt(0.5), size=(20_000, 3)) @ mixing.T
    learned = Innovations.fit(e)
    drawn = learned(torch.from_numpy(np.random.default_rng(1).random((20_000, 3))).float()).double().numpy()
    assert learned.independent
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(e.T), atol=0.1 * np.cov(e.T).max())
    assert (learned.kurtosis > 2).all()


def test_drawn_innovations_have_no_mean():
    rng = np.random.default_rng(0)
    e = rng.exponential(size=(900, 2)) ** 2  # heavy on one side: wide bins, and a mean that is not zero
    uniform = torch.from_numpy(np.random.default_rng(1).random((200_000, 2))).float()
    drawn = Innovations.fit(e)(uniform).double().numpy()
    assert np.abs(drawn.mean(axis=0)).max() < 0.02 * e.std()


def test_silence_holds_still_and_stays_among_what_was_seen(corpus, model):
    quiet = said(np.zeros(16_000), 16_000)
    frames = model.synthesize(quiet, noise=0).frames
    seen = corpus.arrays().frames
    margin = 0.5 * np.ptp(seen, axis=0).max()
    assert np.isfinite(frames).all()
    assert (frames > seen.min(axis=0) - margin).all()
    assert (frames < seen.max(axis=0) + margin).all()
    assert np.abs(np.diff(frames[-10:], axis=0)).max() < 0.1


def test_innovations_of_the_whole_system_are_those_that_drove_it():
    from simulated_lds import random_truth

    truth = random_truth(0)
    rng = np.random.default_rng(0)
    u, e = torch.from_numpy(rng.normal(size=(200, 2))), torch.from_numpy(rng.normal(size=(200, 3)))
    rollout = Rollout.of(truth.deterministic, truth.stochastic).double()
    y, _ = rollout(u, e, rollout.rest())
    torch.testing.assert_close(innovations(rollout, u, y), e)


def test_prediction_needs_whole_frames(driven):
    model = LDS(**{**QUICK, "features": 2, "components": 2, "rows": 4}).fit(driven)
    utterance = driven["c00"]
    with pytest.raises(FacesynthError, match="without gaps"):
        one_step(model, utterance.speech, np.full_like(utterance.motion.frames, np.nan))


def test_what_was_identified_is_drawn(driven, tmp_path):
    pytest.importorskip("matplotlib")
    model = LDS(**{**QUICK, "features": 2, "components": 2, "rows": 4, "stochastic_order": "auto"}).fit(driven)
    for draw, name in ((plot_orders, "orders.png"), (plot_innovations, "innovations.png")):
        draw(model, tmp_path / name)
        assert (tmp_path / name).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert (tmp_path / name).stat().st_size > 10_000


def test_folds_keep_sentences_together():
    clips = [Clip(np.full((40, 1), float(i)), np.zeros((40, 1))) for i in range(9)]
    sentences = ["a", "a", "b", "b", "c", "c", "d", "e", "f"]
    parts = folds(clips, sentences, 5)
    assert len(parts) == 4
    for fold in parts:
        names = [{sentences[int(clip.u[0, 0])] for clip in side} for side in (fold.train, fold.test)]
        assert not names[0] & names[1]
    assert sum(len(fold.test) for fold in parts) == 9


def test_one_long_clip_is_cut_in_time():
    parts = folds([Clip(np.arange(800.0)[:, None], np.zeros((800, 1)))], ["only"], 5)
    assert sum(len(clip.u) for fold in parts for clip in fold.test) == 800


def test_the_plainest_candidate_that_is_as_good_wins():
    rng = np.random.default_rng(0)
    hard = rng.uniform(1, 10, 20)
    errors = np.array([hard + 1, hard + 0.02 * rng.normal(size=20), hard + 0.02 * rng.normal(size=20)])
    choice = plainest_good((1, 2, 3), errors)
    assert choice.chosen == 2
    assert len(choice.errors) == 3


def test_gaps_split_recordings_and_are_counted(corpus, tmp_path):
    holed = tiny_corpus(tmp_path / "holed", utterances=8, fps=60)
    raw = holed.raw_motion(holed.ids[0])
    frames = raw.frames.copy()
    frames[40:60] = np.nan
    copy = Corpus.create(tmp_path / "copy", performer="x", layout=raw.layout, fps=60, emotions=holed.emotions)
    for i, utterance in enumerate(holed):
        motion = Motion(frames if i == 0 else utterance.motion.frames, 60, raw.layout)
        copy.add_utterance(Record(utterance.id, sentence=utterance.sentence), utterance.speech, motion)
    assert LDS(**QUICK).fit(copy).facts["frames_left_out_for_gaps"] == 20


def test_thirty_frames_are_refused_with_how_many_are_needed(corpus, tmp_path):
    one = corpus[corpus.ids[0]]
    short = Corpus.create(tmp_path / "short", performer="x", layout=corpus.layout, fps=60, emotions=corpus.emotions)
    speech = said(one.speech.audio[:8_000], 16_000)
    short.add_utterance(Record("only"), speech, Motion(one.motion.frames[:30], 60, corpus.layout))
    with pytest.raises(FacesynthError, match=r"at least \d+ frames are needed"):
        LDS(hears="periodogram").fit(short)


@pytest.mark.parametrize("what", ["sound", "motion"])
def test_constant_recordings_are_refused(corpus, tmp_path, what):
    flat = Corpus.create(tmp_path / what, performer="x", layout=corpus.layout, fps=60, emotions=corpus.emotions)
    for utterance in corpus:
        speech = said(np.zeros_like(utterance.speech.audio), 16_000) if what == "sound" else utterance.speech
        frames = np.ones_like(utterance.motion.frames) if what == "motion" else utterance.motion.frames
        flat.add_utterance(Record(utterance.id, sentence=utterance.sentence), speech, Motion(frames, 60, corpus.layout))
    with pytest.raises(FacesynthError, match=f"{what} is the same in all"):
        LDS(**QUICK).fit(flat)


@pytest.mark.parametrize(
    ("config", "word"),
    [
        ({"scale": "Log"}, "log"),
        ({"rows": 0}, "rows"),
        ({"stochastic_order": 1.5}, "stochastic_order"),
        ({"lead_ms": "soon"}, "lead"),
        ({"context_ms": -40}, "context_ms"),
        ({"fitted_to": "run"}, "runs"),
    ],
)
def test_bad_settings_are_refused(config, word):
    with pytest.raises(FacesynthError, match=word):
        LDS(**config)


@pytest.mark.parametrize(("options", "word"), [({"noise": -1}, "noise"), ({"emotion": "happy"}, "emotion")])
def test_bad_options_are_refused(corpus, model, options, word):
    with pytest.raises(FacesynthError, match=word):
        model.synthesize(corpus[corpus.ids[0]].speech, **options)


def test_the_training_script_trains(corpus, tmp_path, script):
    pytest.importorskip("matplotlib")
    settings = tmp_path / "quick.yaml"
    settings.write_text("".join(f"{key}: {value}\n" for key, value in QUICK.items()))
    model = tmp_path / "model.safetensors"
    printed = script("lds.py", corpus.path, "--config", settings, "-o", model, "--plots", tmp_path / "plots")
    assert "RMS error on sentences left out" in printed
    assert sorted(path.name for path in (tmp_path / "plots").iterdir()) == ["innovations.png", "orders.png"]
    assert isinstance(load(model), LDS)


def test_the_shipped_settings_are_known():
    for name in ("lds.yaml", "lds_paper.yaml"):
        assert LDS.from_config(load_config(Path(__file__).parents[2] / "configs" / name)).config["components"] == 8
