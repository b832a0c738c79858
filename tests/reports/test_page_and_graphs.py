"""The page without cross-origin isolation, and a damaged .onnx, which is named."""

import hashlib
import json
import shutil
import subprocess

import pytest

PROGRAM = """
import {{ readFile }} from "node:fs/promises";
import {{ openFolder }} from "{model}";
const ort = {{ InferenceSession: {{ create: async () => {{ throw new Error("protobuf parsing failed"); }} }} }};
const read = async (name) => new Uint8Array(await readFile("{folder}/" + name));
await openFolder(read, ort).catch((error) => console.log(error.message));
"""


def compact(value):
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def test_the_page_names_the_graph_that_is_damaged(tmp_path, repository):
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    (tmp_path / "mouth.onnx").write_bytes(b"no graph")
    digest = hashlib.sha256(b"no graph").hexdigest()
    manifest = {"written_by": "facesynth", "format": 3, "graphs": {"mouth": {"file": "mouth.onnx"}}}
    manifest["files"] = {"mouth.onnx": {"sha256": digest}}
    manifest["sha256"] = hashlib.sha256(compact(manifest).encode()).hexdigest()
    (tmp_path / "manifest.json").write_text(compact(manifest), encoding="utf-8")
    program = PROGRAM.format(model=(repository / "examples" / "browser" / "model.js").as_uri(), folder=tmp_path.as_posix())
    command = [node, "--input-type=module", "-e", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=1800)
    assert "mouth.onnx is no graph that onnxruntime runs (protobuf parsing failed)" in done.stdout


def test_the_page_says_on_how_many_threads_it_runs_and_why(repository):
    text = (repository / "examples" / "browser" / "main.js").read_text(encoding="utf-8")
    assert "crossOriginIsolated ?" in text
    assert "the page is not cross-origin isolated" in text
