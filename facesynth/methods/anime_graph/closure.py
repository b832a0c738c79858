"""Lips that were shut stay shut when the rest of the face changes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.layout import Layout
from facesynth.inference.phones import BILABIALS
from facesynth.inference.speech import PhoneTrack

SHUT_SHARE = 0.25
"""Lips count as shut up to this share of the way from the narrowest gap to a wide one …"""
OPEN_SHARE = 0.6
"""… and as open from this share on; between them they are held together less and less."""

CLOSING_S = 0.04
"""Lips take at least this long to close and to open, seconds."""
LONGEST_CLOSING_S = 0.15
"""… and at most this long, so that a stream knows how much to hold back."""

Span = tuple[int, int]
"""First frame of a p, b or m and one past its last."""


def keep_shut(changed: NDArray[np.float64], before: NDArray[np.float64], layout: Layout) -> NDArray[np.float64]:
    """Frames [T, C] like `changed`, with the inner lips as near to each other as they were where they were shut `before`.

    Each pair of facing lip points gets back the distance vector that it had, half from above and half from below;
    the other points of a lip follow by the mean of its corrections. Layouts without lip pairs stay as they are.
    """
    if not has_lips(layout):
        return changed
    upper, lower = np.array(layout.lip_pairs).T
    points, old = layout.points(changed.copy()), layout.points(before)
    shut = _shut(old[:, upper, 1] - old[:, lower, 1])[..., None]
    apart = (points[:, upper] - points[:, lower]) - (old[:, upper] - old[:, lower])
    _bring_together(points, layout, shut * apart / 2)
    return points.reshape(changed.shape)


def close_at(frames: NDArray[np.float64], layout: Layout, spans: Iterable[Span], gap: float, fps: float) -> NDArray[np.float64]:
    """Frames [T, C] whose lips come as near to each other as `gap` within each span of frames.

    Blending and smoothing open the lips a little where a p, b or m shuts them. What is missing is added around the
    narrowest frame, and fades within half the span, but neither faster than 40 ms nor slower than 150 ms.
    """
    if not has_lips(layout):
        return frames
    upper, lower = np.array(layout.lip_pairs).T
    points = layout.points(frames.copy())
    for start, stop in spans:
        heights = (points[start:stop, upper, 1] - points[start:stop, lower, 1]).mean(axis=1)
        if not len(heights) or heights.min() <= gap:
            continue
        middle, reach = start + int(heights.argmin()), closing_frames(start, stop, fps)
        near = np.arange(max(0, int(middle - reach)), min(len(points), int(middle + reach) + 1))
        amount = 0.5 + 0.5 * np.cos(np.pi * np.clip((near - middle) / reach, -1, 1))
        correction = np.zeros((len(near), len(upper), layout.dimension))
        correction[..., 1] = (amount * (heights.min() - gap))[:, None] / 2
        some = points[near]
        _bring_together(some, layout, correction)
        points[near] = some
    return points.reshape(frames.shape)


def closing_frames(start: int, stop: int, fps: float) -> float:
    """How many frames before and after its narrowest one a closure in a span touches."""
    return float(np.clip((stop - start) / 2, CLOSING_S * fps, LONGEST_CLOSING_S * fps)) + 1


def has_lips(layout: Layout) -> bool:
    """Whether a layout says which points of the lips face each other."""
    return layout.dimension > 1 and bool(layout.lip_pairs)


class ClosingLips:
    """`close_at` for frames that arrive in pieces, with the same result.

    Tell it of each span before the frames that come 150 ms ahead of it; a frame is given back when no closure
    can touch it any more.
    """

    def __init__(self, layout: Layout, gap: float, fps: float) -> None:
        self.layout, self.gap, self.fps = layout, gap, fps
        self._spans: list[Span] = []
        self._held = np.zeros((0, layout.channels))
        self._given = 0

    def expect(self, start: int, stop: int) -> None:
        """A p, b or m lies at these frames."""
        self._spans.append((start, stop))

    def push(self, frames: NDArray[np.float64]) -> NDArray[np.float64]:
        """The next frames [n, C]; returns those [n', C] that are final, possibly none."""
        self._held = np.concatenate([self._held, frames])
        known = self._given + len(self._held)
        while self._spans and self._spans[0][1] + closing_frames(*self._spans[0], self.fps) <= known:
            self._close(self._spans.pop(0))
        untouched = [start - int(closing_frames(start, stop, self.fps)) - 1 for start, stop in self._spans]
        return self._give(min([known, *untouched]))

    def finish(self) -> NDArray[np.float64]:
        """The frames [n, C] that were held back."""
        while self._spans:
            self._close(self._spans.pop(0))
        return self._give(self._given + len(self._held))

    def _close(self, span: Span) -> None:
        here = (max(0, span[0] - self._given), max(0, span[1] - self._given))
        self._held = close_at(self._held, self.layout, [here], self.gap, self.fps)

    def _give(self, stop: int) -> NDArray[np.float64]:
        count = max(0, stop - self._given)
        final, self._held = self._held[:count], self._held[count:]
        self._given += count
        return final


def narrowest_gaps(frames: NDArray[np.float32], layout: Layout, spans: Iterable[Span]) -> list[float]:
    """The smallest opening of the inner lips in each span of frames [T, C] that has no missing samples."""
    if not has_lips(layout):
        return []
    upper, lower = np.array(layout.lip_pairs).T
    points = layout.points(frames)
    openings = [(points[a:b, upper, 1] - points[a:b, lower, 1]).mean(axis=1) for a, b in spans if b > a]
    return [float(opening.min()) for opening in openings if np.isfinite(opening).all()]


def bilabial_spans(phones: PhoneTrack, fps: float) -> list[Span]:
    """First frame and one past the last of each p, b, m."""
    bounds = phones.frame_bounds(fps).tolist()
    return [(a, b) for label, a, b in zip(phones.labels, bounds[:-1], bounds[1:], strict=True) if label in BILABIALS]


def _bring_together(points: NDArray[np.float64], layout: Layout, correction: NDArray[np.float64]) -> None:
    """Move upper lip points [T, K, dimension] by minus and lower ones by plus the correction [T, pairs, dimension]."""
    upper, lower = np.array(layout.lip_pairs).T
    for group, own, sign in (("upper_lip", upper, -1), ("lower_lip", lower, 1)):
        others = np.setdiff1d(layout.group(group) if group in layout.groups else own, own)
        points[:, others] += sign * correction.mean(axis=1, keepdims=True)
        points[:, own] += sign * correction


def _shut(gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, pairs] 1 where the lips are shut, 0 where they are open."""
    narrow, wide = np.nanpercentile(gaps, [1, 95], axis=0)
    share = (gaps - narrow) / np.maximum(wide - narrow, 1e-6)
    return np.clip((OPEN_SHARE - share) / (OPEN_SHARE - SHUT_SHARE), 0.0, 1.0)
