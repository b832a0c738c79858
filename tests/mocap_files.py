"""Files of motion capture that tests make themselves."""

import numpy as np
import pytest


def write_c3d(path, points, fps=120.0, unit="mm", labels=None, sound=None, sound_rate=24000):
    """Points [T, K, 3] with NaN for gaps, written by a library that is not the one that reads."""
    ezc3d = pytest.importorskip("ezc3d")
    count = points.shape[1]
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [fps]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels or [f"M{k:03d}" for k in range(count)])
    file["data"]["points"] = np.ones((4, count, len(points)))
    file["data"]["points"][:3] = points.transpose(2, 1, 0)
    if sound is not None:
        file["parameters"]["ANALOG"]["RATE"]["value"] = [float(sound_rate)]
        file["parameters"]["ANALOG"]["LABELS"]["value"] = ("Audio 1",)
        file["parameters"]["ANALOG"]["OFFSET"]["value"] = [0]
        file["parameters"]["ANALOG"]["SCALE"]["value"] = [1.0]
        file["data"]["analogs"] = sound[None, None, :]
    file.write(str(path))
    return path
