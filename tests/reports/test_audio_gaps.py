"""Sound whose packets jump: lost ones, overlaps, a start beside that of the pictures. Heard and seen closures stay together."""

import bringing
import numpy as np
import pytest
from closing_clips import Clip, at_30_fps, clicks_of, heard_s, largest_error_s, write

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import load_audio, read_sound
from facesynth.speech.containers import laid
from facesynth.speech.interleaving import Chunks, gaps_between

CLOSE_S = 0.02
GAP = Clip((0.35, 1.6, 2.1), 2.6, at_30_fps(2.6), moved=((0.5, 0.8),))


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "mov", "ts", "webm"])
def test_a_gap_of_lost_packets_is_silence_and_told(tmp_path, suffix):
    path = write(tmp_path / f"a.{suffix}", GAP)
    assert largest_error_s(path, GAP) < CLOSE_S
    np.testing.assert_allclose(heard_s(path), GAP.closures_s, atol=0.004)
    (remark,) = read_sound(path).remarks
    assert remark.startswith("gaps in the sound: 1, 0.80 s in all, the first at 0.5")
    audio, rate = load_audio(path)
    assert np.abs(audio[round(0.6 * rate) : round(1.25 * rate)]).max() < 1e-3


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "mov", "ts"])
def test_two_gaps_and_one_between_every_packet(tmp_path, suffix):
    clip = Clip((0.3, 1.3, 2.4), 2.8, at_30_fps(2.8), moved=((0.5, 0.3), (1.2, 0.4)))
    assert largest_error_s(write(tmp_path / f"a.{suffix}", clip), clip) < CLOSE_S
    drops = Clip((0.3, 1.7), 2.0, at_30_fps(2.4), moved=tuple((0.5 + 0.05 * k, 0.022) for k in range(10)))
    assert largest_error_s(write(tmp_path / f"b.{suffix}", drops), drops) < CLOSE_S


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "mov", "ts"])
def test_overlapping_packets_keep_the_time(tmp_path, suffix):
    clip = Clip((0.4, 1.4, 1.8), 2.2, at_30_fps(2.1), overlapping=9)
    path = write(tmp_path / f"a.{suffix}", clip)
    assert largest_error_s(path, clip) < CLOSE_S
    assert any(remark.startswith("overlaps in the sound: 9, 0.10 s in all") for remark in read_sound(path).remarks)


@pytest.mark.parametrize("suffix", ["mkv", "mp4", "mov", "ts"])
@pytest.mark.parametrize("by_s", [0.5, -0.3, 0.1, -0.05])
def test_sound_that_begins_beside_the_pictures(tmp_path, suffix, by_s):
    clip = Clip((0.7, 1.2, 1.6), 2.4, at_30_fps(2.0), moved=((-1.0, by_s),))
    path = write(tmp_path / f"a.{suffix}", clip)
    assert largest_error_s(path, clip) < CLOSE_S
    said = [remark for remark in read_sound(path).remarks if "begins" in remark]
    assert bool(said) == (by_s > 0)


AVI = {
    "gap": Clip((0.35, 2.4, 3.1), 4.0, at_30_fps(4.8), moved=((0.5, 0.8),)),
    "two gaps": Clip((0.35, 2.4, 3.1), 4.0, at_30_fps(4.85), moved=((0.5, 0.3), (1.2, 0.55))),
    "late": Clip((0.85, 2.4, 3.1), 4.0, at_30_fps(4.5), moved=((-1.0, 0.5),)),
}


@pytest.mark.parametrize("pictures", ["mpeg4", "libx264"])
@pytest.mark.parametrize("sound", ["libmp3lame", "pcm_s16le", "ac3", "aac"])
@pytest.mark.parametrize("kind", sorted(AVI))
def test_sound_lost_from_an_avi_is_found_by_the_pictures_beside_it(tmp_path, kind, sound, pictures):
    path = write(tmp_path / "a.avi", AVI[kind], (pictures, sound))
    assert largest_error_s(path, AVI[kind]) < CLOSE_S
    assert any(remark.startswith("AVI states no times, and some of the sound was lost") for remark in read_sound(path).remarks)


def test_sound_that_lies_unevenly_in_an_avi_is_not_taken_for_lost():
    times_s, pictures_s = np.arange(200) * 0.024, np.arange(150) / 30
    uneven = times_s + np.where(np.arange(200) % 40 < 20, 0.0, 0.4)
    for shorter_s in (0.0, 0.4):
        places = np.searchsorted(pictures_s, uneven)
        framed = np.concatenate([[-np.inf], pictures_s, [np.inf]])
        assert len(gaps_between(Chunks(times_s, framed[places], framed[places + 1], shorter_s))) == 0
    lost = times_s + np.where(np.arange(200) < 100, 0.0, 0.4)
    places = np.searchsorted(pictures_s, lost)
    ((when_s, length_s),) = gaps_between(Chunks(times_s, framed[places], framed[places + 1], 0.4))
    assert (round(when_s, 3), round(length_s, 2)) == (2.4, 0.4)


def test_rounded_and_missing_stamps_move_nothing():
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=1024).astype(np.float32) for _ in range(200)]
    times_s = np.arange(200) * 1024 / 48000
    for stamps in (
        np.round(times_s, 3),
        times_s + rng.uniform(-0.004, 0.004, 200),
        np.where(np.arange(200) % 7, times_s, np.nan),
    ):
        audio, remarks = laid("a.mkv", np.concatenate(parts), [1024] * 200, stamps, 48000)
        assert remarks == ()
        assert np.array_equal(audio, np.concatenate(parts))
    outlier = times_s.copy()
    outlier[50] += 3
    assert len(laid("a.mkv", np.concatenate(parts), [1024] * 200, outlier, 48000)[0]) == 200 * 1024


def test_stamps_that_go_back_far_or_jump_by_hours_are_refused():
    parts = [np.ones(1024, np.float32)] * 200
    times_s = np.arange(200) * 1024 / 48000
    with pytest.raises(FacesynthError, match=r"at 2\.13 s of its sound the time stamps go back by 2\.13 s"):
        laid("a.ts", np.concatenate(parts), [1024] * 200, np.where(np.arange(200) < 100, times_s, times_s - times_s[100]), 48000)
    with pytest.raises(FacesynthError, match="jump by hours"):
        laid("a.ts", np.concatenate(parts), [1024] * 200, np.where(np.arange(200) < 100, times_s, times_s + 1e6), 48000)


@pytest.mark.parametrize("suffix", ["mkv", "mp4"])
def test_corpus_and_speak_say_so(tmp_path, talker, suffix):
    path = write(tmp_path / f"take.{suffix}", GAP)
    corpus = bringing.corpus_of(tmp_path)
    np.savez(tmp_path / "take.npz", frames=np.full((round(3.4 * bringing.FPS), 4), 0.2, np.float32), fps=float(bringing.FPS))
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n3.4 pau\n", encoding="utf-8")
    report, account = bringing.added(corpus, path, tmp_path / "take.npz", tmp_path / "take.lab")
    assert report["added"] == ["take"], report
    assert "gaps in the sound: 1, 0.80 s in all" in report["remarks"]["take"][0]
    assert "gaps in the sound: 1, 0.80 s in all" in account
    np.testing.assert_allclose(clicks_of(*load_audio(Corpus.open(corpus).files.audio("take"))), GAP.closures_s, atol=0.004)
    assert not [problem for problem in bringing.checked(corpus) if problem["file"] == "audio/take.wav"]
    _, facts = bringing.spoken(talker, path, tmp_path, "--phones", tmp_path / "take.lab")
    assert any("gaps in the sound: 1, 0.80 s in all" in remark for remark in facts["remarks"])
