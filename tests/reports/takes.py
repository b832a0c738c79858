"""Takes of the Live Link Face app, made for tests."""

import numpy as np

from facesynth.motion.livelink import ANGLES, COUNT, TIMECODE, WEIGHTS
from facesynth.motion.timecode import timecode

NAMES = (*WEIGHTS, *ANGLES)


def values_of(count, seed=0):
    """[count, 61] weights and angles that say which frame they are of: JawOpen rises by 1/count a frame."""
    rng = np.random.default_rng(seed)
    values = np.concatenate([rng.random((count, 52)), rng.normal(0, 0.1, (count, 9))], axis=1)
    values[:, WEIGHTS.index("JawOpen")] = np.arange(count) / count
    return values


def timecodes_of(count, fps=60, start_s=36000.0):
    """Time codes of the app: on the clock, with thousandths of a frame."""
    return [timecode(start_s + k / fps, int(np.ceil(fps - 1e-6))) for k in range(count)]


def write(path, timecodes, values, names=NAMES, first=(TIMECODE, COUNT), sign=",", decimal=".", encoding="utf-8", order=None):
    """A take as a table; `order` gives the columns' order."""
    header = [*first, *names]
    rows = [
        [code, str(len(names))][: len(first)] + [f"{v:.10f}".replace(".", decimal) for v in row]
        for code, row in zip(timecodes, values, strict=True)
    ]
    order = range(len(header)) if order is None else order
    lines = [sign.join(row[k] for k in order) for row in [header, *rows]]
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path
