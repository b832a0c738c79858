"""What a figure was computed with: packages, system, and the source of facesynth itself."""

import hashlib
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import facesynth

PACKAGES = ("facesynth", "torch", "torchaudio", "numpy", "scipy", "numba", "scikit-learn", "pocketsphinx", "safetensors")


@cache
def versions() -> dict[str, str]:
    """Versions by name; `source` is the sha256 of every Python file of the package."""
    found = {"python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found | {"source": source_hash()}


def source_hash() -> str:
    """sha256 over names and contents of the package's Python files."""
    root = Path(facesynth.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
