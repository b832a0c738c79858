"""468 points and two irises of one face, from picture to picture.

Face mesh: Kartynnik and others 2019, arXiv 1907.06724; iris: Ablavatski and others 2020, arXiv 2006.11341. The face is
looked for where it was in the picture before; only where it is lost is the whole picture searched.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.detection import Detector, Face
from facesynth.capture.models import session
from facesynth.capture.square import Image, Square
from facesynth.inference.errors import FacesynthError

POINTS = 468
MESH_PIXELS, IRIS_PIXELS = 192, 64
PRESENT_LOGIT = 0.0
"""Log odds from which what the mesh was laid on is a face."""
FACE_MARGIN, EYE_MARGIN = 1.5, 2.3
"""Sides of what the networks look at, over the face's own size and the eye's width."""
EYES = ((33, 133), (263, 362))
"""Outer and inner corner of the performer's right and left eye."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One face in one picture."""

    points: NDArray[np.float32]
    """[468, 3] px: right and down in the picture, and away from the camera on the same scale."""
    irises: NDArray[np.float32]
    """[2, 2] px: middle of the performer's right and left iris."""
    logit: float
    """How sure the mesh is of a face: log odds."""


@dataclass(eq=False)
class Tracker:
    """Follows one face; `face` says which where there are several, counted from the left of the picture."""

    face: int | None = None
    _detector: Detector = field(default_factory=Detector)
    _mesh: Any = field(default_factory=lambda: session("landmarks"))
    _iris: Any = field(default_factory=lambda: session("iris"))
    _last: Square | None = None
    _lost: bool = True

    def follow(self, image: Image) -> Seen | None:
        """The face in the next picture, or None where it is not to be seen."""
        seen = None if self._lost or self._last is None else self.look(image, self._last)
        if seen is None:
            found = self._find(image)
            seen = None if found is None else self.look(image, found)
        self._lost = seen is None
        if seen is not None:
            self._last = around(seen.points)
        return seen

    def check_alone(self, image: Image) -> None:
        """FacesynthError where there are several faces and nobody said which one is meant."""
        if self.face is None:
            _require_one(len(self._detector.faces(image)))

    def _find(self, image: Image) -> Square | None:
        """Where to look: the face that was lost if it was seen before, else the one that is asked for."""
        faces = self._detector.faces(image)
        if not faces:
            return None
        last = self._last
        chosen = self._choose(faces) if last is None or self.face is None else min(faces, key=lambda face: _apart(face, last))
        square = chosen.square
        return Square(square.x_px, square.y_px, FACE_MARGIN * square.side_px, square.tilt_rad)

    def _choose(self, faces: list[Face]) -> Face:
        if self.face is None:
            _require_one(len(faces))
        number = self.face or 1
        if not 1 <= number <= len(faces):
            raise FacesynthError(f"face {number} was asked for, but the picture has {len(faces)}")
        return faces[number - 1]

    def look(self, image: Image, square: Square) -> Seen | None:
        """What the mesh finds in one square of a picture, or None where that is no face; what follows does not change by it."""
        points, score = self._mesh.run(None, {"input": square.cut(image, MESH_PIXELS)[None]})
        logit = float(score.ravel()[0])
        if logit < PRESENT_LOGIT:
            return None
        places = points.reshape(POINTS, 3).astype(np.float64) / MESH_PIXELS
        world = np.concatenate([square.in_picture(places[:, :2]), places[:, 2:] * square.side_px], axis=1)
        irises = np.array([self._iris_of(image, world[list(eye), :2]) for eye in EYES], np.float32)
        return Seen(world.astype(np.float32), irises, logit)

    def _iris_of(self, image: Image, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """[2] middle of an iris (px). The network knows left eyes, as they stand in the picture; a right one is mirrored."""
        outer, inner = corners
        mirrored = outer[0] < inner[0]
        across = inner - outer if mirrored else outer - inner
        side = EYE_MARGIN * float(np.linalg.norm(across))
        x, y = corners.mean(axis=0).tolist()
        square = Square(x, y, max(side, 1.0), float(np.arctan2(across[1], across[0])))
        content = square.cut(image, IRIS_PIXELS)
        outputs = self._iris.run(None, {"input": np.ascontiguousarray(content[None, :, ::-1] if mirrored else content[None])})
        place = min(outputs, key=np.size).reshape(5, 3)[0, :2].astype(np.float64) / IRIS_PIXELS
        return square.in_picture([1 - place[0] if mirrored else place[0], place[1]])


def _require_one(count: int) -> None:
    if count > 1:
        raise FacesynthError(f"there are {count} faces in the picture; say which with --face 1 (the leftmost) and so on")


def around(points: NDArray[np.float32]) -> Square:
    """The square in which to look for points [468, 3] in the next picture."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    across = points[EYES[1][0], :2] - points[EYES[0][0], :2]
    x, y = ((low + high) / 2).tolist()
    return Square(x, y, FACE_MARGIN * float((high - low).max()), float(np.arctan2(across[1], across[0])))


def _apart(face: Face, square: Square) -> float:
    return float(np.hypot(face.square.x_px - square.x_px, face.square.y_px - square.y_px))
