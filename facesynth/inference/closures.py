"""Lips that were shut are shut in what is made of them; stretching, smoothing and blending all open them a little.

`close_lips` gives each phone the gap that its own recording had, `close_at` gives spans of frames one gap of the performer,
and `keep_shut` holds on to closures while the rest of the face changes.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .layout import Layout
from .lips import Span, gap, has_lips, pair_gaps
from .long_arrays import Growing, copied, let_go, row_blocks

FADED = 9
"""Standard deviations beyond which a bump is nothing: under 1e-17 of its height."""
FADING_S = 0.03
"""Standard deviation of the bump that `close_lips` narrows the mouth by, seconds."""
SHUT_SHARE = 0.15
"""Lips count as shut up to this share of the way from the narrowest gap to a wide one …"""
OPEN_SHARE = 0.25
"""… and as open from this share on; between them `keep_shut` holds them together less and less."""
REST_S = 0.3
"""Lips that are shut for longer than this rest: no p, b or m takes so long …"""
HELD_S = 0.12
"""… but one may begin or end a rest: so long before and after it lips are held shut all the same."""
CLOSING_S = 0.04
"""In `close_at`, lips take at least this long to close and to open, seconds."""
LONGEST_CLOSING_S = 0.15
"""… and at most this long, so that a stream knows how much to hold back."""


def close_lips(frames: Floats, wanted: Floats, layout: Layout, bounds: NDArray[np.int64], fps: float) -> Floats:
    """Frames [T, C] with the smallest gap of each phone, bounds [P + 1], brought down to `wanted` [P] (NaN: leave it).

    Both lips move half of the way, fading over 30 ms.
    """
    now, at = gap(frames, layout), np.arange(len(frames))
    push, reach = np.zeros(len(frames)), int(FADED * FADING_S * fps) + 1
    for target, start, stop in zip(wanted, bounds[:-1], bounds[1:], strict=True):
        if np.isfinite(target) and stop > start:
            k = start + int(now[start:stop].argmin())
            excess = max(now[k] - target, 0.0)
            near = slice(max(0, k - reach), k + reach + 1)
            push[near] = np.maximum(push[near], excess * np.exp(-0.5 * ((at[near] - k) / (FADING_S * fps)) ** 2))
    upper, lower = np.array(layout.lip_pairs).T
    parts = Growing(frames.dtype)
    for rows in row_blocks(frames):
        some = frames[rows].copy()
        points = layout.points(some)
        points[:, upper, 1] -= push[rows, None] / 2
        points[:, lower, 1] += push[rows, None] / 2
        parts.add(some)
    return parts.whole()


def keep_shut(changed: Floats, before: Floats, layout: Layout, fps: float) -> Floats:
    """Frames [T, C] like `changed`, with the inner lips as near to each other as they were where they were shut `before`.

    Each pair of facing lip points gets back the distance vector that it had, half from above and half from below;
    the other points of a lip follow by the mean of its corrections. A face that was changed to rest with its lips apart, as
    one that bares its teeth, does so in pauses. Layouts without lip pairs stay as they are.
    """
    if not has_lips(layout):
        return changed
    upper, lower = np.array(layout.lip_pairs).T
    points, old = layout.points(changed.copy()), layout.points(before)
    gaps = pair_gaps(before, layout)
    shut = _shut(gaps, gaps)
    resting = _resting_apart(shut.mean(axis=1), _shut(pair_gaps(changed, layout), gaps).mean(axis=1), fps)
    shut = (shut * (1 - resting[:, None]))[..., None]
    apart = (points[:, upper] - points[:, lower]) - (old[:, upper] - old[:, lower])
    bring_together(points, layout, shut * apart / 2)
    return points.reshape(changed.shape)


def close_at(
    frames: Floats, layout: Layout, spans: Iterable[Span], nearest: float, fps: float, along: Floats | None = None
) -> Floats:
    """Frames [T, C] whose lips come as near to each other as the gap `nearest` within each span of frames.

    What is missing is added around the narrowest frame, and fades within half the span, but neither faster than 40 ms
    nor slower than 150 ms. Lips alone move, both half of the way, or the whole face as `closing_direction` says, `along` [C].
    Layouts without lip pairs stay as they are.
    """
    if not has_lips(layout):
        return frames
    out = copied(frames)
    points, pairs = layout.points(out), len(layout.lip_pairs)
    for start, stop in spans:
        heights = gap(out[start:stop], layout)
        if not len(heights) or heights.min() <= nearest:
            continue
        middle, reach = start + int(heights.argmin()), closing_frames(start, stop, fps)
        near = np.arange(max(0, int(middle - reach)), min(len(points), int(middle + reach) + 1))
        amount = 0.5 + 0.5 * np.cos(np.pi * np.clip((near - middle) / reach, -1, 1))
        narrower = (amount * (heights.min() - nearest))[:, None]
        if along is not None:
            out[near] += narrower * along
        else:
            correction = np.zeros((len(near), pairs, layout.dimension))
            correction[..., 1] = narrower / 2
            some = points[near]
            bring_together(some, layout, correction)
            points[near] = some
        let_go(out)
    return out


def closing_direction(frames: Floats, layout: Layout) -> Floats | None:
    """[C] how a face moves, on average over frames [N, C], while its lips come nearer by one unit: the jaw rises, cheeks follow.

    The regression of every channel on the gap, so that the gap itself narrows by exactly one. None where there are no lips, or
    they never move.
    """
    if not has_lips(layout):
        return None
    centred = frames - frames.mean(axis=0)
    opening = gap(centred, layout)
    power = float(np.dot(opening, opening))
    return -(opening @ centred) / power if power > 1e-9 * len(frames) else None


def closing_frames(start: int, stop: int, fps: float) -> float:
    """How many frames before and after its narrowest one `close_at` touches in a span."""
    return float(np.clip((stop - start) / 2, CLOSING_S * fps, LONGEST_CLOSING_S * fps)) + 1


class ClosingLips:
    """`close_at` for frames that arrive in pieces, with the same result.

    Tell it of each span before the frames that come 150 ms ahead of it; a frame is given back when no closure
    can touch it any more.
    """

    def __init__(self, layout: Layout, nearest: float, fps: float) -> None:
        self.layout, self.nearest, self.fps = layout, nearest, fps
        self._spans: list[Span] = []
        self._held = np.zeros((0, layout.channels))
        self._given = 0

    def expect(self, start: int, stop: int) -> None:
        """Lips close at these frames."""
        self._spans.append((start, stop))

    def push(self, frames: Floats) -> Floats:
        """The next frames [n, C]; returns those [n', C] that are final, possibly none."""
        self._held = np.concatenate([self._held, frames])
        known = self._given + len(self._held)
        while self._spans and self._spans[0][1] + closing_frames(*self._spans[0], self.fps) <= known:
            self._close(self._spans.pop(0))
        untouched = [start - int(closing_frames(start, stop, self.fps)) - 1 for start, stop in self._spans]
        return self._give(min([known, *untouched]))

    def finish(self) -> Floats:
        """The frames [n, C] that were held back."""
        while self._spans:
            self._close(self._spans.pop(0))
        return self._give(self._given + len(self._held))

    def _close(self, span: Span) -> None:
        here = (max(0, span[0] - self._given), max(0, span[1] - self._given))
        self._held = close_at(self._held, self.layout, [here], self.nearest, self.fps)

    def _give(self, stop: int) -> Floats:
        count = max(0, stop - self._given)
        final, self._held = self._held[:count], self._held[count:]
        self._given += count
        return final


def bring_together(points: Floats, layout: Layout, correction: Floats) -> None:
    """Move upper lip points [T, K, dimension] by minus and lower ones by plus the correction [T, pairs, dimension]."""
    upper, lower = np.array(layout.lip_pairs).T
    for group, own, sign in (("upper_lip", upper, -1), ("lower_lip", lower, 1)):
        others = np.setdiff1d(layout.group(group) if group in layout.groups else own, own)
        points[:, others] += sign * correction.mean(axis=1, keepdims=True)
        points[:, own] += sign * correction


def _shut(gaps: Floats, scale: Floats) -> Floats:
    """[T, pairs] 1 where the lips are shut, 0 where they are open, between the narrowest and wide ones of `scale` [T', pairs]."""
    narrow, wide = np.nanpercentile(scale, [1, 95], axis=0)
    share = (gaps - narrow) / np.maximum(wide - narrow, 1e-6)
    return np.clip((OPEN_SHARE - share) / (OPEN_SHARE - SHUT_SHARE), 0.0, 1.0)


def _resting_apart(shut: Floats, changed: Floats, fps: float) -> Floats:
    """[T] 1 within rests of lips, shut [T], most of whose frames are wholly open once they are changed, changed [T]; else 0."""
    resting = np.zeros(len(shut))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], shut > 0.5, [0]])))
    for start, stop in edges.reshape(-1, 2):
        if stop - start > REST_S * fps and np.median(changed[start:stop]) == 0:
            here = np.arange(start, stop)
            since = here - start if start > 0 else np.inf
            until = stop - 1 - here if stop < len(shut) else np.inf
            resting[start:stop] = np.clip(np.minimum(since, until) / (HELD_S * fps) - 1, 0, 1)
    return resting
