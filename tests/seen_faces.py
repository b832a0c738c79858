"""A face of 468 points whose movement is known, as a camera would see it."""

import numpy as np
from scipy.spatial.transform import Rotation

from facesynth.capture.landmarks import GROUPS, LIP_PAIRS, OUTER_CORNERS
from facesynth.capture.track import Track

SCALE_PX = 1.7
"""Pixels of a millimetre."""


def face_mm() -> np.ndarray:
    """[468, 3] a face at rest, eye corners 90 mm apart; only the points that are looked at have their places."""
    points = np.random.default_rng(1).uniform([-60, -120, -60], [60, 40, 20], (468, 3))
    points[10], points[152] = (0, 40, 0), (0, -130, 0)
    points[OUTER_CORNERS[0]], points[OUTER_CORNERS[1]] = (-45, 0, -10), (45, 0, -10)
    points[133], points[362] = (-16, 0, -2), (16, 0, -2)
    for upper, lower in LIP_PAIRS:
        points[upper] = (points[upper][0], -70, 10)
        points[lower] = points[upper] - (0, 0.5, 0)
    for (upper, lower), x in zip(((160, 144), (158, 153), (387, 373), (385, 380)), (-35, -25, 35, 25), strict=True):
        points[upper], points[lower] = (x, 5, -3), (x, -5, -3)
    return points


def seen(shapes_mm, turns=None, shifts_mm=None, zoom=None, fps=25.0, irises_mm=None) -> Track:
    """The track of shapes [T, 468, 3] turned, shifted and seen by a camera without perspective."""
    count = len(shapes_mm)
    turns = Rotation.identity(count) if turns is None else turns
    shifts_mm = np.zeros((count, 3)) if shifts_mm is None else shifts_mm
    zoom = np.ones(count) if zoom is None else zoom
    world = np.einsum("tij,tkj->tki", turns.as_matrix(), shapes_mm) + shifts_mm[:, None]
    factor = (SCALE_PX * zoom)[:, None, None]
    irises = np.zeros((count, 2, 3)) if irises_mm is None else irises_mm
    irises = np.einsum("tij,tkj->tki", turns.as_matrix(), irises) + shifts_mm[:, None]
    flip = np.array([1, -1, -1])
    picture = np.array([320, 240, 0])
    points_px = world * factor * flip + picture
    irises_px = (irises * factor * flip + picture)[..., :2]
    return Track(points_px.astype(np.float32), irises_px.astype(np.float32), fps)


def talking(count=60) -> np.ndarray:
    """[T, 468, 3] the face with a mouth that opens to 12 mm and shuts, twice a second, resting half of the time."""
    opening = 12 * np.clip(np.sin(2 * np.pi * 2 * np.arange(count) / 25), 0, 1)
    shapes = np.tile(face_mm(), (count, 1, 1))
    shapes[:, list(GROUPS["lower_lip"]), 1] -= opening[:, None]
    return shapes
