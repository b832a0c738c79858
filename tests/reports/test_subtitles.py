"""Transcripts that are subtitles, or that name who speaks: neither times nor names are said."""

import bringing
import pytest

from facesynth.speech.transcript import left_out, words_of

SRT = """1
00:00:00,200 --> 00:00:01,000
The boat moved

2
00:00:01,000 --> 00:00:02,500 X1:40 X2:600
<i>up and</i> {\\an8}down.
"""
VTT = """WEBVTT - a title

NOTE made by hand
at home

STYLE
::cue { color: red }

intro
00:00.200 --> 00:01.000 align:start
<v Roger>The boat <00:00:00.500>moved

00:01.000 --> 00:02.500
up and down.
"""
WORDS = ["the", "boat", "moved", "up", "and", "down"]


@pytest.mark.parametrize("text", [SRT, VTT, SRT.replace("\n", "\r\n"), "\ufeff" + SRT, SRT.replace("00:00:0", "0:00:0")])
def test_times_numbers_and_marks_of_subtitles_are_not_said(text):
    assert list(words_of(text)) == WORDS
    assert left_out(text)[0] == "times of 2 subtitles"


@pytest.mark.parametrize(
    "text",
    [
        "SPEAKER 1: The boat moved\nSPEAKER 2: up and down.",
        "Speaker_00: The boat moved up\nspeaker A: and down.",
        "JOHN: The boat moved\nMRS. O'NEIL: up and down.",
        ">> The boat moved\n>> INTERVIEWER: up and down.",
        "- Narrator: The boat\n- Guest: moved up and down.",
        "SPEAKER 1: THE BOAT MOVED UP AND DOWN.",
    ],
)
def test_who_speaks_is_not_said(text):
    assert list(words_of(text)) == WORDS


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Remember: the boat moved.", "remember the boat moved"),
        ("At 10:30 the boat moved.", "at ten thirty the boat moved"),
        ("The result: 3 to 1.", "the result three to one"),
        ("WARNING: KEEP OUT", "warning keep out"),
        ("The speaker moved.", "the speaker moved"),
        ("Speaker: the boat", "the boat"),
        ("1\n2\n3", "one two three"),
        ("He said --> go", "he said go"),
    ],
)
def test_what_only_looks_like_it_is_said(text, words):
    assert " ".join(words_of(text)) == words


@pytest.mark.parametrize("suffix", ["srt", "vtt"])
def test_speak_tells_what_it_left_out(tmp_path, talker, voiced, suffix):
    path = tmp_path / f"a.{suffix}"
    path.write_text({"srt": SRT, "vtt": VTT}[suffix], encoding="utf-8")
    _, facts = bringing.spoken(talker, voiced.path, tmp_path, "--text-file", path)
    assert any("left out of the transcript" in remark and "times of 2 subtitles" in remark for remark in facts["remarks"])
    said = (tmp_path / "out.TextGrid").read_text(encoding="utf-8")
    assert [word for word in WORDS if f'"{word}"' not in said] == []
