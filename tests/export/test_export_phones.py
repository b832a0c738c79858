import numpy as np
import pytest
from click.testing import CliRunner

from facesynth.cli.export import export
from facesynth.inference import FacesynthError, load
from facesynth.inference.__main__ import main
from facesynth.speech.audio import save_wav
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.textgrid import read_labelled

pytestmark = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "phones"
    done = CliRunner().invoke(export, ["phones", "-o", str(path)])
    assert done.exit_code == 0, done.output
    return path


def test_the_runtime_prints_lines_of_phones(folder, talk, tmp_path, capsys):
    save_wav(tmp_path / "a.wav", *talk)
    main([str(folder), str(tmp_path / "a.wav")])
    (tmp_path / "a.lab").write_text(capsys.readouterr().out)
    assert read_labelled(tmp_path / "a.lab").phones.labels == load(folder).hear(*talk).labels


@pytest.fixture(scope="module")
def talk(voice):
    from facesynth.performer.voice import speak

    audio, rate = speak(["Please mind the blue umbrella, my good man."])[0]
    return np.pad(audio, (rate // 5, rate // 5)), rate


def test_the_folder_hears_what_torch_hears(folder, talk):
    from facesynth.speech.phone_graph import phone_hearing

    ours, theirs = load(folder).hear(*talk), phone_hearing().hear(*talk)
    assert ours.labels == theirs.labels
    np.testing.assert_allclose(ours.ends_s, theirs.ends_s, atol=1e-9)
    np.testing.assert_allclose(ours.confidences, theirs.confidences, atol=1e-3)
    assert sum(label in ("b", "p", "m") for label in ours.labels) >= 4


def test_the_folder_streams_phones(folder, talk):
    from facesynth.inference import resample

    audio, model = resample(*talk, 16000), load(folder)
    whole = model.stream(look_ahead_s=0.4)
    wanted = [*whole.push(audio), *whole.finish()]
    stream, got = model.stream(look_ahead_s=0.4), []
    for start in range(0, len(audio), 1234):
        got += stream.push(audio[start : start + 1234])
    assert [*got, *stream.finish()] == wanted


def test_a_stream_of_another_rate_is_refused(folder):
    with pytest.raises(FacesynthError, match="44100"):
        load(folder).stream(sample_rate=44100)


def test_the_manifest_states_whose_weights_these_are(folder):
    model = load(folder)
    assert "hama 1.7.0" in model.manifest["settings"]["notice"]
    assert model.manifest["training_data"]["licences"] == ["Apache-2.0 (weights)"]
