"""The network of poses: what it learns, that it looks no further than it says, that streams and folders give the same."""

import numpy as np
import pytest
import torch
from corpora import tiny_corpus, tiny_layout

import facesynth
from facesynth.export.models import export_model
from facesynth.inference.errors import FacesynthError
from facesynth.inference.expectation import EACH, rate_of
from facesynth.inference.filters import cubic_at
from facesynth.inference.lips import lip_gap
from facesynth.inference.loading import load as load_folder
from facesynth.inference.openings import Openings
from facesynth.inference.sound import resample
from facesynth.methods.learn import windows
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.point_loss import LIPS, PointLoss, lip_points
from facesynth.methods.learn.pose_network import REACH, SYMMETRIC, PoseNetwork
from facesynth.methods.learn.windows import Batch
from facesynth.methods.network.method import Network
from facesynth.methods.registry import create, load
from facesynth.speech.phone_archive import is_installed

RNG = np.random.default_rng(3)
needs_weights = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("network") / "corpus", utterances=12, fps=50).split(0)


@pytest.fixture(scope="module", autouse=True)
def _small_steps():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(windows, "BATCH", 2)
        yield


@pytest.fixture(scope="module")
def by_sound(halves):
    return Network(steps=4, features="log_mel", phones=False, look_ahead_s=0.08).fit(halves[0], seed=1)


def missed(model, corpus):
    return np.mean([np.square(model.synthesize(u.speech).frames - u.motion.frames).mean() for u in corpus])


def test_it_learns_what_recordings_show(halves):
    few = halves[0].subset(halves[0].ids[:3])
    assert missed(Network(steps=60).fit(few), few) < 0.5 * missed(create("mean_face").fit(few), few)


def test_the_same_seed_gives_the_same_network_and_torchs_own_generator_stays_as_it_was(halves):
    before = torch.random.get_rng_state()
    one, two, other = (Network(steps=3).fit(halves[0], seed=seed) for seed in (5, 5, 6))
    assert torch.equal(before, torch.random.get_rng_state())
    speech = halves[1][halves[1].ids[0]].speech
    assert np.array_equal(one.synthesize(speech).frames, two.synthesize(speech).frames)
    assert not np.array_equal(one.synthesize(speech).frames, other.synthesize(speech).frames)


def test_a_frame_depends_on_no_later_one_and_on_none_further_back_than_its_reach():
    network = PoseNetwork(3, 2).eval()
    told = torch.from_numpy(RNG.normal(size=(1, 4 * REACH, 3))).float()
    at = 2 * REACH
    changed = told.clone()
    changed[:, at] += 1
    moved = (network(changed)[0] - network(told)[0]).abs().amax(dim=(0, 2)).detach().numpy()
    assert list(np.flatnonzero(moved)) == list(range(at, at + REACH + 1))


@pytest.mark.parametrize(("look_ahead_s", "frames"), [(None, SYMMETRIC), (0.0, 0), (0.16, 4), (60.0, SYMMETRIC)])
def test_it_hears_no_further_ahead_than_it_was_told(halves, look_ahead_s, frames):
    predictor = PosePredictor(phones=False, look_ahead_s=look_ahead_s)
    predictor.fps = torch.tensor([25.0])
    assert predictor.ahead == frames


@pytest.mark.parametrize(
    ("fps", "rate"), [(25, 25), (29.97, 29.97), (60, 30), (120, 30), (100, 100 / 3), (10, 20), (44, 44), (240, 30)]
)
def test_it_works_near_thirty_frames_a_second_whatever_the_recordings_have(fps, rate):
    assert rate_of(fps) == pytest.approx(rate)


def test_between_frames_a_cubic_is_met_exactly():
    at = np.array([1.0, 1.25, 2.5, 3.9])
    frames = np.stack([0.5 * np.arange(8.0) ** 2 - np.arange(8), np.arange(8.0)], axis=1)
    np.testing.assert_allclose(cubic_at(frames, at), np.stack([0.5 * at**2 - at, at], axis=1), atol=1e-12)


def test_a_stream_gives_what_the_whole_gives_however_it_is_cut(by_sound, halves):
    speech = halves[1][halves[1].ids[0]].speech
    whole = by_sound.synthesize(speech).frames
    sound = resample(speech.audio, speech.sample_rate, 16000)
    for pieces in ([len(sound)], [1, 7, 160, 4000, 2, 9000], list(RNG.integers(1, 3000, 400))):
        stream, given, at = by_sound.stream(emotion=speech.emotions.labels[0]), [], 0
        for piece in pieces:
            given.append(stream.push(sound[at : at + piece]))
            at += piece
        given.append(stream.push(sound[at:]))
        given = np.concatenate([*given, stream.finish()])
        np.testing.assert_allclose(given[: len(whole)], whole[: len(given)], atol=1e-3)
        assert abs(len(given) - len(whole)) <= 1


def test_a_stream_is_as_late_as_it_says_and_remembers_no_more_than_it_needs(by_sound):
    stream, late_s = by_sound.stream(), by_sound.speaker().look_ahead_s
    for second in range(1, 21):
        stream.push(0.1 * RNG.standard_normal(16000).astype(np.float32))
        assert stream._given >= (second - late_s) * 50 - 1
    kept = len(stream._pieces._sound), len(stream._bands), len(stream._poses)
    assert np.all(np.array(kept) < (2000, 400, 60))


@needs_weights
@pytest.mark.parametrize("features", ["phone_net", "both"])
def test_what_hears_with_the_phone_network_streams_too_exported_as_well(halves, tmp_path, features):
    few = halves[0].subset(halves[0].ids[:4])
    model = Network(steps=2, features=features, unsaid=0.3, look_ahead_s=0.08).fit(few)
    sound = 0.1 * RNG.standard_normal(40000).astype(np.float32)

    def streamed(speaker, sizes, **options):
        stream = speaker.stream(emotion="happy", **options)
        given = [stream.push(piece) for piece in np.split(sound, np.cumsum(sizes))]
        return np.concatenate([*given, stream.finish()])

    wanted = streamed(model, [])
    assert len(wanted) == round(len(sound) / 16000 * 50)
    for sizes in ([1, 7, 160, 4000, 2, 9000], list(RNG.integers(1, 3000, 12))):
        np.testing.assert_allclose(streamed(model, sizes), wanted, atol=1e-3)
    assert not np.allclose(streamed(model, [], ahead_s=0.1), wanted, atol=1e-3)
    model.save(tmp_path / "m.safetensors")
    export_model(tmp_path / "m.safetensors", tmp_path / "folder")
    exported = load_folder(tmp_path / "folder")
    np.testing.assert_allclose(streamed(exported, [800] * 20), wanted, atol=2e-3 * np.abs(wanted).max())
    stream = exported.stream()
    assert stream.look_ahead_s == pytest.approx(model.speaker().late_s(0.4)) == exported.look_ahead_s
    for second in range(1, 8):
        stream.push(0.1 * RNG.standard_normal(16000).astype(np.float32))
        assert stream._given >= (second - stream.look_ahead_s) * 50 - 1


@needs_weights
def test_who_was_never_left_untold_cannot_do_without_phones(halves):
    few = halves[0].subset(halves[0].ids[:3])
    with pytest.raises(FacesynthError, match="unsaid"):
        Network(steps=1, features="phone_net").fit(few).stream()


def test_what_a_stream_cannot_know_is_refused(by_sound, halves):
    with pytest.raises(FacesynthError, match="phones=false"):
        Network(steps=1).fit(halves[0]).stream()
    with pytest.raises(FacesynthError, match="joyous"):
        by_sound.stream(emotion="joyous")
    with pytest.raises(FacesynthError, match="44100"):
        by_sound.stream(sample_rate=44100)
    stream = by_sound.stream()
    assert len(stream.finish()) == 0
    with pytest.raises(FacesynthError, match="finished"):
        stream.push(np.zeros(10, np.float32))


def test_sound_alone_means_that_phones_change_nothing(by_sound, halves):
    from dataclasses import replace

    speech = halves[1][halves[1].ids[0]].speech
    mute = replace(speech, phones=replace(speech.phones, labels=("pau",) * len(speech.phones)))
    assert np.array_equal(by_sound.synthesize(speech).frames, by_sound.synthesize(mute).frames)


def test_saved_and_exported_it_speaks_the_same_in_under_three_megabytes(by_sound, halves, tmp_path):
    speech = halves[1][halves[1].ids[0]].speech
    wanted = by_sound.synthesize(speech).frames
    by_sound.save(tmp_path / "network.safetensors")
    assert (tmp_path / "network.safetensors").stat().st_size < 3e6
    assert np.array_equal(load(tmp_path / "network.safetensors").synthesize(speech).frames, wanted)
    export_model(tmp_path / "network.safetensors", tmp_path / "folder")
    exported = load_folder(tmp_path / "folder")
    np.testing.assert_allclose(exported.synthesize(speech).frames, wanted, atol=1e-4 * np.abs(wanted).max())
    stream = exported.stream(emotion=speech.emotions.labels[0])
    frames = np.concatenate([stream.push(resample(speech.audio, speech.sample_rate, 16000)), stream.finish()])
    np.testing.assert_allclose(frames[: len(wanted)], wanted[: len(frames)], atol=1e-4 * np.abs(wanted).max())


def test_told_of_both_the_regression_hears_the_phone_network_and_the_network_does_not(halves, tmp_path):
    few = halves[0].subset(halves[0].ids[:4])
    model = Network(steps=2, features="both").fit(few)
    predictor, speech = model.predictor, halves[1][halves[1].ids[0]].speech
    reading = predictor.reading
    told = torch.from_numpy(RNG.normal(size=(60, reading.width)).astype(np.float32))
    changed = told.clone()
    changed[:, : EACH * 208].view(60, EACH, 208)[:, :, 64:] += 1
    assert torch.equal(predictor.network(told[None])[0], predictor.network(changed[None])[0])
    assert not torch.allclose(predictor(told), predictor(changed))
    model.save(tmp_path / "both.safetensors")
    assert (tmp_path / "both.safetensors").stat().st_size < 3e6
    wanted = load(tmp_path / "both.safetensors").synthesize(speech).frames
    assert np.array_equal(wanted, model.synthesize(speech).frames)
    export_model(tmp_path / "both.safetensors", tmp_path / "folder")
    exported = load_folder(tmp_path / "folder").synthesize(speech).frames
    np.testing.assert_allclose(exported, wanted, atol=2e-3 * np.abs(wanted).max())


def test_phones_alone_stand_beside_the_network_in_its_folder_and_count_their_share(halves, tmp_path):
    few, speech = halves[0].subset(halves[0].ids[:6]), halves[1][halves[1].ids[0]].speech
    made = {"network": Network(steps=2).fit(few), "coarticulation": create("coarticulation").fit(few)}
    for name, model in made.items():
        model.save(tmp_path / name)
    heard, said = (model.synthesize(speech).frames for model in made.values())
    for share in (0.0, 0.25, 1.0):
        export_model(tmp_path / "network", tmp_path / "folder", beside=(tmp_path / "coarticulation", share))
        mean = load_folder(tmp_path / "folder").synthesize(speech).frames
        np.testing.assert_allclose(mean, heard + share * (said - heard), atol=1e-4 * np.abs(heard).max())


def test_what_cannot_stand_beside_a_network_is_told(halves, tmp_path):
    few = halves[0].subset(halves[0].ids[:4])
    Network(steps=1).fit(few).save(tmp_path / "network")
    create("mean_face").fit(few).save(tmp_path / "mean")
    other = tiny_corpus(tmp_path / "other", utterances=4, fps=25)
    create("coarticulation").fit(other).save(tmp_path / "slower")
    with pytest.raises(FacesynthError, match="got mean_face beside network, wanted coarticulation"):
        export_model(tmp_path / "network", tmp_path / "folder", beside=(tmp_path / "mean", 0.5))
    with pytest.raises(FacesynthError, match="at another rate"):
        export_model(tmp_path / "network", tmp_path / "folder", beside=(tmp_path / "slower", 0.5))
    with pytest.raises(FacesynthError, match="wanted 0 to 1"):
        export_model(tmp_path / "network", tmp_path / "folder", beside=(tmp_path / "slower", 1.5))
    assert not (tmp_path / "folder").exists()


def test_small_openings_become_wider_where_that_is_asked_and_a_folder_does_it_as_well(halves, tmp_path):
    few, speech = halves[0].subset(halves[0].ids[:6]), halves[1][halves[1].ids[0]].speech
    plain, evened = (Network(steps=2, opening_power=power).fit(few) for power in (1.0, 0.5))
    before, after = (model.synthesize(speech) for model in (plain, evened))
    rule = Openings(0.5, evened.facts["closed_gap"], evened.facts["wide_gap"])
    np.testing.assert_allclose(lip_gap(after), rule.changed(lip_gap(before)), atol=1e-3)
    assert plain.speaker().openings is None
    evened.save(tmp_path / "evened")
    export_model(tmp_path / "evened", tmp_path / "folder")
    again = load_folder(tmp_path / "folder").synthesize(speech).frames
    np.testing.assert_allclose(again, after.frames, atol=1e-3 * np.abs(after.frames).max())
    with pytest.raises(FacesynthError, match="opening_power is 0"):
        Network(opening_power=0)


def test_lips_count_four_times_and_missing_frames_not_at_all():
    layout = tiny_layout()
    points, lips = len(layout.names), lip_points(layout)
    loss = PointLoss(layout, torch.eye(layout.channels), 1e-6)
    there, none = torch.zeros(1, 4, layout.channels), torch.zeros(1, 4, layout.channels)
    other = next(p for p in range(points) if p not in lips)

    def of(point, present):
        made = there.clone()
        made[:, :, point * layout.dimension] = 1.0  # held: no velocity
        batch = Batch(torch.zeros(1, 4, 1), there, present)
        return float(loss(made, none, batch) - 0.5 * float((made**2 * present[..., None]).mean(dim=-1).sum() / present.sum()))

    whole = torch.ones(1, 4)
    assert of(lips[0], whole) / of(other, whole) == pytest.approx(LIPS, rel=1e-3)
    gap = torch.tensor([[1.0, 0.0, 1.0, 1.0]])
    assert of(lips[0], gap) == pytest.approx(of(lips[0], whole), rel=1e-4)


def test_the_deviations_say_how_sure_a_pose_is(halves):
    predictor = PosePredictor()
    predictor.learn(halves[0], torch.nn.Identity(), seed=0, steps=20)
    reading = predictor.reading
    told = torch.randn(1, 200, reading.width, generator=torch.Generator().manual_seed(0))
    deviations = predictor.network(told)[1].exp()
    assert 0 < deviations.mean() < 1


def test_the_script_that_shows_the_loop_learns_what_fit_learns(halves, tmp_path, script):
    corpus = halves[0].path
    said = script("network.py", corpus, "-o", tmp_path / "shown.safetensors", "--steps", "2")
    recorded, held_out = facesynth.Corpus.open(corpus).split(0)
    fitted, shown = Network(steps=2).fit(recorded), load(tmp_path / "shown.safetensors")
    speech = held_out[held_out.ids[0]].speech
    np.testing.assert_allclose(shown.synthesize(speech).frames, fitted.synthesize(speech).frames, atol=1e-5)
    assert "held out: lips" in said
    assert f"{fitted.predictor.linear.share:.0%} of the pose is its" in said
    torch.testing.assert_close(shown.predictor.linear.weight, fitted.predictor.linear.weight)
