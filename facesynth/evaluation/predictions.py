"""Synthesised motion on disk, so that every table can be computed again, and any method be judged beside ours.

One NPZ file per utterance, without pickled objects:

====================  ===============  ==============================================
`frames`              [T, C] float32   as in `Motion`, no NaN
`fps`                 float64          frames per second
`layout`              text             JSON of `Layout.to_dict`
`utterance`           text             id of the utterance in the corpus
`head` (optional)     [T, 6] float32   rotation vector (rad) and translation (mm)
`eyes` (optional)     [T, 3] float32   opening 0..1, gaze to the left and up (rad)
====================  ===============  ==============================================
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np

from facesynth.atomic import atomic_path
from facesynth.errors import FacesynthError
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion


def save_prediction(path: str | Path, utterance_id: str, motion: Motion) -> None:
    """Write one synthesised motion, atomically."""
    beside = {name: track for name in ("head", "eyes") if (track := getattr(motion, name)) is not None}
    layout = json.dumps(motion.layout.to_dict(), sort_keys=True)
    with atomic_path(path) as part, part.open("wb") as file:
        np.savez(file, frames=motion.frames, fps=motion.fps, layout=layout, utterance=utterance_id, **beside)


def load_prediction(path: str | Path) -> tuple[str, Motion]:
    """Utterance id and motion of a file in this form; FacesynthError for anything else."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        layout = Layout.from_dict(json.loads(str(arrays["layout"])))
        motion = Motion(arrays["frames"], float(arrays["fps"]), layout, arrays.get("head"), arrays.get("eyes"))
        return str(arrays["utterance"]), motion
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
        raise FacesynthError(f"{path} is no prediction that facesynth can read ({error}); see the form it wants") from None
