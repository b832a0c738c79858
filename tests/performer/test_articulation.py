import numpy as np
import pytest
from acting import BILABIAL_RICH, per_phone, phone_track

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import BILABIALS, LABIODENTALS, PHONES
from facesynth.inference.speech import PhoneTrack
from facesynth.performer.articulation import LOOSEST_MM, TIGHTEST_MM, articulate
from facesynth.performer.targets import CURVES, load_targets

FPS = 120.0


def articulated(phones, *, seed=0, loudness=None, **options):
    count = int(phones.frame_bounds(FPS)[-1])
    heard = np.ones(count) if loudness is None else loudness
    return articulate(phones, heard, FPS, rng=np.random.default_rng(seed), **options)


def curve(articulation, name):
    return articulation.curves[:, CURVES.index(name)]


def middle(track, phones, number):
    return track[round((phones.starts_s[number] + phones.ends_s[number]) / 2 * FPS)]


def mean_over_tokens(text, number, name, **timing):
    """One curve in the middle of one phone, averaged over tokens."""
    phones = phone_track(text, **timing)
    return np.mean([middle(curve(articulated(phones, seed=seed), name), phones, number) for seed in range(12)])


def test_every_phone_has_a_target_within_range():
    everything = articulated(phone_track(" ".join(phone for phone in PHONES if phone != "pau")))
    assert everything.curves.shape[1] == len(CURVES)
    assert everything.curves.min() >= 0
    assert everything.curves.max() <= 1
    assert all((target.pose >= 0).all() and (target.dominance > 0).all() for target in load_targets().values())


def test_lips_shut_at_every_bilabial_and_only_there():
    phones = phone_track(BILABIAL_RICH)
    shut = articulated(phones)
    assert all(frames.max() > 0.99 for frames in per_phone(shut.closure, phones, BILABIALS))
    assert all(frames.min() < 0.5 for frames in per_phone(shut.closure, phones, {"aa", "ae", "ay", "ao"}))
    open_words = phone_track("aa k t aa s iy n")
    assert articulated(open_words).closure[48:-48].max() < 0.3


@pytest.mark.parametrize("phone_s", [0.04, 0.07, 0.12, 0.2])
def test_closures_hold_at_any_rate_of_speech(phone_s):
    phones = phone_track("aa p aa b iy m uw p b aa", phone_s=phone_s)
    assert all(f.max() > 0.99 for f in per_phone(articulated(phones).closure, phones, BILABIALS))


def test_lips_meet_more_or_less_firmly():
    phones = phone_track("aa p aa b aa m aa p aa b aa m aa p aa")
    shut = articulated(phones)
    aims = np.array([f[len(f) // 2] for f in per_phone(shut.closed_gap_mm, phones, BILABIALS)])
    assert ((aims >= TIGHTEST_MM) & (aims <= LOOSEST_MM)).all()
    assert aims.std() > 0.05


def test_lower_lip_meets_the_teeth():
    phones = phone_track("aa f iy v aa")
    tuck = articulated(phones).tuck
    assert all(frames.max() > 0.99 for frames in per_phone(tuck, phones, LABIODENTALS))


def test_rounding_is_heard_coming():
    assert mean_over_tokens("s t uw", 2, "pucker") > mean_over_tokens("s t iy", 2, "pucker") + 0.1


def test_preparing_reaches_further_than_lingering():
    before = mean_over_tokens("aa t uw t aa", 2, "pucker")
    after = mean_over_tokens("aa t uw t aa", 4, "pucker")
    assert before > 1.15 * after


def test_fast_vowels_undershoot():
    slow = mean_over_tokens("t aa t", 2, "jaw_open", phone_s=0.15)
    fast = mean_over_tokens("t aa t", 2, "jaw_open", phone_s=0.05)
    assert fast < 0.9 * slow


def test_weak_vowels_undershoot():
    phones = phone_track("t aa t")
    count = int(phones.frame_bounds(FPS)[-1])
    loud, weak = (articulated(phones, loudness=np.full(count, level)) for level in (1.2, 0.3))
    assert middle(curve(weak, "jaw_open"), phones, 2) < 0.85 * middle(curve(loud, "jaw_open"), phones, 2)


def test_s_decides_about_the_jaw_and_h_does_not():
    assert mean_over_tokens("aa s aa", 2, "jaw_open") < 0.2
    assert mean_over_tokens("aa hh aa", 2, "jaw_open") > 0.3
    assert mean_over_tokens("iy hh iy", 2, "jaw_open") < 0.25


def test_diphthongs_glide():
    phones = phone_track("t ay t", phone_s=0.2)
    jaw = curve(articulated(phones), "jaw_open")
    start, end = round(phones.starts_s[2] * FPS), round(phones.ends_s[2] * FPS)
    assert jaw[start + 6 : start + 14].mean() > 1.2 * jaw[end - 6 : end].mean()


def test_the_mouth_shuts_in_long_silences_only():
    def closed_in(pause_s):
        phones = PhoneTrack(("pau", "aa", "pau", "aa", "pau"), np.cumsum([0.4, 0.15, pause_s, 0.15, 0.4]))
        return middle(articulated(phones).closure, phones, 2)

    assert closed_in(0.5) > 0.9
    assert closed_in(0.1) == 0


def test_effort_enlarges():
    phones = phone_track("t aa t ao s iy")
    assert np.allclose(articulated(phones, effort=0.8).curves[:, 0], 0.8 * articulated(phones).curves[:, 0])


def test_distant_phones_do_not_matter():
    one, other = (phone_track("t aa t iy " + "aa " * 12 + end) for end in ("uw", "s"))
    near = slice(0, round(1.0 * FPS))
    assert np.array_equal(articulated(one).curves[near], articulated(other).curves[near])


def test_same_seed_same_movement():
    phones = phone_track(BILABIAL_RICH)
    assert articulated(phones, seed=3).curves.tobytes() == articulated(phones, seed=3).curves.tobytes()
    assert np.abs(articulated(phones, seed=3).curves - articulated(phones, seed=4).curves).max() > 0.02


def test_an_unknown_phone_is_refused():
    with pytest.raises(FacesynthError, match="unknown phone 'xx'"):
        articulated(PhoneTrack(("pau", "xx"), np.array([0.2, 0.4])))
    with pytest.raises(FacesynthError, match="needs frames"):
        articulate(phone_track("aa"), np.zeros(0), FPS, rng=np.random.default_rng(0))
