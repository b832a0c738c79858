"""Everything that facesynth knows about a movement, in one numpy archive without pickles."""

import json
from pathlib import Path

import numpy as np

from facesynth.atomic import atomic_path
from facesynth.face.animation import FaceAnimation
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.npz import read_arrays

_ANIMATION = ("names", "weights", "head", "gaze", "tongue_up", "fps")
_BESIDE = ("residual_mm", "ranges", "sources", "frames", "frames_fps", "frames_head", "frames_eyes", "layout")


def write_npz(path: str | Path, animation: FaceAnimation, motion: Motion | None = None) -> None:
    """Write the animation, and beside it the motion it was made from, each at its own rate.

    Keys: names, weights, head, gaze, tongue_up, fps, residual_mm, ranges, sources (JSON text: who moves
    which part of the face); frames, frames_fps, frames_head,
    frames_eyes and layout (JSON text) of the motion.
    """
    arrays: dict[str, np.ndarray] = {"names": np.array(animation.names), "weights": animation.weights, "head": animation.head}
    arrays |= {"gaze": animation.gaze, "tongue_up": animation.tongue_up, "fps": np.array(animation.fps)}
    for name in ("residual_mm", "ranges"):
        if getattr(animation, name) is not None:
            arrays[name] = getattr(animation, name)
    if animation.sources:
        arrays["sources"] = np.array(json.dumps(dict(animation.sources), sort_keys=True))
    if motion is not None:
        arrays |= {"frames": motion.frames, "frames_fps": np.array(motion.fps)}
        arrays["layout"] = np.array(json.dumps(motion.layout.to_dict(), sort_keys=True))
        for name in ("head", "eyes"):
            if getattr(motion, name) is not None:
                arrays[f"frames_{name}"] = getattr(motion, name)
    with atomic_path(path) as part, part.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def read_npz(path: str | Path) -> tuple[FaceAnimation, Motion | None]:
    """Read what `write_npz` wrote; the motion is None where the file has none."""
    arrays = read_arrays(path, "an animation that facesynth wrote", _ANIMATION, _BESIDE)
    names = tuple(str(name) for name in np.atleast_1d(arrays["names"]))
    animation = FaceAnimation(
        names,
        arrays["weights"],
        arrays["head"],
        arrays["gaze"],
        arrays["tongue_up"],
        float(arrays["fps"]),
        arrays.get("residual_mm"),
        arrays.get("ranges"),
        json.loads(str(arrays["sources"])) if "sources" in arrays else {},
    )
    return animation, _motion(arrays) if "frames" in arrays else None


def _motion(arrays: dict[str, np.ndarray]) -> Motion:
    layout = Layout.from_dict(json.loads(str(arrays["layout"])))
    return Motion(arrays["frames"], float(arrays["frames_fps"]), layout, arrays.get("frames_head"), arrays.get("frames_eyes"))
