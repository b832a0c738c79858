"""The motion of a face that was followed in a video, in the layout of its performer."""

import numpy as np

from facesynth.capture.eyes import eyes_of
from facesynth.capture.landmarks import is_captured
from facesynth.capture.shape import in_mm
from facesynth.capture.steady import steadied
from facesynth.capture.track import Track
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.pose import remove_head, rigid_points


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
