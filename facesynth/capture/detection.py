"""Where the faces are in a picture (BlazeFace: Bazarevsky and others 2019, arXiv 1907.05047)."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.models import session
from facesynth.capture.square import Image, Square

PIXELS = 128
"""The network sees the picture in so many pixels squared."""
SURE = 0.6
"""Score from which a find counts as a face."""
SAME_FACE = 0.3
"""Share of overlap (intersection over union) from which two finds are one face."""
SMALLEST_SHARE = 0.4
"""Faces smaller than this share of the largest are bystanders or posters, and are passed over."""


def _anchors() -> NDArray[np.float64]:
    """[896, 2] the places (0..1) that the network's rows refer to: two for each of 16 × 16, six for each of 8 × 8."""
    grids = []
    for cells, copies in ((16, 2), (8, 6)):
        middle = (np.arange(cells) + 0.5) / cells
        grids.append(np.repeat(np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 2), copies, axis=0))
    return np.concatenate(grids)


_ANCHORS = _anchors()


@dataclass(frozen=True)
class Face:
    """A face that was found."""

    square: Square
    """Around the face, upright in the face's own terms: the eyes lie level in it."""
    score: float


@dataclass(eq=False)
class Detector:
    """Finds faces that fill at least about a tenth of a picture's longer side."""

    _session: Any = field(default_factory=lambda: session("detection"))

    def faces(self, image: Image) -> list[Face]:
        """Every face of the picture, from its left to its right."""
        found: list[Face] = []
        for level in _levels(image):
            found = _distinct([face for square in level for face in self._in(image, square)])
            if found:
                break
        return sorted(found, key=lambda face: face.square.x_px)

    def _in(self, image: Image, square: Square) -> list[Face]:
        outputs = self._session.run(None, {"input": square.cut(image, PIXELS)[None] * 2 - 1})
        boxes, logits = sorted(outputs, key=lambda array: -array.shape[-1])
        scores = 1 / (1 + np.exp(-np.clip(logits[0, :, 0].astype(np.float64), -50, 50)))
        sure = np.flatnonzero(scores >= SURE)
        return [self._face(square, boxes[0, i].astype(np.float64) / PIXELS, _ANCHORS[i], float(scores[i])) for i in sure]

    def _face(self, square: Square, box: NDArray[np.float64], anchor: NDArray[np.float64], score: float) -> Face:
        """A row of the network's output: centre, width and height of the box, then six points, the eyes first."""
        x, y = square.in_picture(anchor + box[:2])
        right_eye, left_eye = square.in_picture(anchor + box[4:8].reshape(2, 2))
        across = left_eye - right_eye
        return Face(Square(x, y, float(max(box[2:4])) * square.side_px, float(np.arctan2(across[1], across[0]))), score)


def _levels(image: Image) -> Iterator[list[Square]]:
    """The whole picture, then overlapping squares of half its size, for a face that is small in it."""
    height, width = image.shape[:2]
    side = float(max(height, width))
    yield [Square(width / 2, height / 2, side)]
    half = side / 2
    xs, ys = (np.unique(np.linspace(half / 2, max(size - half / 2, half / 2), 3)) for size in (width, height))
    yield [Square(float(x), float(y), half) for y in ys for x in xs]


def _distinct(faces: list[Face]) -> list[Face]:
    """One find for each face, the surest; faces much smaller than the largest left out."""
    kept: list[Face] = []
    for face in sorted(faces, key=lambda face: -face.score):
        if all(_overlap(face.square, other.square) < SAME_FACE for other in kept):
            kept.append(face)
    largest = max((face.square.side_px for face in kept), default=0.0)
    return [face for face in kept if face.square.side_px >= SMALLEST_SHARE * largest]


def _overlap(a: Square, b: Square) -> float:
    width = min(a.x_px + a.side_px / 2, b.x_px + b.side_px / 2) - max(a.x_px - a.side_px / 2, b.x_px - b.side_px / 2)
    height = min(a.y_px + a.side_px / 2, b.y_px + b.side_px / 2) - max(a.y_px - a.side_px / 2, b.y_px - b.side_px / 2)
    common = max(width, 0.0) * max(height, 0.0)
    return common / (a.side_px**2 + b.side_px**2 - common)
