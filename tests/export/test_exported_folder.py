import json
import shutil

import numpy as np
import pytest

from facesynth.export.graph import TOLERANCE, check_parity
from facesynth.export.lds import lds_content
from facesynth.export.models import export_model
from facesynth.inference import FacesynthError, load
from facesynth.inference.folder import FORMAT, digest, open_folder
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
    with pytest.raises(FacesynthError, match=f"{name} does not have the hash"):
        load(folder)


def test_a_truncated_file_is_named(folder):
    (folder / "rollout.onnx").write_bytes((folder / "rollout.onnx").read_bytes()[:-7])
    with pytest.raises(FacesynthError, match="rollout.onnx has .* bytes; wanted"):
        load(folder)


def test_a_missing_file_is_named(folder):
    (folder / "innovations.onnx").unlink()
    with pytest.raises(FacesynthError, match="innovations.onnx: No such file"):
        load(folder)


def test_a_file_of_another_export_is_named(folder, emotion_file, exported):
    shutil.copy(exported(emotion_file) / "machine.onnx", folder / "rollout.onnx")
    with pytest.raises(FacesynthError, match="rollout.onnx has"):
        load(folder)


def test_a_graph_that_is_not_the_manifests_is_named(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["graphs"]["rollout"]["file"] = "features.onnx"
    changed(folder, graphs=manifest["graphs"])
    with pytest.raises(FacesynthError, match="features.onnx takes"):
        load(folder)


def test_a_changed_manifest_is_named(folder):
    text = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(text.replace("CC0-1.0", "MIT"))
    with pytest.raises(FacesynthError, match="manifest.json was changed"):
        load(folder)
    (folder / "manifest.json").write_text(text[: len(text) // 2])
    with pytest.raises(FacesynthError, match="manifest.json is damaged"):
        load(folder)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": FORMAT - 1}, f"format {FORMAT - 1}; this runtime reads {FORMAT}"),
        ({"method": "gan"}, "unknown method .* 'gan'"),
        ({"written_by": "somebody"}, "was not written by"),
        ({"files": {"../lds.py": {"bytes": 1, "sha256": ""}}}, "is not a file of this folder"),
    ],
)
def test_a_foreign_folder_is_refused(folder, changes, message):
    changed(folder, **changes)
    with pytest.raises(FacesynthError, match=message):
        load(folder)


def without(*keys):
    def change(manifest):
        for key in keys[:-1]:
            manifest = manifest[key]
        del manifest[keys[-1]]

    return change


def with_(value, *keys):
    def change(manifest):
        for key in keys[:-1]:
            manifest = manifest[key]
        manifest[keys[-1]] = value

    return change


FOREIGN = [
    ("lds", without("settings", "noise_amounts"), "older facesynth: it lacks noise_amounts; wanted .* export the model again"),
    ("lds", with_([], "files"), "states what cannot be"),
    ("lds", with_(None, "graphs"), "states what cannot be"),
    ("lds", without("files", "rollout.onnx", "bytes"), "lacks 'bytes'"),
    ("lds", without("files", "rollout.onnx"), "rollout.onnx is not listed"),
    ("lds", without("graphs", "rollout"), "lists no graph 'rollout'"),
    ("lds", without("graphs", "rollout", "file"), "lacks 'file'"),
    ("lds", without("graphs", "rollout", "inputs"), "lacks 'inputs'"),
    ("lds", with_("x", "graphs", "rollout", "outputs", 0, "name"), "gives .'frames', 'state_after'., which is not what"),
    ("lds", without("layout"), "lacks layout"),
    ("lds", without("layout", "names"), "manifest.json: 'names' is missing in the layout; export"),
    ("lds", with_(None, "layout"), "manifest.json: a layout is a mapping"),
    ("lds", without("fps"), "lacks fps"),
    ("lds", with_("many", "fps"), "states what cannot be"),
    ("lds", without("settings", "window_samples"), "lacks 'window_samples'"),
    ("lds", without("settings", "settling_s"), "lacks 'settling_s'"),
    ("lds", without("settings", "components"), "lacks 'components'"),
    ("lds", without("latency", "look_ahead_s"), "lacks 'look_ahead_s'"),
    ("lds", with_(9.0, "latency", "look_ahead_s"), "states a look-ahead of 9 s"),
    ("lds", without("training_data"), "lacks training_data"),
    ("lds", with_(3, "method"), "unknown method"),
    ("lds", with_(["lds"], "method"), "unknown method"),
    ("lds", with_("efase", "method"), "arrays.npz is not listed in the manifest"),
    ("lds", with_(99, "opset"), "states opset 99; this runtime knows 20"),
    ("lds", with_([2], "format"), "has format"),
    ("efase", without("arrays", "before"), "lacks 'before'"),
    ("efase", with_({}, "arrays"), "manifest.json lacks"),
    ("efase", with_([], "arrays"), "states what cannot be"),
    ("efase", without("arrays", "before", "shape"), "lacks 'shape'"),
    ("efase", with_("int64", "arrays", "before", "dtype"), "the manifest wants int64"),
    ("emotion", with_("x", "settings", "features"), "features is 'x'"),
    ("emotion", without("settings", "features"), "lacks 'features'"),
]


@pytest.mark.parametrize(("method", "change", "message"), FOREIGN)
def test_a_foreign_manifest_with_a_hash_of_its_own_is_refused(
    lds_file, efase_file, emotion_file, exported, tmp_path, method, change, message
):
    file = {"lds": lds_file, "efase": efase_file, "emotion": emotion_file}[method]
    folder = shutil.copytree(exported(file), tmp_path / "foreign")
    manifest = json.loads((folder / "manifest.json").read_text())
    change(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest | {"sha256": digest(manifest)}))
    with pytest.raises(FacesynthError, match=message):
        load(folder)


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a":' * 100_000, "\x00", ""])
def test_a_manifest_of_nonsense_is_refused(folder, content):
    (folder / "manifest.json").write_text(content)
    with pytest.raises(FacesynthError, match="manifest.json"):
        load(folder)


def test_what_is_no_folder_is_refused(tmp_path):
    with pytest.raises(FacesynthError, match=r"manifest.json: no such file"):
        load(tmp_path)
    (tmp_path / "manifest.json").write_text("[]")
    with pytest.raises(FacesynthError, match=r"manifest.json was not written by"):
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


@pytest.mark.parametrize(("weights", "mean"), [("float16", 1e-3), ("int8", 0.05)])
def test_the_rounding_of_arrays_is_stated(anime_file, exported, weights, mean):
    folder = exported(anime_file, weights)
    manifest = json.loads((folder / "manifest.json").read_text())
    exact, kept = (open_folder(path).arrays() for path in (exported(anime_file), folder))
    for name in ("frames", "features"):
        scale = kept.get(f"{name}_scale", 1.0)
        away = np.abs(kept[name].astype(np.float64) * scale - exact[name])
        stated = manifest["arrays"][name]["rounding"]
        assert stated == pytest.approx({"mean": away.mean(), "most": away.max()}, rel=1e-6)
        assert 0 < stated["mean"] < mean
    plain = json.loads((exported(anime_file) / "manifest.json").read_text())
    assert not any("rounding" in entry for entry in plain["arrays"].values())
    assert manifest["arrays"]["phones"].keys() == {"dtype", "shape", "unit"}


def test_an_anime_graph_of_8_bits_moves_nearly_alike(anime_file, exported, speeches):
    exact, smaller = load(exported(anime_file)), load(exported(anime_file, "int8"))
    for speech in speeches:
        wanted = exact.synthesize(speech).frames
        moved = np.abs(wanted - wanted.mean(axis=0)).max()
        assert np.abs(smaller.synthesize(speech).frames - wanted).mean() < 0.02 * moved
