"""The 52 shapes of ARKit, and what their eyeLook weights say of the gaze."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.arkit_names import ARKIT_NAMES

BLINKS = ("eyeBlinkLeft", "eyeBlinkRight")

LOOK_OUT_RAD, LOOK_UP_RAD, LOOK_DOWN_RAD = np.radians([24.0, 12.0, 20.0])
"""Turn of an eye at weight 1 of eyeLookOut and eyeLookIn, eyeLookUp and eyeLookDown."""


def arkit_columns(layout: Layout) -> dict[str, int]:
    """Columns of the curves that have ARKit names, by those."""
    columns = {name[:1].lower() + name[1:]: i for i, name in enumerate(layout.names)}
    return {name: columns[name] for name in ARKIT_NAMES if name in columns}


def shows_gaze(layout: Layout) -> bool:
    """Whether curves say where the left eye looks."""
    return any(f"eyeLook{way}Left" in arkit_columns(layout) for way in ("In", "Out", "Up", "Down"))


def gaze_of(weights: ArrayLike) -> NDArray[np.float64]:
    """[T, 2] gaze (rad, to the performer's left and up) that the eyeLook weights [T, 52] stand for: the mean of both eyes."""
    look = dict(zip(ARKIT_NAMES, np.asarray(weights, np.float64).T, strict=True))
    left = look["eyeLookOutLeft"] - look["eyeLookInLeft"] + look["eyeLookInRight"] - look["eyeLookOutRight"]
    up = look["eyeLookUpLeft"] + look["eyeLookUpRight"]
    down = look["eyeLookDownLeft"] + look["eyeLookDownRight"]
    return np.stack([left * LOOK_OUT_RAD, up * LOOK_UP_RAD - down * LOOK_DOWN_RAD], axis=1) / 2


def gaze_weights(weights: ArrayLike, gaze: ArrayLike) -> NDArray[np.float64]:
    """Weights [T, 52] whose eight eyeLook weights turn both eyes to gaze [T, 2] (rad to the left, up)."""
    values = checked_weights(weights).copy()
    left, up = np.asarray(gaze, np.float64).T
    for side, outward in (("Left", left), ("Right", -left)):
        for name, turn, full in (
            ("Out", outward, LOOK_OUT_RAD), ("In", -outward, LOOK_OUT_RAD), ("Up", up, LOOK_UP_RAD), ("Down", -up, LOOK_DOWN_RAD)
        ):  # fmt: skip
            values[..., ARKIT_NAMES.index(f"eyeLook{name}{side}")] = np.clip(turn / full, 0, 1)
    return values


def eye_rotations(weights: NDArray[np.float64]) -> tuple[Rotation, Rotation]:
    """How the left and the right eyeball turn under weights [52]: the source's shapes only shift them."""
    look = {name: weights[i] for i, name in enumerate(ARKIT_NAMES) if name.startswith("eyeLook")}
    turns = []
    for side, outward in (("Left", 1), ("Right", -1)):
        yaw = outward * LOOK_OUT_RAD * (look[f"eyeLookOut{side}"] - look[f"eyeLookIn{side}"])
        pitch = LOOK_DOWN_RAD * look[f"eyeLookDown{side}"] - LOOK_UP_RAD * look[f"eyeLookUp{side}"]
        turns.append(Rotation.from_euler("YX", [yaw, pitch]))
    return turns[0], turns[1]


def checked_weights(weights: ArrayLike) -> NDArray[np.float64]:
    """Weights [52] or [T, 52] as an array; FacesynthError for other shapes and for values that are not finite."""
    values = np.asarray(weights, np.float64)
    if values.ndim not in (1, 2) or values.shape[-1] != len(ARKIT_NAMES):
        raise FacesynthError(f"weights must have shape [{len(ARKIT_NAMES)}] or [T, {len(ARKIT_NAMES)}]; got {values.shape}")
    if not np.isfinite(values).all():
        raise FacesynthError("weights hold NaN or infinite values; fill gaps before posing")
    return values
