"""Weights of a rig's known shapes from the motion of markers, by bounded least squares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import marker_vertices
from facesynth.face.solve.bounded import solve
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.long_arrays import Growing, let_go
from facesynth.motion.arkit_names import ARKIT_NAMES

if TYPE_CHECKING:
    from facesynth.face.solve.fitting import LayoutFit

BLOCK = 2048
"""Frames whose markers are held in double precision at once."""
SOLVED, BESIDE_S = 8192, 0.5
"""Frames that are solved together, and what is solved at either side of them, seconds: a weight follows its neighbours in time
within some 3 ms, so that what lies farther away changes none by as much as the solver's tolerance."""
RIDGE = 2e-4
"""Share of the mean squared shape length that a shape pays for being used."""
GAP_WEIGHT = 4.0
"""Importance of a squared millimetre of lip gap beside one of marker distance."""

SHY: Mapping[str, float] = MappingProxyType(
    {"mouthDimple": 8.0, "mouthPress": 8.0, "mouthShrugLower": 4.0, "mouthClose": 2.0, "eyeWide": 2.0, "browInnerUp": 0.5}
)
"""Ridge factors where two shapes look nearly alike on markers (cosines of .8 to .96): the rarer one holds back."""

UNSEEN: tuple[str, ...] = ("tongueOut", *(name for name in ARKIT_NAMES if name.startswith("eyeLook")))
"""Shapes that skin markers hardly see: they follow from the phones and from the gaze, not from a solve."""


@dataclass(frozen=True, eq=False)
class MarkerBasis:
    """What each shape of a rig does to the markers of a layout."""

    shapes_mm: NDArray[np.float64]
    """[52, 3K] displacement of the markers at weight 1."""
    rest_mm: NDArray[np.float64]
    """[3K] markers at rest: the layout's neutral pose, or the rig's."""
    ridge: NDArray[np.float64]
    """[52] mm² that a weight of 1 costs."""
    free: NDArray[np.bool_]
    """[52] shapes that are solved for; the others keep the weights they are given."""
    gap_rows: NDArray[np.float64]
    """[P, 3K] picks the vertical distance of each pair of facing lip markers."""
    placed: Callable[[ArrayLike], NDArray[np.float64]] | None = None
    """Frames of the layout to markers on the head [t, K, 3], mm; None where they are that already."""

    def offsets(self, frames: ArrayLike, piece: slice) -> NDArray[np.float64]:
        """[t, 3K] how far the markers of some frames are from rest, mm."""
        some = np.asarray(frames)[piece]
        return np.asarray(some if self.placed is None else self.placed(some), np.float64).reshape(len(some), -1) - self.rest_mm

    @classmethod
    def of(cls, rig: Rig, layout: Layout) -> MarkerBasis:
        """Read the basis off a rig; the layout's names must be those of the head's markers."""
        if layout.kind != "markers":
            raise FacesynthError(f"weights are solved from 3-D markers in mm; got a layout of {layout.kind}")
        vertices = marker_vertices(rig, layout)
        rest = rig.rest_mm[vertices].ravel() if layout.neutral is None else np.asarray(layout.neutral)
        return cls._at(rig, vertices, rest, layout.lip_pairs, np.ones(3))

    @classmethod
    def fitted(cls, rig: Rig, layout: Layout, fit: LayoutFit) -> MarkerBasis:
        """The basis of points that a fit has put on the head; of 2-D points nothing is known along the third axis."""
        pairs = tuple((int(upper), int(lower)) for upper, lower in fit.lip_pairs)
        seen = np.array([1.0, 1.0, float(layout.dimension == 3)])
        basis = cls._at(rig, fit.vertices, rig.rest_mm[fit.vertices].ravel(), pairs, seen)
        return replace(basis, placed=partial(fit.on_head, rig))

    @classmethod
    def _at(
        cls, rig: Rig, vertices: NDArray[np.int64], rest: ArrayLike, pairs: tuple[tuple[int, int], ...], seen: NDArray[np.float64]
    ) -> MarkerBasis:
        shapes = (rig.shapes_mm[:, vertices] * seen).reshape(len(rig.names), -1).astype(np.float64)
        factors = np.array([SHY.get(name.removesuffix("Left").removesuffix("Right"), 1.0) for name in rig.names])
        free = np.array([name not in UNSEEN for name in rig.names]) & (shapes**2).any(axis=1)
        ridge = RIDGE * (shapes[free] ** 2).sum(axis=1).mean() * factors if free.any() else factors
        return cls(shapes, np.asarray(rest, np.float64), ridge, free, _gap_rows(pairs, len(vertices)))


def solve_markers(
    basis: MarkerBasis, frames: ArrayLike, fps: float, known: ArrayLike | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights [T, 52] of frames [T, C] of the basis's layout, head motion removed, and the residual [T] (mm, root mean square).

    known: [T, 52] weights of the shapes that are not solved for (gaze, tongue); zero where not given. Their
    share of the motion is taken off the markers first. What is longer than SOLVED frames is solved in stretches.
    """
    lift = np.concatenate([np.eye(basis.shapes_mm.shape[1]), np.sqrt(GAP_WEIGHT) * basis.gap_rows]).T
    shapes = basis.shapes_mm[basis.free] @ lift
    onto = np.linalg.qr(shapes.T)[0]  # what lies outside of the shapes' span changes no weight
    count, beside = len(np.asarray(frames)), round(BESIDE_S * fps)
    weights, residual_mm = Growing(np.float64), Growing(np.float64)
    for first in range(0, max(1, count), SOLVED):
        stop, start = min(first + SOLVED, count), max(0, first - beside)
        some = np.zeros((min(stop + beside, count) - start, len(basis.shapes_mm)))
        if known is not None:
            some[:, ~basis.free] = np.asarray(known)[start : start + len(some), ~basis.free]
        wanted = np.empty((len(some), onto.shape[1]))
        for piece in _pieces(0, len(some)):
            offsets = basis.offsets(frames, slice(start + piece.start, start + piece.stop))
            wanted[piece] = (offsets - some[piece] @ basis.shapes_mm) @ (lift @ onto)
        some[:, basis.free] = solve(shapes @ onto, wanted, basis.ridge[basis.free], fps=fps)
        for piece in _pieces(first, stop):
            offsets = basis.offsets(frames, piece)
            followed = follow_gap(basis, some[piece.start - start : piece.stop - start], offsets)
            off = (followed @ basis.shapes_mm - offsets).reshape(len(offsets), -1, 3)
            weights.add(followed)
            residual_mm.add(np.sqrt((off**2).sum(axis=2).mean(axis=1)))
            let_go(np.asarray(frames))
    return weights.whole(), residual_mm.whole()


def _pieces(first: int, stop: int) -> list[slice]:
    return [slice(start, min(start + BLOCK, stop)) for start in range(first, max(first + 1, stop), BLOCK)]


def follow_gap(basis: MarkerBasis, weights: NDArray[np.float64], offsets_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights [T, 52] whose lips are as far apart as the markers' where the mouth is nearly shut.

    Least squares spreads its error evenly, and an error of half a millimetre at the lips is a closure lost.
    The gap is linear in the weights: what is too much is closed by mouthClose, what is too little is opened
    by less of it and then by more jawOpen. Between 2 and 6 mm the correction fades out.
    """
    if not len(basis.gap_rows):
        return weights
    slopes = (basis.shapes_mm @ basis.gap_rows.T).mean(axis=1)
    close, jaw = ARKIT_NAMES.index("mouthClose"), ARKIT_NAMES.index("jawOpen")
    asked = (offsets_mm @ basis.gap_rows.T).mean(axis=1)
    nearness = np.clip((6.0 - asked) / 4.0, 0, 1)
    too_much = (weights @ slopes - asked) * nearness * nearness * (3 - 2 * nearness)
    corrected = weights.copy()
    corrected[:, close] = np.clip(weights[:, close] - too_much / slopes[close], 0, 1)
    left_mm = too_much + (corrected[:, close] - weights[:, close]) * slopes[close]
    corrected[:, jaw] = np.clip(weights[:, jaw] + np.maximum(-left_mm, 0) / slopes[jaw], 0, 1)
    return corrected


def _gap_rows(pairs: tuple[tuple[int, int], ...], points: int) -> NDArray[np.float64]:
    rows = np.zeros((len(pairs), 3 * points))
    for row, (upper, lower) in zip(rows, pairs, strict=True):
        row[upper * 3 + 1], row[lower * 3 + 1] = 1.0, -1.0
    return rows
