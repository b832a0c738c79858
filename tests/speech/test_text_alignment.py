"""Known words placed by what the phone network hears: exactly in made-up probabilities, and in a voice."""

from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE, VISEME_CLASSES, viseme_of
from facesynth.inference.spikes import LAG_S
from facesynth.speech.alignment import align
from facesynth.speech.ctc_alignment import NOTHING, align_phones, fit_of
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.phone_sources import find_phones
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.segments import segments_of
from facesynth.speech.text_alignment import align_words, belongs, doubtful, heard_classes, told
from facesynth.speech.transcript import words_of

FOX = "The quick brown fox jumps over the lazy dog."
needs_network = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")
needs_languages = pytest.mark.skipif(find_spec("g2p2") is None, reason="pip install 'facesynth[languages]'")


def spiking(phones, frames, count):
    """[count, 15] classes: each phone told in its frame, blanks elsewhere."""
    said = np.full((count, len(VISEME_CLASSES)), 1e-4, np.float32)
    said[:, NOTHING] = 0.9
    for phone, frame in zip(phones, frames, strict=True):
        said[frame] = 1e-4
        said[frame, viseme_of(phone)] = 0.9
    return np.log(said / said.sum(axis=1, keepdims=True))


def words(text):
    return [(word, pronounce(word)) for word in words_of(text)]


@settings(deadline=None, max_examples=50)
@given(st.lists(st.sampled_from(["m", "aa", "f", "s", "r", "k"]), min_size=1, max_size=12), st.randoms(use_true_random=False))
def test_phones_are_placed_where_their_classes_are_told(phones, random):
    frames = np.cumsum([random.randint(2, 9) for _ in phones])
    distinct = [
        phone for phone, before in zip(phones, ["", *phones], strict=False) if viseme_of(phone) != viseme_of(before or "pau")
    ]
    found = align_phones(spiking(distinct, frames[: len(distinct)], frames[-1] + 5), [distinct])
    assert [spike.phone for spike in found] == distinct
    assert np.allclose([spike.first_s + LAG_S for spike in found], frames[: len(distinct)] / 50)
    assert all(after.first_s > before.first_s for before, after in pairwise(found))


@pytest.mark.parametrize("seed", range(5))
def test_the_best_path_is_the_one_that_torchaudio_finds(seed):
    torch = pytest.importorskip("torch")
    from torchaudio.functional import forced_align

    rng = np.random.default_rng(seed)
    classes = np.log(rng.dirichlet(np.ones(len(VISEME_CLASSES)) / 3, 40)).clip(-30).astype(np.float32)
    phones = ["m", "aa", "f", "m", "s", "r", "k", "aa"][: 3 + seed]
    wanted = torch.tensor([[viseme_of(phone) for phone in phones]], dtype=torch.int32)
    path = forced_align(torch.from_numpy(classes)[None], wanted, blank=NOTHING)[0][0].numpy()
    starts = np.flatnonzero((path != NOTHING) & (np.diff(path, prepend=NOTHING) != 0))
    found = align_phones(classes, [phones])
    assert np.allclose([spike.first_s + LAG_S for spike in found], starts / 50)


def test_neighbours_of_one_class_share_a_place_and_each_word_begins_once():
    found = align_phones(spiking(["aa", "n", "m"], [3, 9, 15], 20), [("aa", "n"), ("d", "m")])
    assert [(spike.phone, spike.begins_word) for spike in found] == [("aa", True), ("n", False), ("d", True), ("m", False)]
    assert found[1].first_s < found[2].first_s < found[3].first_s


def test_more_phones_than_frames_have_no_place():
    assert align_phones(spiking(["aa"], [1], 4), [("aa", "m", "f")]) is None


def test_what_is_not_told_fits_badly():
    classes = spiking(["m", "aa", "f"], [4, 10, 16], 24)
    right, wrong = (align_phones(classes, [phones]) for phones in (("m", "aa", "f"), ("s", "r", "k")))
    assert fit_of(right) > -0.2 > -5 > fit_of(wrong)


@needs_network
def test_words_are_placed_near_where_the_aligner_of_english_places_them(say):
    audio, rate = say(FOX)
    network, english = align_words(audio, rate, words(FOX)), align(audio, rate, FOX)
    assert [word for word, _, _ in network.words] == [word for word, _, _ in english.words]
    assert np.abs(np.subtract([span[1:] for span in network.words], [span[1:] for span in english.words])).max() < 0.1
    assert network.doubtful == ()
    pauses = [(start_s, end_s) for label, start_s, end_s in segments_of(network.phones) if label == SILENCE]
    assert not any(first_s < start_s and end_s < last_s for start_s, end_s in pauses for _, first_s, last_s in network.words)
    assert network.phones.duration_s == len(audio) / rate


@needs_network
def test_another_text_is_refused_and_a_wrong_word_named(say):
    audio, rate = say(FOX)
    classes = heard_classes(audio, rate)
    other = words("my favourite colours are green and blue today")
    assert belongs(classes, told(classes, [phones for _, phones in words(FOX)]))
    with pytest.raises(FacesynthError, match="does not match the sound"):
        align_words(audio, rate, other)
    wrong = words(FOX.replace("brown", "elephant"))
    assert [wrong[number][0] for number in doubtful(told(classes, [phones for _, phones in wrong]), wrong)] == ["elephant"]


@needs_network
def test_a_wrong_word_is_told_beside_the_alignment(say):
    audio, rate = say(FOX)
    found = find_phones(audio, rate, text=FOX.replace("lazy", "purple"))
    assert any("do not fit what is heard: 'purple'" in remark for remark in found.remarks)
    assert not any("do not fit" in remark for remark in find_phones(audio, rate, text=FOX).remarks)


@needs_network
def test_where_the_aligner_of_english_fails_the_network_places_the_words(say, monkeypatch):
    def fails(*_):
        raise FacesynthError("the transcript does not match the sound")

    audio, rate = say(FOX)
    monkeypatch.setattr("facesynth.speech.phone_sources.align", fails)
    found = find_phones(audio, rate, text=FOX)
    assert "could not follow" in found.remarks[0]
    with pytest.raises(FacesynthError, match="does not match"):
        find_phones(audio, rate, text="my favourite colours are green and blue today")


@needs_network
def test_a_long_sound_is_placed_piece_by_piece_as_the_whole_would_be(say, monkeypatch):
    audio, rate = say(FOX)
    other = say("She had your dark suit in greasy wash water all year.")[0]
    text = f"{FOX} She had your dark suit in greasy wash water all year. "
    classes = heard_classes(np.concatenate([audio, other] * 2), rate)
    phones = [phones for _, phones in words(text * 2)]
    whole = told(classes, phones)
    monkeypatch.setattr("facesynth.speech.text_alignment.PIECE_FRAMES", 150)
    pieces = told(classes, phones)
    apart = np.abs(np.subtract([spike.first_s for spike in pieces], [spike.first_s for spike in whole]))
    assert np.median(apart) == 0
    assert apart.max() < 0.3


@needs_network
@needs_languages
def test_a_text_in_another_language_than_the_sound_is_one_line(say):
    audio, rate = say(FOX)
    with pytest.raises(FacesynthError, match="correct the transcript or its language"):
        find_phones(audio, rate, text="Der Hund bellt laut und die Katze schläft heute im Garten.")


@needs_network
def test_segments_have_the_confidences_of_their_phones(say):
    audio, rate = say(FOX)
    track = align_words(audio, rate, words(FOX)).phones
    assert len(track.confidences) == len(segments_of(track))
    assert 0 < track.confidences.min() <= track.confidences.max() <= 1
