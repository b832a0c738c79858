"""Transcripts as people write them: each line of transcripts.txt beside the words that a person says."""

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest
from bringing import added, corpus_of, lay_down, run, spoken, talker

from facesynth.corpus.add.transcripts import is_table, read_transcripts
from facesynth.corpus.record import read_listed
from facesynth.inference.phones import PHONES
from facesynth.speech.pronunciation import pronunciations
from facesynth.speech.transcript import left_out, words_of

LINES = (Path(__file__).with_name("transcripts.txt")).read_text(encoding="utf-8").splitlines()


def test_two_hundred_lines_as_they_are_said():
    assert len(LINES) >= 200
    wrong = []
    for line in LINES:
        text, _, words = line.rpartition(" | ")
        said = " ".join(words_of(text))
        if said != words:
            wrong.append((text, words, said))
        assert all(set(phones) <= set(PHONES) for word in words_of(text) for phones in pronunciations(word))
    assert wrong == []


@pytest.mark.parametrize("mark", ["\u00ad", "\u200b", "\u200c", "\u200d", "\u2060", "\ufeff"])
def test_marks_without_width_part_no_word(mark):
    assert words_of(f"some{mark}thing good{mark}") == ("something", "good")


@pytest.mark.parametrize("mark", "\u2019\u2018\u02bc\u00b4`\u2032\uff07")
def test_every_apostrophe_is_one(mark):
    assert words_of(f"don{mark}t") == ("don't",)


def test_what_is_not_said_is_told_and_what_is_said_stays():
    assert left_out("[music] so (laughs) we (all of us) go *sighs* [MUSIC]") == ("[music]", "(laughs)", "*sighs*", "[MUSIC]")
    assert words_of("[music] so (laughs) we (all of us) go *sighs*") == ("so", "we", "all", "of", "us", "go")


def test_directions_are_told_where_words_are_placed(tmp_path, talker, voiced):
    corpus, folder = corpus_of(tmp_path), tmp_path / "session"
    sound = lay_down(folder, "a", voiced.duration_s)
    sound.write_bytes(voiced.path.read_bytes())
    text = f"[music] {voiced.text} (laughs)"
    report, account = added(corpus, folder, "--text", text)
    assert "left out of the transcript as directions: [music], (laughs)" in report["remarks"]["a"]
    assert "[music], (laughs)" in account
    code, printed, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--text", text, "--json")
    assert code == 0, said
    assert any("[music], (laughs)" in line for line in json.loads(printed)["remarks"])


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16", "utf-16-le", "utf-8-sig", "mac_roman"])
def test_transcripts_of_any_encoding(tmp_path, talker, voiced, encoding):
    """As files beside the sound and as the tables that spreadsheets write."""
    text = voiced.text.replace("boat", "bóat")
    folder = tmp_path / "session"
    sound = lay_down(folder, "a", voiced.duration_s)
    sound.write_bytes(voiced.path.read_bytes())
    sound.with_suffix(".txt").write_bytes(text.encode(encoding))
    code, printed, said = run("speak", talker, sound, "-o", tmp_path / "o.npz", "--json")
    assert code == 0, said
    guessed = encoding in ("latin-1", "utf-16-le", "mac_roman")
    assert any("a.txt is not UTF-8; it was read as" in line for line in json.loads(printed)["remarks"]) == guessed
    report, account = added(corpus_of(tmp_path), folder)
    assert report["added"] == ["a"], report
    assert ("a.txt is not UTF-8" in account) == guessed


@pytest.mark.parametrize(("encoding", "sign"), [("utf-16", "\t"), ("latin-1", ";"), ("utf-8", ",")])
def test_tables_of_transcripts_as_spreadsheets_write_them(tmp_path, encoding, sign):
    table = tmp_path / "lines.csv"
    table.write_bytes(f"id{sign}text\r\na.wav{sign}café, two\r\n".replace(", two", " two").encode(encoding))
    assert is_table(table)
    assert read_transcripts(table) == {"a": "café two"}


def test_a_guessed_encoding_is_told_wherever_words_are_given(tmp_path):
    clips = tmp_path / "clips"
    sound = lay_down(clips, "a", 3.0)
    words = tmp_path / "words.txt"
    words.write_bytes("Frédéric déjà".encode("cp1252"))
    table = tmp_path / "words.csv"
    table.write_bytes("id,text\na,Frédéric déjà\n".encode("cp1252"))
    phones = tmp_path / "a.lab"
    phones.write_text("1.5 aa\n3.0 pau\n", encoding="utf-8")
    told = "is not UTF-8; it was read as Latin-1"
    for option, given in (("--text-file", words), ("--text-file", table), ("--list", table)):
        report, _ = added(corpus_of(tmp_path), clips, "--phones", phones, option, given, "--replace")
        assert [line for line in report["guessed"] if told in line], report
        assert read_listed(tmp_path / "corpus" / "utterances.csv")["a"]["text"] == "Frédéric déjà"
        (tmp_path / "corpus").rename(tmp_path / f"{option[2:]}_{given.suffix[1:]}")
    (clips / "list.csv").write_bytes("id,text\na,Frédéric déjà\n".encode("cp1252"))
    report, _ = added(corpus_of(tmp_path), clips, "--phones", phones)
    assert [line for line in report["remarks"]["list.csv"] if told in line]
    _, facts = spoken(talker(tmp_path), sound, tmp_path, "--phones", phones, "--text-file", words)
    assert [line for line in facts["remarks"] if told in line]


@pytest.mark.parametrize(
    "junk", ["a" * 9000, "1-" * 3000, "a@" * 2000, "<" * 3000, "5'" * 2000, "http://" + "a." * 2000, "1/" * 3000]
)
def test_long_runs_of_signs_take_no_time_of_their_own(junk):
    started_s = time.process_time()
    words_of(junk)
    assert time.process_time() - started_s < 5


def test_no_row_of_signs_is_a_traceback():
    """Letters that fold to others (μ and µ, ſ and s, K) among digits, signs of money, units and marks."""
    signs = [
        *"0123456789.,:/-–'\"’″°%$€£¥₿½¾²³⁰⁹₂μµſKΩωßİıIVXivx()[]<>@#&*+=~^_ \n",
        " kg",
        "μL",
        "5 ſ",
        "zł",
        "ZŁ",
        "SEK",
        " and ",
        "st",
    ]
    rng = np.random.default_rng(3)
    assert words_of("Chapter IIII, part XXL, 5 μL")[-2:] == ("five", "microliters")
    for _ in range(400):
        for word in words_of("".join(rng.choice(signs, rng.integers(1, 25)))):
            assert re.fullmatch("[a-z']+", word)
