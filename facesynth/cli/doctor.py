"""`facesynth doctor`."""

import platform
import sys
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

import click

from facesynth.cli.options import as_json, show
from facesynth.inference.errors import FacesynthError

CORE = ("numpy", "scipy", "onnxruntime", "onnx", "numba", "av", "soundfile", "pocketsphinx", "hama", "safetensors")
"""Distributions whose versions matter most where something goes wrong."""


@dataclass(frozen=True)
class Finding:
    """Something that was looked at."""

    what: str
    found: str
    """Version, folder, or `missing`."""
    needed_for: str = ""
    to_do: str = ""
    """Where it is missing: what brings it."""


@click.command("doctor")
@as_json
def doctor(as_json: bool) -> None:
    """Print versions, devices, caches, and what is missing with the command that brings it. Nothing is changed or fetched."""
    findings = [*_versions(), *_devices(), *_extras(), *_caches()]
    show(as_json, [asdict(one) for one in findings], map(_line, findings))


def _line(one: Finding) -> str:
    note = f"  for {one.needed_for}" if one.needed_for else ""
    return f"{one.what:24} {one.found}{note}{f': {one.to_do}' if one.to_do else ''}"


def _versions() -> list[Finding]:
    from facesynth import __version__

    here = f"{platform.system()} {platform.machine()}, {platform.python_implementation()} {platform.python_version()}"
    found = [Finding("facesynth", f"{__version__} in {sys.prefix}"), Finding("system", here)]
    return [*found, *(Finding(name, _version(name), to_do=_again(name)) for name in CORE)]


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return MISSING


MISSING = "missing"


def _again(distribution: str) -> str:
    return "pip install --force-reinstall facesynth" if _version(distribution) == MISSING else ""


def _devices() -> list[Finding]:
    """What models may run on; importing torch takes seconds, so it is asked only where it is installed."""
    from facesynth.packages import is_installed

    if not is_installed("torch"):
        return [Finding("devices", "cpu (numpy and onnxruntime)")]
    import torch

    there: dict[str, Any] = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available()}
    return [Finding("devices", ", ".join(["cpu", *(name for name, here in there.items() if here)]))]


def _extras() -> list[Finding]:
    from facesynth.packages import EXTRAS, FOR, is_installed

    found = []
    for extra in dict.fromkeys(EXTRAS.values()):
        lacking = [package for package, brings in EXTRAS.items() if brings == extra and not is_installed(package)]
        state = f"{MISSING} ({', '.join(lacking)})" if lacking else "installed"
        found.append(Finding(f"[{extra}]", state, FOR[extra], f"pip install 'facesynth[{extra}]'" if lacking else ""))
    return found


def _caches() -> list[Finding]:
    from facesynth.cache import cache_dir
    from facesynth.capture.models import fetched
    from facesynth.face.rig.anny import head_folder
    from facesynth.zoo.shelf import names

    try:
        head = Finding("head", str(head_folder()), "videos and .glb")
    except FacesynthError:
        head = Finding("head", MISSING, "videos and .glb", "facesynth fetch head")
    faces = Finding("landmarks", "fetched", "capture from video")
    if not fetched():
        faces = Finding("landmarks", MISSING, "capture from video", "facesynth fetch landmarks")
    return [head, faces, Finding("cache", str(cache_dir("."))), Finding("models", ", ".join(names()) or "none")]
