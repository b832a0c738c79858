"""Where pictures of a head are taken from."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.face.draw.raster import project


@dataclass(frozen=True)
class Camera:
    """A pinhole whose picture has the performer's left on its right."""

    position_mm: tuple[float, float, float] = (0.0, -22.0, 1010.0)
    target_mm: tuple[float, float, float] = (0.0, -24.0, 60.0)
    field_of_view_deg: float = 18.0
    """Vertical."""

    def focal_px(self, height_px: int) -> float:
        """Pixels per unit of tangent."""
        return float(height_px / 2 / np.tan(np.radians(self.field_of_view_deg) / 2))

    def project(self, points_mm: NDArray[Any], size: tuple[int, int]) -> NDArray[np.float32]:
        """[N, 3] column and row in pixels, and depth in mm along the view, of points [N, 3] in mm."""
        return project(
            np.ascontiguousarray(points_mm, np.float32), self._axes(), np.array(size, np.float32) / 2, self.focal_px(size[1])
        )

    def _axes(self) -> NDArray[np.float32]:
        """[4, 3] directions of columns, of rows and of depth, and the position."""
        back = np.subtract(self.position_mm, self.target_mm)
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 1.0, 0.0], back)
        right /= np.linalg.norm(right)
        return np.array([right, -np.cross(back, right), -back, self.position_mm], np.float32)
