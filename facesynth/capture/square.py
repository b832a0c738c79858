"""A tilted square in a picture: what a network looks at, and the way back from its coordinates to the picture's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Image = NDArray[np.uint8]
"""[height, width, 3] red, green, blue."""


@dataclass(frozen=True)
class Square:
    """A square in a picture (px, y down), turned by `tilt_rad` (clockwise as seen)."""

    x_px: float
    y_px: float
    side_px: float
    tilt_rad: float = 0.0

    def cut(self, image: Image, pixels: int) -> NDArray[np.float32]:
        """[pixels, pixels, 3] the square's content, 0..1; black where it reaches beyond the picture."""
        import cv2

        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        content = cv2.warpAffine(image, self._matrix(pixels), (pixels, pixels), flags=flags, borderMode=cv2.BORDER_CONSTANT)
        return np.asarray(content, np.float32) / np.float32(255)

    def in_picture(self, places: ArrayLike) -> NDArray[np.float64]:
        """Places [..., 2] in the square (0..1 from its upper left corner) as places in the picture (px)."""
        matrix = self._matrix(1).astype(np.float64)
        return np.asarray(places, np.float64) @ matrix[:, :2].T + matrix[:, 2]

    def _matrix(self, pixels: int) -> NDArray[np.float32]:
        """[2, 3] from pixels of the cut-out to those of the picture."""
        c, s = np.cos(self.tilt_rad) * self.side_px / pixels, np.sin(self.tilt_rad) * self.side_px / pixels
        half = pixels / 2
        return np.array([[c, -s, self.x_px - (c - s) * half], [s, c, self.y_px - (s + c) * half]], np.float32)
