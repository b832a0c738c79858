"""Takes of the Live Link Face app as recordings: weights by name, head and eyes where the app was told to stream them."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.inference.arrays import Floats
from facesynth.inference.layout import Layout
from facesynth.motion.livelink import ANGLES, Take, read_take

HEAD_ANGLES, EYE_ANGLES = ANGLES[:3], ANGLES[3:]
"""Those of the eyes are kept as curves of their own (`leftEyeYaw`, …; rad): a motion has one gaze, a take two, and rolls."""


def read_livelink_motion(path: Path, fps: float | None = None) -> Reading:
    """A take as curves with head and eyes; there is no sound in it. fps: of a take that is too short to show its rate.

    The gaze is the mean of both eyes; the angles of each stay, as six curves.
    Yaw is positive to the performer's right and pitch down, as the eyes' angles and looks in the app's own takes show.
    """
    require_file(path)
    take = read_take(path, fps)
    curves = (*take.weights, *(EYE_ANGLES if take.has(EYE_ANGLES) else ()))
    layout = Layout("curves", tuple(column[0].lower() + column[1:] for column in curves))
    frames = take.rows(curves)
    frames[:, : len(take.weights)] = np.clip(frames[:, : len(take.weights)], 0, 1)
    head, eyes = _head(take), _eyes(take)
    motion = motion_of_arrays(
        path, take.laid(frames), take.fps, layout, *(part if part is None else take.laid(part) for part in (head, eyes))
    )
    return Reading(motion, remarks=(*take.remarks, *_lacking(take)), silent=eyes is not None)


def _head(take: Take) -> Floats | None:
    """[R, 6] rotation vectors, and no shift."""
    if not take.has(HEAD_ANGLES):
        return None
    turn = Rotation.from_euler("YXZ", take.rows(HEAD_ANGLES) * [-1, 1, -1]).as_rotvec()
    return np.concatenate([turn, np.where(np.isnan(turn), turn, 0.0)], axis=1)


def _eyes(take: Take) -> Floats | None:
    """[R, 3] opening and gaze."""
    if not take.has(EYE_ANGLES):
        return None
    blinks = [name for name in ("EyeBlinkLeft", "EyeBlinkRight") if name in take.names]
    opening = 1 - np.clip(take.rows(blinks), 0, 1).mean(axis=1) if blinks else np.ones(len(take.values))
    gaze = -take.rows(EYE_ANGLES).reshape(-1, 2, 3)[:, :, :2].mean(axis=1)
    return np.column_stack([opening, gaze])


def _lacking(take: Take) -> tuple[str, ...]:
    lacks = [what for what, angles in (("head", HEAD_ANGLES), ("eyes", EYE_ANGLES)) if not take.has(angles)]
    if lacks:
        return (f"the take has no angles of {' and '.join(lacks)}",)
    turned = np.nan_to_num(take.rows(HEAD_ANGLES)).any()
    return () if turned else ("the head angles are all zero: the app was told not to stream them",)
