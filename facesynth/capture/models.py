"""The three networks that find a face and its points: fetched once, when asked, and kept in the user's cache.

They come from the wheel of MediaPipe 0.10.21 (Apache-2.0) and are converted to ONNX here; MediaPipe itself is not
installed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.wheels import download_wheel, read_members

if TYPE_CHECKING:
    import onnxruntime

WHEEL = "mediapipe==0.10.21"
"""Newer ones carry no models."""
_PLATFORM = ("--platform", "manylinux_2_28_x86_64", "--python-version", "3.11", "--implementation", "cp", "--abi", "cp311")
"""One wheel for everybody: only files are taken out of it, nothing in it runs."""


@dataclass(frozen=True)
class Model:
    """A file inside the wheel."""

    member: str
    sha256: str


MODELS: Mapping[str, Model] = {
    "detection": Model(
        "mediapipe/modules/face_detection/face_detection_short_range.tflite",
        "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
    ),
    "landmarks": Model(
        "mediapipe/modules/face_landmark/face_landmark.tflite",
        "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
    ),
    "iris": Model(
        "mediapipe/modules/iris_landmark/iris_landmark.tflite",
        "d1744d2a09c25f501d39eba4faff47e53ecca8852c5ce19bce8eeac39357521f",
    ),
}


def fetch_landmarks() -> Path:
    """Download the wheel, check and convert its models, and keep them; returns the folder. Does nothing where all are there."""
    folder = cache_dir("landmarks")
    if fetched():
        return folder
    with tempfile.TemporaryDirectory(prefix="facesynth-") as temporary:
        convert_wheel(download_wheel(WHEEL, Path(temporary), _PLATFORM))
    return folder


def convert_wheel(wheel: Path) -> None:
    """Take the models out of a wheel of MediaPipe 0.10.21, check and convert them into the cache."""
    converted = {name: _converted(_checked(wheel, model)) for name, model in MODELS.items()}
    for name, content in converted.items():
        with atomic_path(model_path(name)) as part:
            part.write_bytes(content)


def session(name: str) -> onnxruntime.InferenceSession:
    """A model ready to run, on one thread; FacesynthError where it was not fetched."""
    if name not in MODELS:
        raise unknown("model", name, MODELS)
    path = model_path(name)
    if not path.is_file():
        raise FacesynthError("the models that find faces are not here; fetch them once with `facesynth fetch landmarks`")
    if importlib.util.find_spec("cv2") is None:
        raise FacesynthError("capturing from video needs OpenCV; install `facesynth[capture]`")
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's own exceptions have no common base but this
        raise FacesynthError(f"{path} is damaged ({error}); delete it and run `facesynth fetch landmarks`") from None


def fetched() -> bool:
    """Whether all networks are in the cache."""
    return all(model_path(name).is_file() for name in MODELS)


def model_path(name: str) -> Path:
    """Where a network lies once it is fetched."""
    return cache_dir("landmarks") / f"{name}-{MODELS[name].sha256[:12]}.onnx"


def _checked(wheel: Path, model: Model) -> bytes:
    """The model's bytes; FacesynthError unless they are the very ones that are known."""
    (content,) = read_members(wheel, [model.member])
    if hashlib.sha256(content).hexdigest() != model.sha256:
        raise FacesynthError(f"{model.member} in {wheel.name} is not the file that is known (its sha256 differs); it is not used")
    return content


def _converted(content: bytes) -> bytes:
    try:
        from facesynth.capture.tflite_to_onnx import to_onnx

        return to_onnx(content)
    except ImportError as error:
        raise FacesynthError(f"{error.name} is missing; install `facesynth[capture]`") from None
