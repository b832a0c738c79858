"""The direction of the arrows: rooms import down only, and no private names of each other."""

import ast
import sys
from pathlib import Path

import pytest

import facesynth

ROOT = Path(facesynth.__file__).parent
BELOW = {
    "inference": set(),
    "speech": {"inference"},
    "motion": {"inference"},
    "corpus": {"inference", "speech", "motion", "capture"},
    "face": {"inference", "speech", "motion"},
    "capture": {"inference", "speech", "motion"},
    "methods": {"inference", "speech", "motion", "corpus", "face"},
    "performer": {"inference", "speech", "motion", "corpus", "face"},
    "evaluation": {"inference", "speech", "motion", "corpus", "face", "methods"},
    "export": {"inference", "speech", "motion", "face", "methods"},
    "stage": {"inference", "speech", "motion", "corpus", "capture", "face", "methods"},
}
"""What a room may import; the command line may import everything."""


def imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("facesynth."):
            yield node.module.split("."), [alias.name for alias in node.names]


@pytest.mark.parametrize("room", sorted(BELOW))
def test_rooms_import_down_only(room):
    for path in (ROOT / room).rglob("*.py"):
        for module, names in imports(path):
            if len(module) > 1 and module[1] in BELOW and module[1] != room:
                assert module[1] in BELOW[room], f"{path.relative_to(ROOT)} imports {'.'.join(module)}"
                assert not any(name.startswith("_") for name in names), f"{path.relative_to(ROOT)}: {names}"


def test_nothing_imports_the_command_line():
    for path in ROOT.rglob("*.py"):
        if "cli" not in path.parts:
            assert not any(module[1] == "cli" for module, _ in imports(path) if len(module) > 1), path


def test_nothing_imports_gpl_packages():
    for path in ROOT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", "") or ""]
            assert not {name.split(".")[0] for name in names} & {"piper", "parselmouth", "espeakng_loader"}, path


def test_inference_imports_numpy_and_onnxruntime_alone():
    """It is built a second time as a distribution of its own, under another name: its own modules it names relatively."""
    allowed = {"numpy", "onnxruntime", *sys.stdlib_module_names}
    for path in (ROOT / "inference").rglob("*.py"):
        depth = len(path.relative_to(ROOT / "inference").parts)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                strangers = {alias.name.split(".")[0] for alias in node.names} - allowed
                assert not strangers, f"{path.relative_to(ROOT)} imports {sorted(strangers)}"
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                assert node.module.split(".")[0] in allowed, f"{path.relative_to(ROOT)} imports {node.module}"
            if isinstance(node, ast.ImportFrom):
                assert node.level <= depth, f"{path.relative_to(ROOT)} reaches out of inference"
