"""The look of a head of one's own: its own colours under the same lights as the built-in head."""

import numpy as np
from numpy.typing import NDArray

from facesynth.face.draw.camera import Camera
from facesynth.face.draw.look import LitSphere, Look
from facesynth.face.draw.occlusion import sky_visibility
from facesynth.face.draw.raster import vertex_normals
from facesynth.face.draw.shading import SKIN, Surface
from facesynth.face.rig.own_head import OwnHead
from facesynth.motion.arkit_names import ARKIT_NAMES

GLOSS = 0.35
OPEN_JAW = 0.45
_WHOLE_HEAD = 2.1
"""Height of the picture over that of what the face's shapes move."""
_WELD_MM = 1e-3


def own_look(head: OwnHead) -> Look:
    """Colours as the head's file has them; every vertex as bright as the sky it sees with the jaw shut or open."""
    quads = np.ascontiguousarray(head.triangles[:, [0, 1, 2, 2]], np.int32)
    welded = _welded(head.rest_mm)
    texture = np.empty((*head.colours.shape[:3], 4), np.uint8)
    texture[..., :3] = np.round(255 * np.sqrt(np.clip(head.colours, 0, 1)))
    texture[..., 3] = round(255 * GLOSS)
    occlusion = np.max([_sky_over(head, quads, welded, value) for value in (0.0, OPEN_JAW)], axis=0)
    open_sky = np.ones(len(head.rest_mm), np.float32)
    surface = Surface(quads, np.full(len(quads), SKIN, np.uint8), head.rest_mm, occlusion, open_sky, texture)
    reach_mm = float(np.linalg.norm(head.face_mm[1] - head.face_mm[0]))
    return Look(surface, LitSphere(np.zeros(3), reach_mm), framing(head), welded=welded)


def framing(head: OwnHead) -> Camera:
    """A camera that sees the whole head from the front."""
    height_mm = _WHOLE_HEAD * float(head.face_mm[1, 1] - head.face_mm[0, 1])
    far_mm = height_mm / 2 / np.tan(np.radians(Camera.field_of_view_deg) / 2)
    return Camera((0.0, 0.0, float(head.face_mm[1, 2]) + far_mm), (0.0, 0.0, 0.0))


def _sky_over(head: OwnHead, quads: NDArray[np.int32], welded: NDArray[np.int64], jaw_open: float) -> NDArray[np.float32]:
    """[V] what each vertex sees of the sky: teeth do so when the jaw is open."""
    weights = np.zeros((1, len(ARKIT_NAMES)))
    weights[0, ARKIT_NAMES.index("jawOpen")] = jaw_open
    posed = head.posed(head.map.own(weights)[0] - head.map.own(0 * weights)[0])
    normal = vertex_normals(posed, welded[quads].astype(np.int32))[welded]
    return sky_visibility(posed, normal, quads, directions=48)


def _welded(vertices: NDArray[np.float32]) -> NDArray[np.int64]:
    """[V] the first vertex at the same place: files split vertices at seams, which must not show in the light."""
    places = np.round(vertices / _WELD_MM).astype(np.int64)
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return first[np.ravel(inverse)]
