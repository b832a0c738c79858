import numpy as np
import pytest
from corpora import label_lines
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.phone_sources import find_phones
from facesynth.speech.segments import covering, in_one, phone_track, within
from facesynth.speech.textgrid import read_labelled, read_textgrid, write_textgrid

TRACK = PhoneTrack(("pau", "hh", "ah", "l", "ow", "pau"), np.array([0.1, 0.2, 1 / 3, 0.4, 0.55, 0.9]))
WORDS = (("hello", 0.1, 0.55),)


def test_textgrid_round_trip_in_a_path_with_spaces_and_umlauts(tmp_path):
    path = tmp_path / "Größe zwei" / "süß – 音.TextGrid"
    write_textgrid(path, TRACK, WORDS)
    phones, words = read_textgrid(path)
    assert phones.labels == TRACK.labels
    np.testing.assert_allclose(phones.ends_s, TRACK.ends_s, atol=1e-6)
    assert words[0][0] == "hello"
    np.testing.assert_allclose(words[0][1:], WORDS[0][1:], atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PHONES), st.floats(1e-3, 2)), min_size=1, max_size=40))
def test_any_track_round_trips(tmp_path_factory, phones):
    labels, lengths = zip(*(p for i, p in enumerate(phones) if not (i and p[0] == phones[i - 1][0] == "pau")), strict=True)
    track = PhoneTrack(labels, np.cumsum(lengths))
    folder = tmp_path_factory.mktemp("grid")
    write_textgrid(folder / "a.TextGrid", track)
    (folder / "a.lab").write_text(label_lines(track))
    for got in (read_textgrid(folder / "a.TextGrid")[0], read_labelled(folder / "a.lab").phones):
        assert got.labels == track.labels
        np.testing.assert_allclose(got.ends_s, track.ends_s, atol=1e-6)


UNSURE = PhoneTrack(TRACK.labels, TRACK.ends_s, np.array([1.0, 0.25, 0.5, 0.75, 0.33, 1.0]))


def test_confidences_come_back_with_the_phones_that_are_given(tmp_path):
    path, sound = tmp_path / "a.TextGrid", np.full(14400, 0.1, np.float32)
    write_textgrid(path, UNSURE, WORDS)
    found = find_phones(sound, 16000, given=path)
    assert found.phones.confidences.tolist() == UNSURE.confidences.tolist()
    assert found.remarks == ()
    write_textgrid(path, TRACK)
    assert find_phones(sound, 16000, given=path).phones.confidences is None


@pytest.mark.parametrize("duration_s", [0.5, 0.85, 1.0])
def test_confidences_stay_with_their_phones_when_the_sound_has_another_length(tmp_path, duration_s):
    write_textgrid(tmp_path / "a.TextGrid", UNSURE)
    got = covering(read_textgrid(tmp_path / "a.TextGrid")[0], duration_s)
    assert got.duration_s == duration_s
    assert got.confidences.tolist() == UNSURE.confidences.tolist()[: len(got)]


def test_who_moves_a_boundary_vouches_for_the_phones_beside_it(tmp_path):
    intervals = [("B", 0, 0.2), ("AH", 0.2, 0.5), ("M", 0.5, 0.8), ("AH", 0.8, 1)]
    sure = [("0.2", 0, 0.2), ("0.3", 0.2, 0.55), ("0.4", 0.55, 0.8), ("0.5", 0.8, 1)]
    path = tmp_path / "a.TextGrid"
    path.write_text(grid_text({"Mary - phones": intervals, "Mary - confidence": sure}))
    assert read_textgrid(path)[0].confidences.tolist() == [0.2, 1.0, 1.0, 0.5]


@pytest.mark.parametrize("said", ["sehr sicher", "95", "nan", "-0.1"])
def test_a_tier_that_holds_no_confidences_is_told_and_left(tmp_path, said):
    path = tmp_path / "a.TextGrid"
    path.write_text(grid_text({"phones": [("B", 0, 1)], "confidence": [(said, 0, 1)]}), encoding="utf-8")
    found = read_labelled(path)
    assert found.phones.confidences is None
    assert said in found.remarks[0]
    path.write_text(grid_text({"phones": [("B", 0, 1)], "confidence": [("", 0, 1)]}))
    assert read_labelled(path).phones.confidences is None


def test_words_with_quotes_and_accents(tmp_path):
    words = (('say "ah"', 0.1, 0.2), ("naïve", 0.2, 0.5))
    write_textgrid(tmp_path / "a.TextGrid", TRACK, words)
    assert [word for word, *_ in read_textgrid(tmp_path / "a.TextGrid")[1]] == ['say "ah"', "naïve"]


def grid_text(tiers, end=1.0):
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", f"0\n{end}\n<exists>\n{len(tiers)}"]
    for name, entries in tiers.items():
        lines.append(f'"IntervalTier"\n"{name}"\n0\n{end}\n{len(entries)}')
        lines += [f'{start}\n{stop}\n"{label}"' for label, start, stop in entries]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_another_aligners_tiers_with_gaps(tmp_path, encoding):
    tiers = {"Mary - words": [("sp", 0, 0.2), ("hi", 0.2, 0.6)], "Mary - phones": [("HH", 0.2, 0.4), ("AY1", 0.4, 0.6)]}
    (tmp_path / "a.TextGrid").write_text(grid_text(tiers), encoding=encoding)
    phones, words = read_textgrid(tmp_path / "a.TextGrid")
    assert phones.labels == ("pau", "hh", "ay", "pau")
    np.testing.assert_allclose(phones.ends_s, [0.2, 0.4, 0.6, 1.0])
    assert words == (("hi", 0.2, 0.6),)


def test_textgrids_that_cannot_be_used(tmp_path):
    path = tmp_path / "a.TextGrid"
    with pytest.raises(FacesynthError, match="no such TextGrid"):
        read_textgrid(path)
    for text in ("hello\n", "", grid_text({"phones": [("AH", 0, 1)]})[:60]):
        path.write_text(text)
        with pytest.raises(FacesynthError, match=r"not a TextGrid|no tier"):
            read_textgrid(path)
    path.write_bytes(np.random.default_rng(1).bytes(500))
    with pytest.raises(FacesynthError, match=r"not a TextGrid|no tier"):
        read_textgrid(path)
    path.write_text(grid_text({"tones": [("H", 0, 1)]}))
    with pytest.raises(FacesynthError, match=r"no tier.*tones"):
        read_textgrid(path)
    path.write_text(grid_text({"phones": [("blah", 0, 1)]}))
    with pytest.raises(FacesynthError, match=r"a.TextGrid: unknown phone 'blah'"):
        read_textgrid(path)


def test_label_lines_of_both_kinds(tmp_path):
    (tmp_path / "a.lab").write_text("# Deng's form\n0.25 sil\n\n0.5 B\r\n1.0 AA1\n")
    track = read_labelled(tmp_path / "a.lab").phones
    assert track.labels == ("pau", "b", "aa")
    np.testing.assert_allclose(track.ends_s, [0.25, 0.5, 1.0])
    (tmp_path / "b.lab").write_text("0.1 0.3 b\n0.5 0.6 aa\n")
    track = read_labelled(tmp_path / "b.lab").phones
    assert track.labels == ("pau", "b", "pau", "aa")
    np.testing.assert_allclose(track.ends_s, [0.1, 0.3, 0.5, 0.6])


@pytest.mark.parametrize("text", ["0.5 b\n0.4 aa\n", "0.5 b\nx aa\n", "0.5\n", "1 2 3 b\n", "0.5 b\nnan aa\n"])
def test_bad_label_lines_are_named(tmp_path, text):
    (tmp_path / "a.lab").write_text(text)
    with pytest.raises(FacesynthError, match=r"line \d"):
        read_labelled(tmp_path / "a.lab")


def test_label_files_that_are_none(tmp_path):
    with pytest.raises(FacesynthError, match="no such file"):
        read_labelled(tmp_path / "a.lab")
    (tmp_path / "a.lab").write_text("")
    with pytest.raises(FacesynthError, match="not one phone"):
        read_labelled(tmp_path / "a.lab")
    (tmp_path / "a.lab").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(FacesynthError, match="UTF-8"):
        read_labelled(tmp_path / "a.lab")


def test_closures_join_their_release():
    track = phone_track(
        [("bcl", 0, 0.1), ("b", 0.1, 0.2), ("tcl", 0.2, 0.3), ("ch", 0.3, 0.4), ("kcl", 0.4, 0.5), ("ae", 0.5, 0.6)]
    )
    assert track.labels == ("b", "ch", "k", "ae")
    assert track.ends_s.tolist() == [0.2, 0.4, 0.5, 0.6]


def test_covering_cuts_or_completes():
    assert covering(TRACK, 2.0).duration_s == 2.0
    assert covering(TRACK, 2.0).labels == TRACK.labels
    assert covering(TRACK, 0.3).labels == ("pau", "hh", "ah")
    assert covering(TRACK, 0.3).duration_s == 0.3
    spoken = PhoneTrack(("aa",), np.array([0.5]))
    assert covering(spoken, 0.8).labels == ("aa", "pau")
    assert covering(spoken, 0.5 + 1e-9).ends_s.tolist() == [0.5 + 1e-9]


def test_overlapping_segments_are_refused():
    with pytest.raises(FacesynthError, match="segment 2"):
        phone_track([("aa", 0, 0.5), ("b", 0.3, 0.7)])


def test_segments_beyond_the_sound_are_laid_inside():
    inside = within([("pau", -0.2, -0.1), ("b", -0.1, -0.05), ("aa", -0.05, 0.3), ("p", 0.3, 0.52), ("pau", 0.52, 0.7)], 0.5)
    assert [label for label, _, _ in inside] == ["b", "aa", "p"]
    assert inside[0][1] == 0.0
    assert inside[-1][2] == 0.5
    assert all(end_s - start_s >= 0.0049 for _, start_s, end_s in inside)


def test_pieces_do_not_push_one_another():
    first = [("aa", 0.1, 0.9), ("pau", 0.9, 1.2)]
    second = [("pau", -0.2, 0.05), ("b", 0.05, 0.1), ("pau", 0.1, 1.2)]
    track = phone_track(in_one([(0.0, 1.0, first), (1.0, 1.0, second)]), 2.0)
    assert track.labels == ("pau", "aa", "pau", "b", "pau")
    np.testing.assert_allclose(track.ends_s, [0.1, 0.9, 1.05, 1.1, 2.0])
    assert in_one([(0.0, 1.0, [])]) == []
