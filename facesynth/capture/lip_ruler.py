"""How far lips are apart in a picture, told by what is seen between them.

A face mesh says where lips are in faces as most are: where a slit of three millimetres is opened in a picture of pressed lips,
its points stay where they were (`python benchmarks/lip_ruler.py`). So the colours along lines from under the nose to the chin
are read instead. Lines across the speaker's own recorded pictures of shut lips are opened by known amounts, with what is seen in
his open mouth, something dark, or teeth between them, and a kernel regression learns the amounts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, map_coordinates
from sklearn.kernel_ridge import KernelRidge
from sklearn.preprocessing import StandardScaler

from facesynth.capture.landmarks import LIP_PAIRS, LOWER_INNER, OUTER_CORNERS, OUTER_CORNERS_MM, UPPER_INNER
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import Span, heights_between

STEP_MM = 0.25
DOWN_MM = np.arange(-18, 24 + STEP_MM / 2, STEP_MM)
"""Of a line, from the middle of the inner lips as the mesh has them."""
SKIN_UP_TO_MM = -9.0
"""The upper part of a line, by whose colour all of it is divided, so that light and white balance do not count."""
READ_MM = np.arange(-9, 13.1, 0.75)
"""What is told apart of a line."""
ACROSS = np.linspace(-0.2, 0.2, 9)
"""Where lines lie, of the mouth's width from its middle: where the facing points are that a gap is measured at."""
SIDES = (slice(None), slice(0, 5), slice(4, 9))
"""Lines whose mean is one example of shut lips."""
SHUT_UP_TO = 1.4
"""Times the median of the smallest gaps at p, b and m, by the mesh: recorded lips that were farther apart there did not close."""
OPEN_FROM_MM = 8.0
WIDEST_MM = 12.0
INSIDE = 12
"""Colours from the upper lip to the lower one that are kept of an open mouth."""
LIP_EDGE_MM = 1.3
EXAMPLES = 2000
OFF_MM = 3.0
"""So far the middle of the lips may be from where the mesh has it."""
READ_AT_MM = (-1.5, -0.75, 0.0, 0.75, 1.5)
"""Offsets at which a line is read; the mean counts."""


@dataclass(frozen=True, eq=False)
class Samples:
    """What a ruler learns from of one recorded clip."""

    narrow: Floats
    """[N, Y, 3] lines across the lips where p, b and m bring them nearest."""
    narrow_mm: Floats
    """[N] how far apart the mesh has them there."""
    inside: Floats
    """[M, INSIDE, 3] colours in the open mouth, from the upper lip to the lower one."""

    @classmethod
    def of(cls, frames: NDArray[np.uint8], points: Floats, spans: Sequence[Span]) -> Self:
        """From pictures [T, H, W, 3] with the face mesh [T, 468, 2] px; lips close in `spans` of frames."""
        gaps, scale = mesh_gaps(points), mm_per_px(points)
        narrow = [start + int(gaps[start:stop].argmin()) for start, stop in spans if len(gaps[start:stop])]
        lines = [line(frames[t], points[t], scale, side) for t in narrow for side in SIDES]
        wide = [t for t in np.argsort(-gaps)[:12:2] if gaps[t] >= OPEN_FROM_MM]
        inside = [_inside(line(frames[t], points[t], scale), points[t], scale) for t in wide]
        return cls(
            np.reshape(lines, (-1, len(DOWN_MM), 3)), np.repeat(gaps[narrow], len(SIDES)), np.reshape(inside, (-1, INSIDE, 3))
        )


def mm_per_px(points: Floats) -> float:
    """Of the face mesh [T, 468, 2] px: the outer corners of adults' eyes are 90 mm apart."""
    across = points[:, OUTER_CORNERS[0]] - points[:, OUTER_CORNERS[1]]
    return float(OUTER_CORNERS_MM / np.linalg.norm(across, axis=1).mean())


def mesh_gaps(points: Floats) -> Floats:
    """[T] mm between the inner lips of the face mesh [T, 468, 2]; of shut lips it is not 0."""
    return np.asarray(-mm_per_px(points) * heights_between(points, LIP_PAIRS).mean(axis=1))


def line(picture: NDArray[np.uint8], points: Floats, scale: float, side: slice = SIDES[0]) -> Floats:
    """[Y, 3] the mean colours of a picture [H, W, 3] at DOWN_MM across the lips, over that of the skin above; mm per px."""
    colours = line_colours(picture, points, scale, side)
    return colours / np.maximum(skin_colour(colours), 1.0)


def skin_colour(colours: Floats) -> Floats:
    """[3] of the skin over the lips, of a line [Y, 3]."""
    return np.asarray(colours[DOWN_MM <= SKIN_UP_TO_MM].mean(axis=0))


def line_colours(picture: NDArray[np.uint8], points: Floats, scale: float, side: slice = SIDES[0]) -> Floats:
    """[Y, 3] the same as they are in the picture, 0..255."""
    left, right = points[UPPER_INNER[0]], points[UPPER_INNER[-1]]
    width = np.linalg.norm(right - left)
    along = (right - left) / max(float(width), 1e-9)
    down = np.array([-along[1], along[0]])
    middle = points[list(LIP_PAIRS[1])].mean(axis=0)
    at = middle + (DOWN_MM / scale)[:, None, None] * down + (ACROSS[side] * width)[None, :, None] * along
    places = [at[..., 1], at[..., 0]]
    colours = [map_coordinates(picture[..., k].astype(float), places, order=1, mode="nearest").mean(axis=1) for k in range(3)]
    return np.stack(colours, axis=-1)


def opened(shut: Floats, gap_mm: float, inside: Floats, blur_mm: float) -> Floats:
    """A line across shut lips [Y, 3], opened where it is darkest, with colours [D, 3] between the lips, and blurred."""
    if gap_mm <= 0:
        return shut
    away, half = DOWN_MM - _contact(shut), gap_mm / 2
    lips = _at(DOWN_MM - np.sign(away) * np.minimum(np.abs(away), half), DOWN_MM, shut)
    between = _at((away + half) / gap_mm, np.linspace(0, 1, len(inside)), inside)
    covered = np.clip((half - np.abs(away)) / STEP_MM + 0.5, 0, 1)[:, None]
    return np.asarray(gaussian_filter1d(lips + covered * (between - lips), blur_mm / STEP_MM, axis=0))


@dataclass(frozen=True, eq=False)
class LipRuler:
    """Reads how far lips are apart, of one speaker."""

    scaler: StandardScaler
    regression: KernelRidge

    @classmethod
    def learn(cls, clips: Sequence[Samples], seed: int = 0) -> Self:
        """From recorded clips of the speaker; FacesynthError where lips never close, or never open."""
        narrow, gaps, inside = (
            np.concatenate([getattr(clip, name) for clip in clips]) for name in ("narrow", "narrow_mm", "inside")
        )
        shut = narrow[gaps <= SHUT_UP_TO * np.median(gaps)] if len(gaps) else narrow
        if not len(shut) or not len(inside):
            got = f"got {len(shut)} and {len(inside)} of them"
            raise FacesynthError(f"a ruler of lips learns from lips shut at p, b and m and from open ones; {got}")
        lines, opened_mm = _examples(shut, inside, np.random.default_rng(seed))
        scaler, regression = StandardScaler().fit(lines), KernelRidge(alpha=0.1, kernel="rbf", gamma=0.3 / lines.shape[1])
        return cls(scaler, regression.fit(scaler.transform(lines), opened_mm))

    def read(self, lines: Floats) -> Floats:
        """[T] mm between the lips that lines [T, Y, 3] go across; about 0, a little below it too, where they are shut."""
        known = np.concatenate([_told(one, off)[None] for one in lines for off in READ_AT_MM])
        return np.asarray(self.regression.predict(self.scaler.transform(known))).reshape(len(lines), -1).mean(axis=1)


def _examples(shut: Floats, inside: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Lines [N, Q] as they are told apart, and the gaps [N] mm that they were opened by."""
    lines, gaps = [], []
    for _ in range(EXAMPLES):
        gap = 0.0 if random.random() < 0.15 else random.uniform(0, WIDEST_MM) * np.sqrt(random.random())
        between = _between(inside, random)
        seen = opened(shut[random.integers(len(shut))], gap, between, random.uniform(0.5, 1.0))
        lines.append(_told(seen * (1 + 0.03 * random.standard_normal()), random.uniform(-OFF_MM, OFF_MM)))
        gaps.append(gap)
    return np.stack(lines), np.array(gaps)


def _between(inside: Floats, random: np.random.Generator) -> Floats:
    """[D, 3] what may be seen between the lips: all that was recorded, half of it, darkness, teeth over or under darkness."""
    dark, bright = np.quantile(inside.reshape(-1, 3), [0.1, 0.9], axis=0)
    recorded = inside[random.integers(len(inside))]
    kind = random.random()
    if kind < 0.3:
        return np.tile(dark * random.uniform(0.8, 1.15), (4, 1))
    if kind < 0.5:
        teeth = np.stack([bright * random.uniform(0.8, 1.1)] * 2 + [dark])
        return teeth[:: random.choice([1, -1])]
    return recorded if kind > 0.6 else recorded[(first := random.integers(0, 6)) : first + 6]


def _inside(colours: Floats, points: Floats, scale: float) -> Floats:
    """[INSIDE, 3] of a line across an open mouth, a lip's edge within what the mesh takes for the inner lips."""
    height = np.linalg.norm(points[LOWER_INNER[4]] - points[UPPER_INNER[5]]) * scale / 2 - LIP_EDGE_MM
    return _at(np.linspace(-height, height, INSIDE), DOWN_MM, colours)


def _contact(shut: Floats) -> float:
    """mm down a line across shut lips where they touch: it is darkest there."""
    near = np.abs(DOWN_MM) < 3.5
    return float(DOWN_MM[near][gaussian_filter1d(shut.mean(axis=1), 2)[near].argmin()])


def _told(colours: Floats, off_mm: float) -> Floats:
    """[Q] how bright a line is, and how red, at READ_MM and some more."""
    seen = _at(READ_MM + off_mm, DOWN_MM, colours)
    bright = seen.mean(axis=1)
    return np.concatenate([bright, (seen[:, 0] - seen[:, 1]) / np.maximum(bright, 1e-6)])


def _at(places: Floats, known: Floats, colours: Floats) -> Floats:
    """[P, 3] colours [Y, 3], which are known at increasing places [Y], at other ones."""
    return np.stack([np.interp(places, known, colours[:, k]) for k in range(3)], axis=-1)
