"""What capture makes of a real talker: the mouth follows that talker's own sound, and the built-in head follows the mouth."""

import numpy as np
import pytest
from grid import sentence

from facesynth.corpus.add.add import add
from facesynth.corpus.checks.sync import LAGS, RATE, correlations, mouth_opening
from facesynth.corpus.importers.video import corpus_from_video
from facesynth.corpus.workers import Workers
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion


def captured(folder, recordings, every=1):
    videos = sorted(recordings.glob("*.mpg"))[::every]
    made = corpus_from_video(folder / "c", videos, {"performer": recordings.name, "emotions": ["neutral"]})
    report = add(made, videos, texts={video.stem: sentence(video.stem) for video in videos}, workers=Workers(1))
    assert len(report.added) >= 0.95 * len(videos), report.refused
    return made


@pytest.fixture(scope="module")
def corpus(recordings, landmark_models, tmp_path_factory):
    return captured(tmp_path_factory.mktemp("s1"), recordings("grid_s1"), every=5)


@pytest.fixture(scope="module")
def bearded(recordings, landmark_models, tmp_path_factory):
    """A talker whose moustache hides the upper lip: its points lie 6 mm too high."""
    return captured(tmp_path_factory.mktemp("s26"), recordings("grid_s26"))


@pytest.mark.slow
def test_lips_follow_the_sound_better_than_any_of_a_thousand_shuffled_pairings(corpus):
    openings, levels = [], []
    for utterance in corpus:
        opening = mouth_opening(utterance.motion)
        if not np.isfinite(opening).all():
            continue
        speech = utterance.speech
        power = np.convolve(speech.audio.astype(float) ** 2, np.hanning(int(0.06 * speech.sample_rate)), "same")
        times_s = np.arange(int(speech.duration_s * RATE)) / RATE
        at = np.minimum((times_s * speech.sample_rate).astype(int), len(power) - 1)
        levels.append(np.log(np.sqrt(power[at]) + 1e-3))
        openings.append(np.interp(times_s * utterance.motion.fps, np.arange(len(opening)), opening))
    count = min(map(len, openings))
    mouths, sounds = (np.array([row[:count] for row in rows]) for rows in (openings, levels))
    best_ms = [1000 * LAGS[correlations(sound, mouth).argmax()] / RATE for sound, mouth in zip(sounds, mouths, strict=True)]
    assert abs(np.median(best_ms)) <= 80
    normal = [(rows - rows.mean(axis=1, keepdims=True)) / rows.std(axis=1, keepdims=True) for rows in (mouths, sounds)]
    table = normal[0] @ normal[1].T / count
    own = np.median(np.diag(table))
    rng = np.random.default_rng(0)
    shuffled = [np.median(table[np.arange(len(table)), rng.permutation(len(table))]) for _ in range(1000)]
    assert (1 + sum(value >= own for value in shuffled)) / 1001 < 0.01


@pytest.mark.slow
def test_the_built_in_head_opens_its_mouth_as_the_talker_does(corpus, rig):
    from facesynth.face.rig.markers import LipGap
    from facesynth.face.solve.animate import animate

    alike, off_mm = [], []
    for utterance in list(corpus)[:10]:
        if np.isfinite(utterance.motion.frames).all() and np.isfinite(utterance.motion.head).all():
            animation = animate(utterance.motion, rig)
            shown = LipGap.of(rig).opening_mm(animation.weights)
            alike.append(np.corrcoef(shown, lip_gap(utterance.motion)[: len(shown)])[0, 1])
            off_mm.append(animation.residual_mm.mean())
    assert np.median(alike) > 0.97
    assert np.median(off_mm) < 1.5


@pytest.mark.slow
def test_the_built_in_head_shuts_its_lips_where_the_talker_says_p_b_or_m(corpus, rig):
    from facesynth.face.rig.markers import LipGap
    from facesynth.face.solve.animate import animate

    least_mm = []
    for utterance in list(corpus)[:10]:
        phones, motion = utterance.speech.phones, utterance.motion
        if np.isfinite(motion.frames).all() and np.isfinite(motion.head).all():
            opening = LipGap.of(rig).opening_mm(animate(motion, rig, phones=phones).weights)
            ends = np.rint(phones.ends_s * motion.fps).astype(int)
            spans = zip(phones.labels, [0, *ends[:-1]], ends, strict=True)
            least_mm += [opening[start : max(end, start + 1)].min() for label, start, end in spans if label in "pbm"]
    assert len(least_mm) > 10
    assert np.mean(np.array(least_mm) < 0.3) > 0.9, "they touch, which at rest is 0.16 mm between the three places"


@pytest.mark.slow
@pytest.mark.parametrize("talker", ["corpus", "bearded"])
def test_the_built_in_head_opens_its_mouth_as_far_as_the_talker_does_and_never_crosses_its_lips(talker, rig, request):
    """The talker's opening is that of the points over the rest pose, at the head's scale: millimetres, not shape alone."""
    from facesynth.face.rig.markers import LipGap
    from facesynth.face.solve.animate import animate
    from facesynth.face.solve.fitting import fit_layout

    corpus = request.getfixturevalue(talker)
    lips, layout = LipGap.of(rig), corpus.layout
    shut_mm = lip_gap(Motion(np.array([layout.neutral], np.float32), 25.0, layout))[0]
    scale = np.linalg.norm(fit_layout(rig, layout).linear[0])
    wanted, shown, least_mm = [], [], []
    for utterance in list(corpus)[:10]:
        motion = utterance.motion
        if np.isfinite(motion.frames).all() and np.isfinite(motion.head).all():
            wanted.append(scale * np.maximum(lip_gap(motion) - shut_mm, 0))
            shown.append(lips.opening_mm(animate(motion, rig).weights))
            least_mm.append(lips.gaps_mm(animate(motion, rig, phones=utterance.speech.phones).weights).min())
    wanted_mm, shown_mm = np.concatenate(wanted), np.concatenate(shown)
    assert min(least_mm) > -0.02
    assert abs(np.mean(shown_mm - wanted_mm)) < 0.4
    assert np.sqrt(np.mean((shown_mm - wanted_mm) ** 2)) < 0.7
    wide = wanted_mm > 6
    assert abs(np.mean(shown_mm[wide] - wanted_mm[wide])) < 0.8, "wide open stays wide"
    assert np.percentile(shown_mm[wanted_mm == 0], 90) < 0.5, "shut stays shut"
