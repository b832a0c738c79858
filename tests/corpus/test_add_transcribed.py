"""`corpus add --transcribe` through the command line: a model that understands as it is told stands in for Whisper."""

import csv
import json
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_layout

from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.inference.phones import viseme_of
from facesynth.speech import transcription
from facesynth.speech.audio import save_wav
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.textgrid import read_textgrid

RATE = 16000
FOX = "The quick brown fox jumps over the lazy dog."
HAND = "Den Finger in der Hand."
"""What `Denn finger in dare hunt`, said in English, sounds like."""
needs_network = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")
needs_languages = pytest.mark.skipif(find_spec("g2p2") is None, reason="pip install 'facesynth[languages]'")


def run(*arguments, code=0):
    done = CliRunner().invoke(corpus_group, list(map(str, arguments)))
    assert done.exit_code == code, done.output
    return done.stdout


@pytest.fixture
def session(voice, tmp_path):
    """A function from sentences by name to a folder with a sound and a motion of each; the corpus beside it is empty."""
    from facesynth.performer.voice import speak

    layout = tmp_path / "layout.json"
    layout.write_text(json.dumps(tiny_layout().to_dict()), encoding="utf-8")
    run("new", tmp_path / "corpus", "--performer", "A", "--layout", layout, "--fps", 30)

    def make(**sentences):
        for name, sentence in sentences.items():
            audio, rate = speak([sentence])[0]
            save_wav(tmp_path / "session" / f"{name}.wav", np.pad(audio, (rate // 5, rate // 5)), rate)
            count = round(30 * (len(audio) / rate + 0.4))
            still = np.tile(np.asarray(tiny_layout().neutral, np.float32), (count, 1))
            moving = np.sin(np.arange(count)[:, None] / 5).astype(np.float32)
            np.savez(tmp_path / "session" / f"{name}.npz", frames=still + moving, fps=30.0)
        return tmp_path / "session"

    return make


@pytest.fixture
def understood(monkeypatch, tmp_path):
    """A function that makes the model write these, one a sound in order; gives its folder and the languages it is asked for."""

    def make(*written):
        class Model:
            def transcribe(self, audio, *, language=None, **_):
                text, spoken = left.pop(0)
                asked.append(language)
                return [SimpleNamespace(text=text)], SimpleNamespace(language=language or spoken)

        left, asked = list(written), []
        folder = tmp_path / "whisper"
        folder.mkdir()
        (folder / "model.bin").touch()
        monkeypatch.setattr(transcription, "find_spec", lambda _: True)
        monkeypatch.setattr(transcription, "_model", lambda _: Model())
        return folder, asked

    return make


@needs_network
def test_words_that_nobody_gives_are_written_down_and_may_be_corrected(session, understood, tmp_path):
    files = session(a=FOX, b=FOX)
    (files / "b.txt").write_text(FOX, encoding="utf-8")
    whisper, asked = understood((FOX, "en"))
    report = json.loads(run("add", tmp_path / "corpus", files, "--transcriber", whisper, "--jobs", 1, "--json"))
    assert asked == [None], "only the one without words, whose language is to be found out"
    assert report["added"] == ["a", "b"]
    assert any("transcribed, en: 'The quick brown fox" in remark for remark in report["remarks"]["a"])
    assert not any("transcribed" in remark for remark in report["remarks"].get("b", ()))

    corpus = Corpus.open(tmp_path / "corpus")
    table = (tmp_path / "corpus" / "utterances.csv").read_text(encoding="utf-8")
    assert [row["text"] for row in csv.DictReader(table.splitlines())] == [FOX, FOX]
    (placed, words), (given, _) = (read_textgrid(corpus.files.phones(name)) for name in "ab")
    assert [word for word, _, _ in words][:3] == ["the", "quick", "brown"]
    assert placed.labels == given.labels, "as if the words had been given"

    assert "already there 2" in run("add", tmp_path / "corpus", files, "--jobs", 1, "--transcriber", whisper)
    run("add", tmp_path / "corpus", files / "a.wav", files / "a.npz", "--text", "A quick brown fox jumps over the lazy dog.")
    corrected, words = read_textgrid(Corpus.open(tmp_path / "corpus").files.phones("a"))
    assert Corpus.open(tmp_path / "corpus").record("a").text.startswith("A quick")
    assert words[0][0] == "a"
    assert corrected.labels != placed.labels


@needs_network
@needs_languages
def test_the_language_is_detected_or_as_it_is_said(session, understood, tmp_path):
    files = session(a="Denn finger in dare hunt.", b="Denn finger in dare hunt.")
    whisper, asked = understood((HAND, "de"), (HAND, "nn"))
    one = [tmp_path / "corpus", files / "a.wav", files / "a.npz", "--transcriber", whisper]
    assert "transcribed, de" in run("add", *one)
    another = [tmp_path / "corpus", files / "b.wav", files / "b.npz", "--transcriber", whisper, "--language", "de"]
    assert "transcribed, de" in run("add", *another)
    assert asked == [None, "de"]
    corpus = Corpus.open(tmp_path / "corpus")
    assert {record.text for record in corpus.records} == {HAND}
    assert len({read_textgrid(corpus.files.phones(name))[0].labels for name in "ab"}) == 1


@needs_network
@pytest.mark.parametrize(
    ("written", "language", "told"),
    [("My favourite colours are green and blue today.", "en", "is not used"), ("", "en", "nothing was understood")],
)
def test_what_lies_apart_from_the_phones_is_refused_and_not_written(session, understood, tmp_path, written, language, told):
    files = session(a=FOX)
    whisper, _ = understood((written, language))
    out = run("add", tmp_path / "corpus", files, "--jobs", 1, "--transcriber", whisper)
    assert told in out
    corpus = Corpus.open(tmp_path / "corpus")
    assert corpus.record("a").text == ""
    heard, words = read_textgrid(corpus.files.phones("a"))
    assert not words
    lips = [viseme_of(phone) for phone in heard.labels]
    assert viseme_of(pronounce("fox")[0]) in lips, "the phones of the sound are there all the same"


@needs_network
def test_recordings_that_are_there_without_words_are_transcribed_once(session, understood, tmp_path):
    files = session(a=FOX)
    run("add", tmp_path / "corpus", files)
    assert Corpus.open(tmp_path / "corpus").record("a").text == ""
    whisper, asked = understood(("", "en"), (FOX, "en"))
    assert "nothing was understood" in run("add", tmp_path / "corpus", files, "--jobs", 1, "--transcriber", whisper)
    assert "already there 1" in run("add", tmp_path / "corpus", files, "--jobs", 1, "--transcriber", whisper)
    better = whisper.rename(tmp_path / "better")
    assert "changed 1" in run("add", tmp_path / "corpus", files, "--transcriber", better)
    assert len(asked) == 2, "by each model once"
    assert Corpus.open(tmp_path / "corpus").record("a").text == FOX


def test_without_a_model_nothing_is_added_and_the_line_says_what_to_fetch(session, monkeypatch, tmp_path):
    files = session(a="Hello.")
    monkeypatch.setattr(transcription, "find_spec", lambda _: True)
    monkeypatch.setattr(transcription, "fetched_folder", lambda: tmp_path / "nowhere")
    done = CliRunner().invoke(corpus_group, ["add", str(tmp_path / "corpus"), str(files), "--transcribe"])
    assert "facesynth fetch whisper" in str(done.exception)
    assert not Corpus.open(tmp_path / "corpus").ids
