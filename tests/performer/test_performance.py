import numpy as np
import pytest
from acting import BILABIAL_RICH, act, hum, per_phone, speech_of

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, OPEN_VOWELS
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.articulation import LOOSEST_MM
from facesynth.performer.cues import listen
from facesynth.performer.prosody import EMOTIONS

TALK = "dh ah s ih ng er s t aa r t ih d t uw l ae f ae n d w iy ao l hh er d ih t s uw n ae f t er w er d z"


def weight(performance, name):
    return performance.weights[:, ARKIT_NAMES.index(name)]


@pytest.mark.parametrize("emotion", EMOTIONS)
def test_lips_close_on_every_p_b_m(lips, emotion):
    for seed in range(3):
        speech = speech_of(BILABIAL_RICH, emotion)
        gaps = lips.opening_mm(act(speech, lips, seed).weights)
        assert max(frames.min() for frames in per_phone(gaps, speech.phones, BILABIALS)) <= LOOSEST_MM + 0.01


@pytest.mark.parametrize("emotion", EMOTIONS)
def test_open_vowels_are_open(lips, emotion):
    speech = speech_of(BILABIAL_RICH, emotion)
    gaps = lips.opening_mm(act(speech, lips).weights)
    assert min(frames.max() for frames in per_phone(gaps, speech.phones, OPEN_VOWELS)) > 1.5


@pytest.mark.parametrize("emotion", EMOTIONS)
def test_lips_do_not_pass_through_each_other(lips, emotion):
    weights = act(speech_of(BILABIAL_RICH, emotion), lips).weights
    assert weights.min() >= 0
    assert weights.max() <= 1
    assert lips.gaps_mm(weights)[:, 2:5].min() > -1.6


def test_each_emotion_shows(lips):
    means = {e: dict(zip(ARKIT_NAMES, act(speech_of(TALK, e), lips).weights.mean(axis=0), strict=True)) for e in EMOTIONS}
    signs = {
        "happy": lambda mean: mean["mouthSmileLeft"],
        "angry": lambda mean: mean["browDownRight"] - mean["browInnerUp"],  # sad brows are drawn together too, but raised
        "sad": lambda mean: mean["browInnerUp"],
    }
    for emotion, sign in signs.items():
        assert sign(means[emotion]) > 0.3 + max(sign(means[other]) for other in EMOTIONS if other != emotion)


def test_an_emotion_grows_and_wavers(lips):
    brows = weight(act(speech_of(TALK, "angry"), lips), "browDownLeft")
    assert brows[:5].mean() < 0.9 * brows[60:].max()
    assert np.ptp(brows[60:]) > 0.1


def test_takes_of_an_emotion_differ(lips):
    smiles = [weight(act(speech_of(TALK, "happy"), lips, seed), "mouthSmileLeft").mean() for seed in range(6)]
    tilted = [
        (weight(p, "mouthSmileLeft") - weight(p, "mouthSmileRight")).mean()
        for p in (act(speech_of(TALK, "happy"), lips, seed) for seed in range(6))
    ]
    assert np.std(smiles) > 0.02
    assert np.std(tilted) > 0.02


def test_rounded_lips_smile_less(lips):
    def smile(vowel):
        speech = speech_of(f"t {vowel} t", "happy", phone_s=0.25)
        return np.mean(
            [per_phone(weight(act(speech, lips, s), "mouthSmileRight"), speech.phones, {vowel})[0][15] for s in range(4)]
        )

    assert smile("uw") < 0.75 * smile("aa")


def test_emotions_change_within_an_utterance(lips):
    calm = speech_of(TALK)
    half = calm.duration_s / 2
    emotions = EmotionTrack(("happy", "angry"), np.array([half, calm.duration_s]), np.ones(2))
    performance = act(Speech(calm.audio, calm.sample_rate, calm.phones, emotions), lips)
    middle, edge = round(half * 120), 40
    anger, cheeks = weight(performance, "browDownLeft"), weight(performance, "cheekSquintLeft")
    assert anger[: middle - edge].max() < 0.1
    assert anger[middle + edge :].mean() > 0.4
    assert cheeks[edge : middle - edge].mean() > 2 * cheeks[middle + edge :].mean()


def test_intensity_scales_the_emotion(lips):
    calm = speech_of(TALK)
    emotions = EmotionTrack.constant("sad", calm.duration_s, 0.4)
    mild = act(Speech(calm.audio, calm.sample_rate, calm.phones, emotions), lips)
    full = act(speech_of(TALK, "sad"), lips)
    assert weight(mild, "mouthFrownLeft").mean() == pytest.approx(0.4 * weight(full, "mouthFrownLeft").mean(), rel=0.1)


def test_eyes_blink_and_keep_to_the_listener(lips):
    performance = act(speech_of(TALK + " " + TALK), lips)
    opening, gaze_left = performance.eyes[:, 0], performance.eyes[:, 1]
    assert opening.min() < 0.1
    assert np.median(opening) > 0.8
    assert np.corrcoef(gaze_left, performance.head[:, 1])[0, 1] < -0.2


def test_the_head_moves_like_a_head(lips):
    head = np.stack([act(speech_of(TALK), lips, seed).head for seed in range(8)])
    assert 0.3 < np.degrees(head[..., :3].std(axis=1).mean()) < 4
    assert np.abs(head[..., 3:]).max() < 20
    assert np.abs(np.diff(head[..., :3], axis=1)).max() * 120 < np.radians(120)


def test_a_sad_head_hangs(lips):
    down = {
        emotion: np.mean([act(speech_of(TALK, emotion), lips, s).head[:, 0].mean() for s in range(4)]) for emotion in EMOTIONS
    }
    assert down["sad"] > down["neutral"] + np.radians(3) > down["happy"] + np.radians(3)


def test_accents_are_found_where_voice_is_loud_and_high():
    speech = speech_of("t aa t iy t aa t iy", phone_s=0.15)
    high = np.full(int(speech.duration_s / 0.005), 110.0)
    high[round(1.0 / 0.005) : round(1.2 / 0.005)] = 190.0
    audio = speech.audio.copy()
    audio[: round(0.9 * 16000)] *= 0.3
    cues = listen(Speech(audio, 16000, speech.phones, speech.emotions), high, round(speech.duration_s * 120), 120.0)
    assert cues.accents.argmax() / 120 == pytest.approx(1.08, abs=0.2)


def test_frames_match_the_phones(lips):
    speech = speech_of(TALK)
    for fps in (29.97, 120.0):
        assert len(act(speech, lips, fps=fps)) == round(speech.duration_s * fps)


def test_same_seed_same_performance(lips):
    one, same, other = (act(speech_of(TALK, "happy"), lips, seed) for seed in (1, 1, 2))
    assert one.weights.tobytes() == same.weights.tobytes()
    assert one.head.tobytes() == same.head.tobytes()
    assert np.abs(one.weights - other.weights).max() > 0.05


def test_an_unknown_emotion_is_refused(lips):
    with pytest.raises(FacesynthError, match="unknown emotion"):
        act(speech_of("aa", "hapy"), lips)


def test_pitch_may_be_missing(lips):
    from facesynth.performer.performance import perform

    speech = speech_of(TALK)
    silent = perform(speech, lips, pitch_hz=np.zeros_like(hum(speech)), fps=120.0, seed=0)
    assert np.isfinite(silent.weights).all()
