import subprocess
import sys
import zipfile
from types import SimpleNamespace

import pytest

from facesynth.capture import models
from facesynth.capture.tflite_to_onnx import to_onnx
from facesynth.inference.errors import FacesynthError


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "landmarks"


def wheel_with(path, contents):
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def test_a_model_that_is_not_the_known_one_is_never_used(tmp_path, empty_cache):
    forged = wheel_with(tmp_path / "m.whl", {model.member: b"forged" for model in models.MODELS.values()})
    with pytest.raises(FacesynthError, match="sha256 differs"):
        models.convert_wheel(forged)
    assert not list(empty_cache.glob("*"))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"a page that says 404"])
def test_what_is_no_wheel_is_one_clear_error(tmp_path, empty_cache, content):
    (tmp_path / "m.whl").write_bytes(content)
    with pytest.raises(FacesynthError, match="is not the wheel"):
        models.convert_wheel(tmp_path / "m.whl")
    with pytest.raises(FacesynthError, match="is not the wheel"):
        models.convert_wheel(wheel_with(tmp_path / "n.whl", {"other": b""}))


def test_without_the_models_the_error_says_how_to_get_them(empty_cache):
    with pytest.raises(FacesynthError, match="facesynth fetch landmarks"):
        models.session("landmarks")
    with pytest.raises(FacesynthError, match="did you mean"):
        models.session("landmark")


def test_pip_is_called_with_a_list_and_its_failure_is_passed_on(empty_cache, monkeypatch):
    calls = []

    def no_network(command, **options):
        calls.append(command)
        assert not options.get("shell")
        return SimpleNamespace(returncode=1, stderr="ERROR: one\nERROR: no network\n", stdout="")

    monkeypatch.setattr(subprocess, "run", no_network)
    with pytest.raises(FacesynthError, match="no network"):
        models.fetch_landmarks()
    assert calls[0][:4] == [sys.executable, "-m", "pip", "download"]
    assert {"--no-deps", "mediapipe==0.10.21"} <= set(calls[0])


def test_what_was_fetched_is_not_fetched_again(empty_cache, monkeypatch):
    empty_cache.mkdir(parents=True)
    for name in models.MODELS:
        models.model_path(name).write_bytes(b"")
    monkeypatch.setattr(subprocess, "run", None)
    assert models.fetch_landmarks() == empty_cache
    with pytest.raises(FacesynthError, match="damaged"):
        models.session("iris")


@pytest.mark.parametrize("content", [b"", b"\x10\x00\x00\x00TFL3", b"no model" * 9])
def test_the_converter_refuses_what_is_no_model(content):
    pytest.importorskip("tflite")
    with pytest.raises(FacesynthError, match="no TensorFlow Lite model"):
        to_onnx(content)
