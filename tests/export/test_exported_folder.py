import json
import shutil

import pytest
from facesynth_runtime import RuntimeInputError, load

from facesynth.errors import FacesynthError
from facesynth.export.folder import digest
from facesynth.export.graph import TOLERANCE, check_parity
from facesynth.export.lds import lds_content
from facesynth.export.models import export_model
from facesynth.methods.lds.method import LDS
from facesynth.methods.registry import create


@pytest.fixture
def folder(lds_file, exported, tmp_path):
    return shutil.copytree(exported(lds_file), tmp_path / "folder")


def changed(folder, **changes):
    """Another manifest with a hash of its own: what somebody would write who means it."""
    manifest = json.loads((folder / "manifest.json").read_text()) | changes
    (folder / "manifest.json").write_text(json.dumps(manifest | {"sha256": digest(manifest)}))


def test_the_manifest_says_what_is_in_the_folder(folder, small_corpus):
    manifest = json.loads((folder / "manifest.json").read_text())
    assert set(manifest["files"]) == {path.name for path in folder.iterdir()} - {"manifest.json"}
    assert (manifest["fps"], manifest["sample_rate"], manifest["opset"]) == (60, 16000, 20)
    assert manifest["training_data"]["licences"] == ["CC0-1.0"]
    assert manifest["training_data"]["consents"] == ["none needed"]
    assert manifest["layout"]["names"] == list(small_corpus.layout.names)
    assert {"facesynth", "onnx", "onnxruntime", "torch"} <= set(manifest["versions"])
    frames = manifest["graphs"]["rollout"]["outputs"][0]
    assert frames == {"name": "frames", "dtype": "float32", "shape": ["batch", "frames", 42], "unit": "mm", "rate_hz": 60.0}
    for graph in manifest["graphs"].values():
        assert graph["parity"]["largest_relative_difference"] < TOLERANCE
        assert len(graph["parity"]["batch_and_length"]) == 4


def test_a_graph_that_differs_is_not_exported(lds_file):
    model = LDS.load(lds_file)
    graphs = lds_content(model).graphs
    model.rollout.D += 0.01
    with pytest.raises(FacesynthError, match="the graph rollout differs"):
        check_parity(graphs[2])


@pytest.mark.parametrize("name", ["rollout.onnx", "features.onnx"])
def test_a_tampered_file_is_named(folder, name):
    content = bytearray((folder / name).read_bytes())
    content[len(content) // 2] ^= 1
    (folder / name).write_bytes(content)
    with pytest.raises(RuntimeInputError, match=f"{name} does not have the hash"):
        load(folder)


def test_a_truncated_file_is_named(folder):
    (folder / "rollout.onnx").write_bytes((folder / "rollout.onnx").read_bytes()[:-7])
    with pytest.raises(RuntimeInputError, match="rollout.onnx has .* bytes; wanted"):
        load(folder)


def test_a_missing_file_is_named(folder):
    (folder / "innovations.onnx").unlink()
    with pytest.raises(RuntimeInputError, match="innovations.onnx: No such file"):
        load(folder)


def test_a_file_of_another_export_is_named(folder, emotion_file, exported):
    shutil.copy(exported(emotion_file) / "machine.onnx", folder / "rollout.onnx")
    with pytest.raises(RuntimeInputError, match="rollout.onnx has"):
        load(folder)


def test_a_graph_that_is_not_the_manifests_is_named(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["graphs"]["rollout"]["file"] = "features.onnx"
    changed(folder, graphs=manifest["graphs"])
    with pytest.raises(RuntimeInputError, match="features.onnx takes"):
        load(folder)


def test_a_changed_manifest_is_named(folder):
    text = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(text.replace("CC0-1.0", "MIT"))
    with pytest.raises(RuntimeInputError, match="manifest.json was changed"):
        load(folder)
    (folder / "manifest.json").write_text(text[: len(text) // 2])
    with pytest.raises(RuntimeInputError, match="manifest.json is damaged"):
        load(folder)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": 1}, "format 1; this runtime reads 2"),
        ({"method": "gan"}, "unknown method .* 'gan'"),
        ({"written_by": "somebody"}, "was not written by"),
        ({"files": {"../lds.py": {"bytes": 1, "sha256": ""}}}, "is not a file of this folder"),
    ],
)
def test_a_foreign_folder_is_refused(folder, changes, message):
    changed(folder, **changes)
    with pytest.raises(RuntimeInputError, match=message):
        load(folder)


def test_what_is_no_folder_is_refused(tmp_path):
    with pytest.raises(RuntimeInputError, match=r"manifest.json: no such file"):
        load(tmp_path)
    (tmp_path / "manifest.json").write_text("[]")
    with pytest.raises(RuntimeInputError, match=r"manifest.json was not written by"):
        load(tmp_path)


def test_no_folder_of_other_things_is_overwritten(lds_file, tmp_path):
    (tmp_path / "thesis.tex").write_text("…")
    with pytest.raises(FacesynthError, match="holds other files"):
        export_model(lds_file, tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "…"


def test_an_export_replaces_an_earlier_one(lds_file, emotion_file, tmp_path):
    for path in (lds_file, emotion_file):
        export_model(path, tmp_path / "folder")
    assert load(tmp_path / "folder").manifest["method"] == "emotion"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder"]


def test_a_method_without_an_export_says_so(small_corpus, tmp_path):
    create("mean_face").fit(small_corpus).save(tmp_path / "mean.safetensors")
    with pytest.raises(FacesynthError, match="mean_face"):
        export_model(tmp_path / "mean.safetensors", tmp_path / "folder")
