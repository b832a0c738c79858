"""The 468 points of the face mesh as a layout: which are the lips, the lids, the brows, and which stand still on the skull."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.tracker import POINTS
from facesynth.inference.layout import Layout

NAMES = tuple(f"p{number:03d}" for number in range(POINTS))

UPPER_OUTER = (61, 185, 40, 39, 37, 0, 267, 269, 270, 409, 291)
LOWER_OUTER = (146, 91, 181, 84, 17, 314, 405, 321, 375)
UPPER_INNER = (78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308)
LOWER_INNER = (95, 88, 178, 87, 14, 317, 402, 318, 324)
UPPER_BETWEEN = (76, 184, 74, 73, 72, 11, 302, 303, 304, 408, 306, 62, 183, 42, 41, 38, 12, 268, 271, 272, 407, 292)
LOWER_BETWEEN = (77, 90, 180, 85, 16, 315, 404, 320, 307, 96, 89, 179, 86, 15, 316, 403, 319, 325)
"""Rows of points across the red of the lips, from the performer's right to left; corners belong to the upper lip."""

RIGHT_LIDS = (33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173)
LEFT_LIDS = (263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398)
RIGHT_BROW = (46, 53, 52, 65, 55, 70, 63, 105, 66, 107)
LEFT_BROW = (276, 283, 282, 295, 285, 300, 293, 334, 296, 336)
FOREHEAD = (10, 109, 67, 103, 54, 338, 297, 332, 284, 151, 108, 69, 104, 68, 337, 299, 333, 298, 9)
RIGHT_CHEEK = (50, 101, 36, 118, 117, 123, 147, 187, 205, 207, 206, 203, 216, 213, 192, 119, 100)
LEFT_CHEEK = (280, 330, 266, 347, 346, 352, 376, 411, 425, 427, 426, 423, 436, 433, 416, 348, 329)
CHIN = (18, 83, 313, 200, 201, 421, 199, 208, 428, 175, 171, 396, 152, 148, 377, 176, 400, 149, 378, 150, 379)
JAW_LINE = (136, 172, 58, 365, 397, 288, 32, 262, 140, 369, 170, 395, 194, 418, 182, 406, 204, 424, 211, 431, 169, 394)

RIGID = (10, 109, 338, 67, 297, 103, 332, 151, 168, 6, 197, 195, 193, 417, 122, 351, 33, 133, 362, 263)
"""Upper forehead, bridge of the nose, corners of the eyes: what moves with the skull alone."""

LIP_PAIRS = ((82, 87), (13, 14), (312, 317))
"""Points in the middle of the inner lips that face each other, upper and lower."""

OUTER_CORNERS = (33, 263)
"""Outer corner of the performer's right and left eye."""
OUTER_CORNERS_MM = 90.0
"""How far they are apart in adults, which is what makes pixels millimetres; people differ by about 5 % (one deviation)."""

_LIPS_INNER = UPPER_INNER + LOWER_INNER
_LIPS_OUTER = UPPER_OUTER + LOWER_OUTER
_UPPER_LIP = UPPER_OUTER + UPPER_BETWEEN + UPPER_INNER
_LOWER_LIP = LOWER_OUTER + LOWER_BETWEEN + LOWER_INNER

GROUPS: Mapping[str, tuple[int, ...]] = {
    "mouth": _UPPER_LIP + _LOWER_LIP,
    "lips_inner": _LIPS_INNER,
    "lips_outer": _LIPS_OUTER,
    "upper_lip": _UPPER_LIP,
    "lower_lip": _LOWER_LIP,
    "jaw": CHIN + JAW_LINE,
    "brows": RIGHT_BROW + LEFT_BROW,
    "eyelids": RIGHT_LIDS + LEFT_LIDS,
    "cheeks": RIGHT_CHEEK + LEFT_CHEEK,
    "forehead": FOREHEAD,
    "rigid": RIGID,
    "upper_face": FOREHEAD + RIGHT_BROW + LEFT_BROW + RIGHT_LIDS + LEFT_LIDS,
}


def landmark_layout(neutral_mm: NDArray[np.floating]) -> Layout:
    """The layout of a captured performer, whose face at rest is [468, 3] mm."""
    return Layout("markers", NAMES, GROUPS, LIP_PAIRS, tuple(float(round(value, 4)) for value in np.ravel(neutral_mm).tolist()))


def is_captured(layout: Layout) -> bool:
    """Whether a layout is the one that video gives."""
    return layout.kind == "markers" and layout.names == NAMES
