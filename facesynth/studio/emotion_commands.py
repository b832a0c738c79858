"""Changes of what is felt in a take, and how strongly."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.speech.intensity import IntensityCurve
from facesynth.studio.document import CurvePoint, Region, Take, in_file

SHORTEST_REGION_S = 0.02


def paint_emotion(old: Take, start_s: float, end_s: float, emotion: str, intensity: float) -> Take:
    """Let an emotion be felt from one moment to another, whatever was felt there before."""
    low, high = in_file(max(0.0, start_s)), min(in_file(end_s), old.duration_s)
    high = old.duration_s if old.duration_s - high < SHORTEST_REGION_S else high
    if not high - low >= SHORTEST_REGION_S:
        raise FacesynthError(f"an emotion needs at least {SHORTEST_REGION_S:g} s; got {start_s:g} to {end_s:g} s")
    cut = _cut(old.emotions, low), _cut(old.emotions, high)
    before = [region for region in cut[0] if region.end_s <= low]
    after = [region for region in cut[1] if region.end_s > high]
    return replace(old, emotions=_joined([*before, Region(emotion, high, _share(intensity)), *after]))


def set_emotion(old: Take, region: int, emotion: str, intensity: float) -> Take:
    """Change what is felt in a region."""
    _require(old, region)
    new = Region(emotion, old.emotions[region].end_s, _share(intensity))
    return replace(old, emotions=(*old.emotions[:region], new, *old.emotions[region + 1 :]))


def move_emotion(old: Take, region: int, end_s: float) -> Take:
    """Let a region end elsewhere."""
    _require_boundary(old, region)
    low = (old.emotions[region - 1].end_s if region else 0.0) + SHORTEST_REGION_S
    high = old.emotions[region + 1].end_s - SHORTEST_REGION_S
    if not low <= end_s <= high:
        raise FacesynthError(f"emotion {region} can end from {low:.3f} to {high:.3f} s; got {end_s:.3f} s")
    new = old.emotions[region]._replace(end_s=in_file(end_s))
    return replace(old, emotions=(*old.emotions[:region], new, *old.emotions[region + 1 :]))


def set_curve(old: Take, points: Sequence[Sequence[float]]) -> Take:
    """Give the whole intensity curve; none: 1 throughout."""
    try:
        curve = tuple(CurvePoint(float(time_s), _share(value)) for time_s, value in points)
    except (TypeError, ValueError):
        raise FacesynthError("a curve is a list of moments in seconds and values from 0 to 1") from None
    if any(a.time_s >= b.time_s for a, b in pairwise(curve)) or (curve and curve[0].time_s < 0):
        raise FacesynthError("the moments of an intensity curve rise from 0 or later")
    return replace(old, curve=curve)


def cross_fade(old: Take, region: int, length_s: float) -> Take:
    """Let one emotion fade out and the next fade in around their boundary: the curve falls to 0 there and rises again."""
    _require_boundary(old, region)
    middle = old.emotions[region].end_s
    low, high = max(0.0, middle - length_s / 2), min(old.duration_s, middle + length_s / 2)
    if not low < middle < high:
        raise FacesynthError(f"a cross-fade needs a length above 0 s; got {length_s:g}")
    curve = IntensityCurve(*np.array(old.curve or ((0.0, 1.0),)).T)
    beside = [float(np.interp(at, curve.times_s, curve.intensities)) for at in (low, high)]
    kept = [point for point in old.curve if not low <= point.time_s <= high]
    points = [*kept, CurvePoint(low, beside[0]), CurvePoint(middle, 0.0), CurvePoint(high, beside[1])]
    return replace(old, curve=tuple(sorted(points)))


def _require(take: Take, region: int) -> None:
    if not 0 <= region < len(take.emotions):
        raise FacesynthError(f"there is no emotion {region}; the take has 0 to {len(take.emotions) - 1}")


def _require_boundary(take: Take, region: int) -> None:
    if not 0 <= region < len(take.emotions) - 1:
        raise FacesynthError(f"there is no boundary after emotion {region}; the take has {len(take.emotions)} emotions")


def _share(value: float) -> float:
    if not 0 <= value <= 1:
        raise FacesynthError(f"an intensity lies from 0 to 1; got {value:g}")
    return float(f"{value:.6g}")


def _cut(regions: Sequence[Region], at_s: float) -> list[Region]:
    """Regions with a boundary at a moment."""
    cut: list[Region] = []
    start_s = 0.0
    for region in regions:
        if start_s < at_s < region.end_s:
            cut.append(region._replace(end_s=at_s))
        cut.append(region)
        start_s = region.end_s
    return cut


def _joined(regions: Sequence[Region]) -> tuple[Region, ...]:
    """Equal neighbours as one."""
    joined: list[Region] = []
    for region in regions:
        if joined and (joined[-1].emotion, joined[-1].intensity) == (region.emotion, region.intensity):
            joined[-1] = region
        else:
            joined.append(region)
    return tuple(joined)
