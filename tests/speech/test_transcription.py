"""What Whisper wrote is used where it fits what is heard; a model of its interface stands in for one that must be fetched."""

from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import facesynth
from facesynth.cli.speak import speak
from facesynth.inference.errors import FacesynthError
from facesynth.speech import transcription
from facesynth.speech.audio import save_wav
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.phone_sources import find_phones
from facesynth.speech.transcription import Transcript, transcribe
from facesynth.stage.request import Part
from facesynth.zoo.shelf import DEFAULT

FOX = "The quick brown fox jumps over the lazy dog."
needs_network = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")
needs_package = pytest.mark.skipif(find_spec("faster_whisper") is None, reason="pip install 'facesynth[transcribe]'")


@pytest.fixture
def writes(monkeypatch, tmp_path):
    """A function that makes the model write a text in a language; gives the folder of the model."""

    def make(text, language):
        class Model:
            def transcribe(self, audio, *, language=None, **_):
                assert audio.dtype == np.float32
                parts = (SimpleNamespace(text=f" {part}") for part in text.split("|"))
                return parts, SimpleNamespace(language=language or spoken)

        spoken = language
        monkeypatch.setattr(transcription, "_model", lambda _: Model())
        return tmp_path

    return make


def test_parts_are_one_text_and_a_language_that_is_given_is_handed_on(writes):
    audio = np.zeros(44100, np.float32)
    assert transcribe(audio, 44100, writes("Guten|Morgen.", "de")) == Transcript("Guten Morgen.", "de")
    assert transcribe(audio, 44100, writes("Goede|morgen.", "de"), "nl").language == "nl"


@needs_network
def test_a_transcription_that_fits_is_used_and_told(say, writes):
    audio, rate = say(FOX)
    found = find_phones(audio, rate, transcriber=writes(FOX, "en"))
    assert (found.source, found.text) == ("transcription", FOX)
    assert [word for word, _, _ in found.words][:3] == ["the", "quick", "brown"]
    assert "transcribed, en: 'The quick brown fox" in found.remarks[0]


@needs_network
@pytest.mark.parametrize(
    ("text", "language", "reason"),
    [
        ("My favourite colours are green and blue today.", "en", "is not used"),
        ("", "en", "nothing was understood"),
        ("Der Hund bellt laut und die Katze schläft.", "de", "is not used"),
        ("hallo", "xx", "is not used"),
    ],
)
def test_what_does_not_fit_the_sound_is_refused_and_the_phones_are_heard(say, writes, text, language, reason):
    audio, rate = say(FOX)
    found = find_phones(audio, rate, transcriber=writes(text, language))
    assert (found.source, found.text) == ("recognition", "")
    assert reason in found.remarks[0]


@needs_network
def test_what_was_transcribed_is_written_out_and_a_corrected_text_stays(say, writes, tmp_path):
    save_wav(tmp_path / "a.wav", *say(FOX))
    asked = {"transcriber": writes(FOX, "en"), "head": Part("off"), "eyes": Part("off")}
    spoken = facesynth.speak(DEFAULT, tmp_path / "a.wav", tmp_path / "out.npz", **asked)
    assert {path.name for path in spoken.written} == {"out.npz", "out.TextGrid", "out.txt"}
    assert (tmp_path / "out.txt").read_text(encoding="utf-8") == FOX
    assert any("transcribed, en" in remark for remark in spoken.remarks)
    (tmp_path / "out.txt").write_text("The quick brown fox jumped over the lazy dog.", encoding="utf-8")
    again = facesynth.speak(DEFAULT, tmp_path / "a.wav", tmp_path / "out.npz", **asked)
    assert tmp_path / "out.txt" not in again.written
    assert "jumped" in (tmp_path / "out.txt").read_text(encoding="utf-8")
    assert any("out.txt was there and differs" in remark for remark in again.remarks)


def test_words_that_are_given_are_not_transcribed(say, tmp_path):
    audio, rate = say(FOX)
    assert find_phones(audio, rate, text=FOX, transcriber=tmp_path).source == "transcript"


def test_a_missing_package_and_a_missing_model_are_one_line(monkeypatch, tmp_path):
    if find_spec("faster_whisper") is not None:
        with pytest.raises(FacesynthError, match="facesynth fetch whisper"):
            transcribe(np.zeros(16000, np.float32), 16000, tmp_path / "nowhere")
    monkeypatch.setattr(transcription, "find_spec", lambda _: None)
    with pytest.raises(FacesynthError, match=r"pip install 'facesynth\[transcribe\]'"):
        transcribe(np.zeros(16000, np.float32), 16000, tmp_path / "nothing")


@needs_package
def test_a_damaged_model_is_one_line(tmp_path):
    (tmp_path / "model.bin").write_bytes(b"no model")
    with pytest.raises(FacesynthError, match="cannot be used"):
        transcribe(np.zeros(16000, np.float32), 16000, tmp_path)


@needs_package
def test_the_command_line_asks_for_the_model_before_it_hears_anything(tmp_path):
    asked = [str(tmp_path / "model"), str(tmp_path / "a.wav"), "-o", "a.csv", "--transcriber", str(tmp_path)]
    done = CliRunner().invoke(speak, asked)
    assert "holds no model that transcribes" in str(done.exception)
