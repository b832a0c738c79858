"""Where to look for points: the lower face, and the still part above it that tells how the head moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.inference.errors import FacesynthError

SMALLEST_PX = 32


@dataclass(frozen=True, eq=False)
class FaceRegion:
    """Masks [H, W] on the first picture."""

    lower: NDArray[np.bool_]
    """Mouth, cheeks and chin."""
    upper: NDArray[np.bool_]
    """Nose, eyes and forehead; may be empty, and then the whole lower face tells how the head moves."""

    @classmethod
    def from_box(cls, box: ArrayLike, height: int, width: int) -> "FaceRegion":
        """From the face's box (left, top, right, bottom) px, brows to chin.

        The lower face is an ellipse over the bottom 45 % of it, the upper region the band from eyes to nose.
        """
        left, top, right, bottom = np.asarray(box, np.float64)
        if not (0 <= left < right <= width and 0 <= top < bottom <= height) or min(right - left, bottom - top) < SMALLEST_PX:
            raise FacesynthError(
                f"the face's box must lie in the picture ({width}×{height}) and be {SMALLEST_PX} px or more each way; "
                f"got left {left:g}, top {top:g}, right {right:g}, bottom {bottom:g}"
            )
        y, x = np.mgrid[:height, :width]
        across = (x - (left + right) / 2) / ((right - left) / 2)
        down = (y - top) / (bottom - top)
        lower = (across / 0.85) ** 2 + ((down - 0.76) / 0.26) ** 2 <= 1
        return cls(lower, (np.abs(across) <= 0.8) & (down >= 0.05) & (down <= 0.45))

    @classmethod
    def from_mask(cls, mask: ArrayLike, height: int, width: int) -> "FaceRegion":
        """From a drawn mask [H, W] of the lower face."""
        lower = np.asarray(mask) > 0
        if lower.shape != (height, width) or not lower.any():
            raise FacesynthError(f"the mask must be [{height}, {width}] like the picture and mark some of it; got {lower.shape}")
        return cls(lower, np.zeros_like(lower))
