import dataclasses

import numpy as np
import pytest

from facesynth.face.deform.skin import marker_skin, on_head_markers, shown_blinks
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.face.solve.animate import animate
from facesynth.face.solve.landmark_names import LANDMARKS
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion


def motion_of(rig, **weights):
    """Twelve frames in which shapes come in evenly, as the head's markers see them."""
    layout = marker_layout(rig)
    shapes = np.array([rig.shapes_mm[rig.index(name)[0]][marker_vertices(rig, layout)].ravel() for name in weights])
    amounts = np.linspace(0, 1, 12)[:, None] * np.array(list(weights.values()))
    return Motion(np.array(layout.neutral) + amounts @ shapes, 30, layout)


@pytest.mark.parametrize("way", ["distance", "regions"])
def test_the_skin_goes_where_the_markers_go(rig, way):
    motion = motion_of(rig, jawOpen=0.5, mouthSmileLeft=0.6)
    skin = marker_skin(way, rig, motion, animate(motion, rig, eyes_gain=0, head_gain=0))
    vertices = marker_vertices(rig, motion.layout)
    wanted = motion.points[-1] - motion.points[0]
    got = (skin.vertices(11) - skin.vertices(0))[vertices]
    lips = motion.layout.group("mouth")
    assert np.linalg.norm(got - wanted, axis=1)[lips].mean() < 0.35 * np.linalg.norm(wanted, axis=1)[lips].mean()
    assert np.abs(skin.vertices(0) - rig.rest_mm)[rig.vertices_of("skin")].max() < 1e-3


def test_ways_differ_and_regions_keep_the_upper_lip_from_the_lower(rig):
    motion = motion_of(rig, jawOpen=0.8)
    frames = motion.frames.copy().reshape(12, -1, 3)
    frames[:, motion.layout.group("upper_lip")] = frames[0, motion.layout.group("upper_lip")]
    motion = dataclasses.replace(motion, frames=frames.reshape(12, -1))
    animation = animate(motion, rig, eyes_gain=0, head_gain=0)
    upper = marker_vertices(rig, motion.layout)[motion.layout.group("upper_lip")]
    moved = [marker_skin(way, rig, motion, animation).vertices(11) - rig.rest_mm for way in ("distance", "regions")]
    assert np.abs(moved[1][upper]).max() < 0.3
    assert np.abs(moved[0] - moved[1]).max() > 0.5


def test_blinks_that_markers_show_are_not_added_twice(rig):
    motion = motion_of(rig, eyeBlinkLeft=1.0)
    shown = shown_blinks(rig, motion.layout, motion.frames)
    np.testing.assert_allclose(shown[:, 0], np.linspace(0, 1, 12), atol=1e-3)
    assert shown[:, 1].max() < 0.02
    animation = animate(motion, rig, head_gain=0)
    assert marker_skin("regions", rig, motion, animation).blinks[:, 0].max() < 0.3


def test_the_rate_of_the_pictures_may_be_another(rig):
    motion = motion_of(rig, jawOpen=1.0)
    animation = animate(motion, rig, eyes_gain=0, head_gain=0).resampled(60)
    skin = marker_skin("regions", rig, motion, animation)
    assert len(skin.frames) == len(animation) == 24


def test_points_of_another_layout_move_the_markers_they_lie_on(rig):
    """Landmarks of a face half as large, in other places of a list."""
    motion = motion_of(rig, jawOpen=0.6)
    landmark = {marker: name for name, marker in LANDMARKS.items() if marker in motion.layout.names}
    kept = [motion.layout.names.index(marker) for marker in landmark][::-1]
    points = motion.points[:, kept] * 0.8
    names = tuple(landmark[motion.layout.names[k]] for k in kept)
    strange = Motion(points.reshape(12, -1), 30, Layout("markers", names, neutral=tuple(map(float, points[0].ravel()))))
    found = on_head_markers(rig, strange)
    lip = found.layout.names.index("lower_lip")
    wanted = motion.points[:, motion.layout.names.index("lower_lip")]
    np.testing.assert_allclose(found.points[:, lip], wanted, atol=1.0)
    skin = marker_skin("regions", rig, strange, animate(strange, rig, eyes_gain=0, head_gain=0))
    assert (skin.vertices(11) - rig.rest_mm)[marker_vertices(rig, found.layout)[lip], 1] < -3


def test_what_cannot_be_deformed_is_refused(rig):
    motion = motion_of(rig, jawOpen=1.0)
    animation = animate(motion, rig)
    with pytest.raises(FacesynthError, match="way to deform 'region'; did you mean regions"):
        marker_skin("region", rig, motion, animation)
    curves = Motion(np.zeros((12, 1)), 30, Layout("curves", ("jawOpen",)))
    with pytest.raises(FacesynthError, match="makes curves"):
        marker_skin("regions", rig, curves, animation)
