"""The head's movement as a BVH file: one joint with position and rotation."""

from pathlib import Path

import numpy as np

from facesynth.atomic import write_text
from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.arkit_rig import PIVOT_MM

# BVH turns about the axes in the order of its channels, each about the axis already turned: Z, X, Y here,
# "ZXY" intrinsic. Positions are in centimetres, which is what character animation programs take a unit for.
_CHANNELS = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"


def write_bvh(path: str | Path, animation: FaceAnimation) -> None:
    """Write the head as a root joint `head` at the pivot of the rig; rotations in degrees, positions in cm."""
    from scipy.spatial.transform import Rotation

    pivot_cm = PIVOT_MM / 10
    degrees = Rotation.from_rotvec(animation.head[:, :3]).as_euler("ZXY", degrees=True)
    rows = np.concatenate([pivot_cm + animation.head[:, 3:] / 10, degrees], axis=1) + 0.0
    offset = " ".join(f"{value:.6f}" for value in pivot_cm)
    lines = [
        "HIERARCHY",
        "ROOT head",
        "{",
        f"\tOFFSET {offset}",
        f"\t{_CHANNELS}",
        "\tEnd Site",
        "\t{",
        "\t\tOFFSET 0.000000 20.000000 0.000000",
        "\t}",
        "}",
        "MOTION",
        f"Frames: {len(animation)}",
        f"Frame Time: {1 / animation.fps:.12g}",
        *(" ".join(f"{value:.6f}" for value in row) for row in rows),
    ]
    write_text(path, "\n".join(lines) + "\n")
