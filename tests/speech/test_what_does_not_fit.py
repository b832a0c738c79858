"""Texts and weights that do not go with the sound or with facesynth, through the command line: one line each, nothing written."""

import sys
from importlib.util import find_spec

import pytest

from facesynth.cli import main
from facesynth.speech import phone_archive
from facesynth.speech.audio import load_audio, save_wav
from facesynth.zoo.shelf import DEFAULT

needs_network = pytest.mark.skipif(not phone_archive.is_installed(), reason="the weights that phones are heard with are missing")
needs_languages = pytest.mark.skipif(find_spec("g2p2") is None, reason="pip install 'facesynth[languages]'")
GERMAN = "Der Hund bellt laut und die Katze schläft heute im Garten."
ENGLISH = "She had your dark suit in greasy wash water all year."


@pytest.fixture
def refused(tmp_path, monkeypatch, capsys):
    """The one line that `facesynth speak` answers a sound with."""

    def line(audio, rate, *arguments):
        sound, out = tmp_path / "Ton ä.wav", tmp_path / "out.csv"
        save_wav(sound, audio, rate)
        monkeypatch.setattr(sys, "argv", ["facesynth", "speak", DEFAULT, str(sound), "-o", str(out), *arguments])
        with pytest.raises(SystemExit) as left:
            main()
        lines = capsys.readouterr().err.strip().splitlines()
        assert left.value.code == 2
        assert len(lines) == 1
        assert lines[0].startswith("error: ")
        assert list(tmp_path.iterdir()) == [sound]
        return lines[0]

    return line


@needs_network
@needs_languages
@pytest.mark.parametrize("language", [["--language", "de"], []])
def test_a_german_text_beside_an_english_sound(say, refused, language):
    line = refused(*say("The quick brown fox jumps over the lazy dog."), "--text", GERMAN, *language)
    assert "does not match the sound" in line
    assert "correct the transcript or its language" in line


@needs_network
def test_an_english_text_beside_mandarin(recordings, refused):
    audio, rate = load_audio(sorted(recordings("facegood").glob("*.wav"))[0])
    line = refused(audio[: 5 * rate], rate, "--text", ENGLISH)
    assert "does not match the sound" in line


@needs_network
@needs_languages
def test_a_language_that_no_package_covers(say, refused):
    line = refused(*say("Hello, Tom."), "--text", "nuqneH", "--language", "tlh")
    assert "'tlh' cannot be pronounced here" in line
    assert "leave the text out to have the phones heard" in line


@needs_network
def test_weights_that_were_changed(say, refused, monkeypatch, tmp_path_factory):
    content = bytearray(phone_archive._installed_file(phone_archive.WEIGHTS).read_bytes())
    content[len(content) // 2] ^= 1
    changed = tmp_path_factory.mktemp("changed") / phone_archive.WEIGHTS
    changed.write_bytes(content)
    monkeypatch.setattr(phone_archive, "_installed_file", lambda name: changed)
    from facesynth.speech.phone_graph import phone_hearing

    phone_hearing.cache_clear()
    try:
        line = refused(*say("Hello, Tom."))
    finally:
        phone_hearing.cache_clear()
    assert "sha256 differs" in line
    assert f"install {phone_archive.DISTRIBUTION}" in line
