"""Which of the packages that not everybody needs are installed, and by which extra one gets them."""

from importlib.util import find_spec

from facesynth.inference.errors import FacesynthError

EXTRAS = {
    "torch": "train",
    "torchaudio": "train",
    "sklearn": "train",
    "kornia": "train",
    "optuna": "train",
    "cv2": "capture",
    "tflite": "capture",
    "c3d": "mocap",
    "matplotlib": "report",
    "jinja2": "report",
    "ray": "ray",
    "piper": "voice",
    "pyworld": "voice",
}
"""Packages that are imported only where they are used, and the extra that each comes with."""

FOR = {
    "train": "learning a model, emotions heard in a voice, real faces",
    "capture": "a face's motion from video",
    "mocap": "C3D files",
    "report": "evaluate and reproduce",
    "ray": "several machines",
    "voice": "the built-in performer, demo",
}
"""What each extra is for."""


def is_installed(package: str) -> bool:
    """Whether a package can be imported; it is not."""
    return find_spec(package) is not None


def missing(error: ImportError) -> FacesynthError | None:
    """What to say of an import that failed; None where the package is none that an extra brings."""
    package = (error.name or "").partition(".")[0]
    if package not in EXTRAS:
        return None
    return FacesynthError(f"this needs {package}, which is not installed: pip install 'facesynth[{EXTRAS[package]}]'")
