import runpy
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from facesynth.cli.export import export
from facesynth.export.graph import BATCHES, LENGTHS, TOLERANCE, check_parity
from facesynth.export.parts import export_features
from facesynth.export.path_search import path_search_graph
from facesynth.export.speech_graphs import rasta_plp_stream_graph
from facesynth.inference import FacesynthError, load
from facesynth.speech.rasta_plp import RastaPlp

SCRIPTS = Path(__file__).parents[2] / "export"


@pytest.fixture(scope="module")
def features(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts") / "features"
    export_features(folder)
    return load(folder)


def test_every_audio_feature_is_a_graph_of_any_length(features):
    import torch

    assert set(features.names) == {"rasta_plp", "cepstrum", "log_mel", "mel_cepstra"}
    for name in features.names:
        assert features.manifest["graphs"][name]["parity"]["largest_relative_difference"] < TOLERANCE
    sound = (0.1 * np.random.default_rng(0).standard_normal((2, 12345))).astype(np.float32)
    wanted = RastaPlp()(torch.from_numpy(sound)).numpy()
    assert np.allclose(features["rasta_plp"](audio=sound)[0], wanted, atol=1e-5)


def test_no_data_and_unknown_data_are_told_apart(features, emotion_file, tmp_path):
    from facesynth.methods.emotion.detector import EmotionDetector

    assert features.manifest["training_data"]["licences"] == ["none: no data"]
    assert features.manifest["training_data"]["consents"] == ["none: no data"]
    detector = EmotionDetector.load(emotion_file)
    detector.provenance = {}
    detector.save(tmp_path / "listed.safetensors")
    done = CliRunner().invoke(export, [str(tmp_path / "listed.safetensors"), "-o", str(tmp_path / "listed")])
    assert done.exit_code == 0
    assert "does not state under which licences" in done.output
    assert load(tmp_path / "listed").manifest["training_data"] == {"licences": ["unknown"], "consents": ["unknown"]}


@pytest.mark.parametrize("script", ["lds", "efase", "anime_graph", "coarticulation", "expression", "eyes", "emotion"])
def test_each_script_takes_its_own_method_alone(script, lds_file, emotion_file, tmp_path, monkeypatch, capsys):
    own = {"lds": lds_file, "emotion": emotion_file}
    for name, path in own.items():
        monkeypatch.setattr("sys.argv", [f"{script}.py", str(path), "-o", str(tmp_path / name)])
        if name == script:
            runpy.run_path(str(SCRIPTS / f"{script}.py"), run_name="__main__")
            assert load(tmp_path / name).manifest["method"] == script
            continue
        with pytest.raises(SystemExit, match="2"):
            runpy.run_path(str(SCRIPTS / f"{script}.py"), run_name="__main__")
        assert f"method '{name}'; wanted {script}" in capsys.readouterr().err
        assert not (tmp_path / name).exists()


def test_the_script_for_features(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["features.py", "-o", str(tmp_path / "features")])
    runpy.run_path(str(SCRIPTS / "features.py"), run_name="__main__")
    assert "log_mel" in load(tmp_path / "features").names


def test_a_shape_is_named(features):
    with pytest.raises(FacesynthError, match=r"audio is float32 \[100\]; wanted float32 \['batch', 'samples'\]"):
        features["rasta_plp"](audio=np.zeros(100, np.float32))
    with pytest.raises(FacesynthError, match="audio is float64"):
        features["rasta_plp"](audio=np.zeros((1, 100)))
    with pytest.raises(FacesynthError, match="no graph 'melspec'"):
        features["melspec"]


def test_the_head_is_moved_by_graphs(rig, tmp_path):
    done = CliRunner().invoke(export, ["face", "-o", str(tmp_path / "face"), "--json"])
    assert done.exit_code == 0, done.output
    face = load(tmp_path / "face")
    for name in ("deform_mesh", "deform_regions", "arkit_weights", "warp"):
        assert face.manifest["graphs"][name]["parity"]["largest_relative_difference"] < TOLERANCE
    rest = np.array(face.manifest["layout"]["neutral"])[None, None]
    weights = face["arkit_weights"](frames=np.repeat(rest, 4, axis=1), fps=np.array(30.0))[0]
    assert np.abs(weights).max() < 1e-6
    still = face["deform_mesh"](frames=rest.astype(np.float32))[0]
    assert still.shape == (1, 1, face.manifest["settings"]["vertices"], 3)
    assert np.abs(still).max() < 1e-4


@pytest.mark.parametrize(("batch", "phones"), [(1, 1), (3, 1), (2, 2), (2, 40)])
def test_the_path_graph_takes_one_phone_or_many(batch, phones):
    import onnxruntime

    graph = path_search_graph()
    session = onnxruntime.InferenceSession(graph.model.SerializeToString(), providers=["CPUExecutionProvider"])
    inputs = graph.example(batch, phones, np.random.default_rng(phones))
    path, cost = session.run(None, inputs)
    wanted_path, wanted_cost = graph.reference(inputs)
    assert path.shape == (batch, phones)
    assert np.array_equal(path, wanted_path)
    assert np.allclose(cost, wanted_cost)


def test_what_is_heard_in_pieces_is_compared_from_a_state_too():
    graph, rng = rasta_plp_stream_graph(RastaPlp()), np.random.default_rng(0)
    drawn = [graph.example(*size, rng) for size in product(BATCHES, LENGTHS)]
    assert {float(inputs["fresh"]) for inputs in drawn} == {0.0, 1.0}
    assert all(np.abs(inputs["history"]).min() > 0 and np.abs(inputs["level"]).min() > 0 for inputs in drawn)
    assert check_parity(graph).relative < TOLERANCE
