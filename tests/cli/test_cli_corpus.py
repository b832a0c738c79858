import json

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from corpora import tiny_corpus, tiny_layout, tiny_utterances

from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


def run(*arguments, code=0):
    result = CliRunner().invoke(corpus_group, list(map(str, arguments)), catch_exceptions=True)
    if isinstance(result.exception, FacesynthError):
        raise result.exception
    assert result.exit_code == code, result.output
    return result.stdout


@pytest.fixture
def layout_file(tmp_path):
    path = tmp_path / "layout.yaml"
    path.write_text(yaml.safe_dump(tiny_layout().to_dict()), encoding="utf-8")
    return path


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "session"
    for record, speech, motion in tiny_utterances(3):
        save_wav(folder / f"{record.id}.wav", speech.audio, speech.sample_rate)
        np.savez(folder / f"{record.id}.npz", frames=motion.frames, head=motion.head, fps=120.0)
        write_textgrid(folder / f"{record.id}.TextGrid", speech.phones)
    return folder


def test_from_nothing_to_statistics(tmp_path, layout_file, session):
    folder = tmp_path / "Meine Aufnahmen"
    about = ["--performer", "Åsa", "--layout", layout_file, "--fps", 120]
    assert "is a corpus of Åsa" in run(
        "new", folder, *about, "--emotions", "neutral, happy", "--licence", "CC0", "--consent", "yes"
    )
    assert Corpus.open(folder).emotions == ("neutral", "happy")
    report = json.loads(run("add", folder, session, "--emotion", "happy", "--json"))
    assert (len(report["added"]), report["refused"]) == (3, {})
    assert "already there 3" in run("add", folder, session)
    found = json.loads(run("check", folder, "--json"))["problems"]
    assert {row["grave"] for row in found} == {False}
    assert any("too few for efase" in row["what"] for row in found), "three clips are not much to learn from"
    assert json.loads(run("stats", folder, "--json"))["emotions"] == {"neutral": 0, "happy": 3}
    assert "3 usable of 3" in run("stats", folder)
    assert "kept 3" in run("align", folder)


def test_one_recording_with_everything_said(tmp_path, layout_file, session):
    run("new", tmp_path / "c", "--performer", "A", "--layout", layout_file, "--fps", 60)
    name = tiny_utterances(1)[0][0].id
    words = tmp_path / "words.txt"
    words.write_text("Hello,\nyou  there", encoding="utf-8")
    options = ["--text-file", words, "--take", 2, "--sentence", "s1", "--licence", "CC BY", "--consent", "ja", "--id", "a1"]
    files = [session / f"{name}.wav", session / f"{name}.npz"]
    out = run("add", tmp_path / "c", *files, "--phones", session / f"{name}.TextGrid", *options, "--intensity", 0.5)
    assert "resampled from 120 to 60 fps" in out
    record = Corpus.open(tmp_path / "c").record("a1")
    assert (record.text, record.take, record.sentence) == ("Hello, you there", 2, "s1")
    assert (record.licence, record.consent, record.intensity) == ("CC BY", "ja", 0.5)


def test_a_list_tells_recordings_apart(tmp_path, layout_file, session):
    run("new", tmp_path / "c", "--performer", "A", "--layout", layout_file, "--fps", 120)
    table = tmp_path / "list.csv"
    table.write_text("id,emotion,take\ns00_happy_t1,happy,1\ns00_neutral_t2,neutral,2\n", encoding="utf-8")
    run("add", tmp_path / "c", session, "--list", table, "--emotion", "sad")
    records = {record.id: (record.emotion, record.take) for record in Corpus.open(tmp_path / "c").records}
    assert records == {"s00_happy_t1": ("happy", 1), "s00_neutral_t2": ("neutral", 2), "s00_neutral_t1": ("sad", 1)}


def test_a_new_corpus_has_the_emotions_of_its_list(tmp_path, session, layout_file):
    table = tmp_path / "list.csv"
    table.write_text("id,emotion\ns00_happy_t1,ecstatic\ns00_neutral_t2,bored\n", encoding="utf-8")
    run("add", tmp_path / "c", session, "--layout", layout_file, "--list", table)
    corpus = Corpus.open(tmp_path / "c")
    assert corpus.emotions == ("neutral", "happy", "angry", "sad", "ecstatic", "bored")
    assert {record.emotion for record in corpus.records} == {"ecstatic", "bored", "neutral"}


def test_a_remark_about_many_recordings_is_made_once(tmp_path, layout_file, session):
    run("new", tmp_path / "c", "--performer", "A", "--layout", layout_file, "--fps", 60)
    out = run("add", tmp_path / "c", session)
    assert out.count("resampled from 120 to 60 fps") == 1
    assert "3 recordings (s00_happy_t1, s00_neutral_t1, s00_neutral_t2): resampled" in out


def test_a_layout_may_come_from_another_corpus(tmp_path):
    corpus = tiny_corpus(tmp_path / "tiny", 1)
    run("new", tmp_path / "c", "--performer", "A", "--layout", corpus.files.header, "--fps", 30)
    assert Corpus.open(tmp_path / "c").layout == corpus.layout


def test_grave_problems_leave_with_code_2(tmp_path):
    corpus = tiny_corpus(tmp_path / "tiny", 4)
    notes = run("check", corpus.path)
    assert "0 problems" in notes
    assert "too few for efase" in notes
    corpus.files.audio(corpus.ids[0]).unlink()
    assert "1 problems" in run("check", corpus.path, code=2)


@pytest.mark.parametrize(
    "content", ["a: [", "- 1", "kind: markers", "kind: markers\nnames: 3", "kind: marker\nnames: [a]", "x: 1", ""]
)
def test_what_is_no_layout_is_one_clear_error(tmp_path, content):
    (tmp_path / "layout.yaml").write_text(content, encoding="utf-8")
    with pytest.raises(FacesynthError):
        run("new", tmp_path / "c", "--performer", "A", "--layout", tmp_path / "layout.yaml", "--fps", 30)
    assert not (tmp_path / "c").exists()


def test_nothing_added_is_an_error(tmp_path, layout_file, session):
    run("new", tmp_path / "c", "--performer", "A", "--layout", layout_file, "--fps", 120)
    for path in session.glob("*.npz"):
        path.write_bytes(b"damaged")
    with pytest.raises(FacesynthError, match="no recording was added"):
        run("add", tmp_path / "c", session)
    with pytest.raises(FacesynthError, match="is no corpus"):
        run("stats", tmp_path / "nowhere")


def test_help_says_what_options_mean():
    for command in ("new", "add", "align", "check", "stats"):
        assert "--json" in run(command, "--help")
