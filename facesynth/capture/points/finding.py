"""Which part of a picture the face is: found by the networks of this room, or said by a person."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.points.region import FaceRegion
from facesynth.capture.square import Image
from facesynth.inference.errors import FacesynthError

Box = Sequence[float]
"""Left, top, right, bottom px, forehead to chin."""


def face_region(
    image: Image, *, box: Box | None = None, mask: NDArray[np.bool_] | None = None, face: int | None = None
) -> FaceRegion:
    """Lower and upper face in a picture [H, W, 3]: from a drawn mask [H, W] of the lower face, from a box, or found.

    `face` says which, counted from the left, where several are seen; FacesynthError where none is, or nobody said which.
    """
    height, width = image.shape[:2]
    if mask is not None:
        return FaceRegion.from_mask(mask, height, width)
    return FaceRegion.from_box(found_box(image, face) if box is None else box, height, width)


def found_box(image: Image, face: int | None = None) -> Box:
    """The box around the 468 points of the face in a picture."""
    from facesynth.capture.tracker import Tracker

    tracker = Tracker(face)
    tracker.check_alone(image)
    seen = tracker.follow(image)
    if seen is None:
        raise FacesynthError("no face is found in the first picture; give a video that shows one, or say where it is (--box)")
    height, width = image.shape[:2]
    low, high = seen.points[:, :2].min(axis=0), seen.points[:, :2].max(axis=0)
    left, top = np.clip(low, 0, [width, height]).tolist()
    right, bottom = np.clip(high, 0, [width, height]).tolist()
    return left, top, right, bottom


def read_mask(path: Path) -> NDArray[np.bool_]:
    """[H, W] where a picture file is bright, or holds paint in its alpha channel."""
    import av

    try:
        with av.open(str(path)) as container:
            picture = next(container.decode(video=0)).to_ndarray(format="rgba")
    except (av.FFmpegError, OSError, StopIteration, IndexError) as error:
        raise FacesynthError(
            f"{path} cannot be read as a picture ({error}); give the mask as PNG, the lower face in white"
        ) from None
    painted = picture[:, :, :3].max(axis=2) > 127
    return np.asarray(painted & (picture[:, :, 3] > 127))
