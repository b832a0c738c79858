"""A small moving face of a dozen points, to judge and to be judged."""

import numpy as np

from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack

NAMES = ("brow_l", "brow_r", "lid_l", "lid_r", "nose", "lip_up", "lip_up_l", "lip_low", "lip_low_l", "corner", "jaw", "cheek")
REST = np.array(
    [
        *([30, 40, 5], [-30, 40, 5], [30, 20, 0], [-30, 20, 0], [0, 0, 20], [0, -30, 10]),
        *([8, -31, 9], [0, -30, 10], [8, -31, 9], [25, -30, 0], [0, -60, 5], [45, -10, -10]),
    ],
    float,
)
LAYOUT = Layout(
    "markers",
    NAMES,
    {"upper_face": (0, 1, 2, 3), "lips_inner": (5, 6, 7, 8), "lips_outer": (9,), "mouth": (5, 6, 7, 8, 9), "rigid": (0, 1, 4)},
    ((5, 7), (6, 8)),
    tuple(REST.ravel()),
)
FPS = 60.0


def face(gap, brow=None, fps=FPS, layout=LAYOUT):
    """A face whose inner lips are `gap` [T] mm apart, the lower one moving, and whose brows rise by `brow` [T] mm."""
    points = np.tile(REST, (len(gap), 1, 1))
    points[:, [7, 8], 1] -= np.asarray(gap)[:, None]
    points[:, 10, 1] -= 0.8 * np.asarray(gap)
    if brow is not None:
        points[:, :4, 1] += np.asarray(brow)[:, None]
    return Motion(points.reshape(len(gap), -1), fps, layout)


def talk(seconds=4.0, fps=FPS, delay_s=0.0, size=1.0):
    """A face that says something irregular, `delay_s` late and `size` as large."""
    t = np.arange(round(seconds * fps)) / fps - delay_s
    strength = np.sin(np.pi * np.clip(t / seconds, 0, 1)) ** 2
    gap = 6 + strength * (4 * np.sin(2 * np.pi * 2.1 * t) + 2 * np.sin(2 * np.pi * 3.7 * t + 1) * np.cos(2 * np.pi * 0.4 * t))
    brow = 5 + 2 * strength * np.sin(2 * np.pi * 0.5 * t)
    return face(size * gap, size * brow, fps)


def moved(motion, frames):
    """The motion with other frames."""
    return Motion(frames, motion.fps, motion.layout, motion.head, motion.eyes)


def phones(*pairs):
    """A track from (label, end in s) pairs."""
    return PhoneTrack(tuple(label for label, _ in pairs), np.array([end for _, end in pairs]))
