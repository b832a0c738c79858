"""The motion of a face that was followed in a video, in the layout of its performer."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import butter, sosfiltfilt

from facesynth.capture.landmarks import OUTER_CORNERS_MM, is_captured
from facesynth.capture.shape import in_axes, in_mm
from facesynth.capture.track import Track
from facesynth.capture.tracker import EYES
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.gaps import missing_in, runs
from facesynth.motion.pose import remove_head, rigid_points

CUTOFF_HZ = 8.0
HIGHEST_SHARE = 0.9
"""A cut-off above this share of the Nyquist frequency would take nothing out, so nothing is done."""


# A zero-phase low-pass (Butterworth, forwards and backwards) takes the trembling out without delay and without opening shut lips.
def steadied(signal: NDArray[np.floating], fps: float, cutoff_hz: float = CUTOFF_HZ) -> NDArray[np.float64]:
    """A signal [T, …] with movement quicker than the cut-off taken out; frames with NaN stay, and part it."""
    values = np.array(signal, np.float64)
    if cutoff_hz >= HIGHEST_SHARE * fps / 2 or not len(values):
        return values
    lowpass = butter(2, 2 * cutoff_hz / fps, output="sos")
    for run in runs(~missing_in(values.reshape(len(values), -1))):
        piece = values[run.start : run.stop]
        if len(piece) > 1:
            values[run.start : run.stop] = sosfiltfilt(lowpass, piece, axis=0, padlen=min(len(piece) - 1, 9))
    return values


LIDS = (((160, 144), (158, 153)), ((387, 373), (385, 380)))
"""Upper and lower lid, at two places of the performer's right and left eye."""
OPEN_PERCENTILE = 80
"""An eye that is open as in this share of the frames is open: 1."""
SHUT_SHARE = 0.4
"""Lids that are shut lie this share of the open opening apart: the mesh follows the lashes, not the skin."""
EYEBALL_MM = 12.0
GAZE_S = 0.12
"""Length of the median filter over the gaze: a saccade stays a step, single wrong frames go."""
FARTHEST_RAD = 0.6


def eyes_of(track: Track) -> NDArray[np.float32]:
    """[T, 3] opening 0..1, gaze to the performer's left and up (rad; 0 is the clip's own middle); NaN where no face is seen."""
    eyes = np.full((len(track.points_px), 3), np.nan)
    present = track.present
    points = in_axes(track.points_px[present])
    eyes[present, 0] = _opening(points)
    eyes[present, 1:] = _gaze(points, in_axes(np.pad(track.irises_px[present], ((0, 0), (0, 0), (0, 1)))), track.fps)
    return eyes.astype(np.float32)


def _opening(points: Floats) -> Floats:
    """[T] mean opening of both eyes, 0 shut, 1 open as usual, from the lids' distance over the eye's width."""
    ratio = np.mean([_lid_distance(points, lids) / _width(points, eye) for lids, eye in zip(LIDS, EYES, strict=True)], axis=0)
    usual = np.percentile(ratio, OPEN_PERCENTILE)
    return np.clip((ratio / usual - SHUT_SHARE) / (1 - SHUT_SHARE), 0.0, 1.0)


def _lid_distance(points: Floats, lids: tuple[tuple[int, int], ...]) -> Floats:
    return np.mean([np.linalg.norm(points[:, upper] - points[:, lower], axis=1) for upper, lower in lids], axis=0)


def _width(points: Floats, eye: tuple[int, int]) -> Floats:
    return np.linalg.norm(points[:, eye[0]] - points[:, eye[1]], axis=1)


def _gaze(points: Floats, irises: Floats, fps: float) -> Floats:
    """[T, 2] angles of an eyeball whose iris lies so far from the middle between the corners, mean of both eyes."""
    across = points[:, EYES[1][0], :2] - points[:, EYES[0][0], :2]
    px_per_mm = np.linalg.norm(across, axis=1, keepdims=True) / OUTER_CORNERS_MM
    left = across / np.linalg.norm(across, axis=1, keepdims=True)
    up = np.stack([-left[:, 1], left[:, 0]], axis=1)
    off = np.mean([irises[:, i, :2] - points[:, list(eye), :2].mean(axis=1) for i, eye in enumerate(EYES)], axis=0)
    off_mm = np.stack([(off * left).sum(axis=1), (off * up).sum(axis=1)], axis=1) / px_per_mm
    angles = np.arcsin(np.clip((off_mm - np.median(off_mm, axis=0)) / EYEBALL_MM, -1, 1))
    frames = 2 * round(GAZE_S * fps / 2) + 1
    return np.clip(median_filter(angles, size=(frames, 1), mode="nearest"), -FARTHEST_RAD, FARTHEST_RAD)


def motion_of(track: Track, layout: Layout) -> Motion:
    """468 points in mm with the head's motion apart, and the eyes; NaN in frames without a face.

    The head's shift refers to where it mostly is in the clip; towards the camera it is hardly to be seen.
    """
    if not is_captured(layout) or layout.neutral is None:
        raise FacesynthError("video becomes 468 face landmarks, but this corpus has another layout; make a new corpus for it")
    neutral = np.reshape(np.array(layout.neutral), (-1, 3))
    steady = Track(steadied(track.points_px, track.fps).astype(np.float32), track.irises_px, track.fps)
    points, head = remove_head(in_mm(steady, neutral), neutral, rigid_points(layout))
    return Motion(points.reshape(len(points), -1), track.fps, layout, head, eyes_of(track))
