"""Every method's curve of error against movement, in one picture."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from facesynth.evaluation.curve import LIVELY, MEASURES, Curve, Measure, Point
from facesynth.evaluation.figures import as_uri, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES: dict[Measure, str] = {
    "lve": "lip error (lve)",
    "lve_centred": "lip error without each utterance's mean pose (lve_centred)",
}
ROOM, EDGE = 1.25, 1.05
"""The picture reaches so far above the largest error as made, and above each ★: caricatures beyond are in trade.csv."""
WIDEST_ENERGY = 1.8


def curve_figure(curves: Sequence[Curve], references: Collection[str], unit: str, colours: Mapping[str, str]) -> str:
    """`lve` and `lve_centred` against `energy_ratio`; reference rows are squares, with a dotted curve."""
    figure, axes = new_figure(11, 7.2 if len(curves) > 8 else 5.4, 1, 2)
    for axis, measure in zip(axes[0], MEASURES, strict=True):
        axis.axvspan(*LIVELY, color="#eef3ea", zorder=0)
        for curve in curves:
            draw = _reference if curve.label in references else _method
            draw(axis, curve, measure, colours[curve.label])
        axis.set(xlabel="energy ratio (1 = as much movement as recorded)", ylabel=unit)
        axis.set(xlim=(-0.05, WIDEST_ENERGY), ylim=(None, highest_shown(curves, measure)))
        axis.set_title(TITLES[measure], fontsize=9)
    figure.legend(*axes[0][0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=5, loc="outside upper center")
    return as_uri(figure)


def highest_shown(curves: Sequence[Curve], measure: Measure) -> float:
    """Upper end of the picture: above all that is as made, and above the best lively point of each curve."""
    made = [getattr(p, measure) for curve in curves for p in curve.points if p.sharpening == 0]
    lively = [getattr(p, measure) for curve in curves if (p := curve.lively(measure))]
    return float(max(ROOM * max(made), EDGE * max(lively, default=0.0)))


def _reference(axis: Axes, curve: Curve, measure: Measure, colour: str) -> None:
    made = next(point for point in curve.points if point.sharpening == 0)
    axis.plot(*_line(curve.points, measure), ":", color=colour, linewidth=0.9, zorder=1)
    axis.plot(made.energy_ratio, getattr(made, measure), "s", color=colour, label=curve.label, markersize=6, zorder=3)


def _method(axis: Axes, curve: Curve, measure: Measure, colour: str) -> None:
    """Dots: every setting and sharpening; thick: the front; thin: the nearest setting made smaller and larger."""
    nearest, lively = curve.nearest(measure), curve.lively(measure)
    axis.plot(*_line(curve.scaled_of(nearest.setting), measure), color=colour, linewidth=0.6, alpha=0.7, zorder=1)
    axis.plot(*_line(curve.points, measure), ".", color=colour, markersize=3, alpha=0.5, zorder=2)
    axis.plot(*_line(curve.front(measure), measure), "-", color=colour, linewidth=2, label=curve.label, zorder=2)
    axis.plot(nearest.energy_ratio, getattr(nearest, measure), "o", color=colour, markersize=7, zorder=4)
    if lively:
        axis.plot(lively.energy_ratio, getattr(lively, measure), "*", color=colour, markersize=11, zorder=4)


def _line(points: Sequence[Point], measure: Measure) -> tuple[list[float], list[float]]:
    return [point.energy_ratio for point in points], [getattr(point, measure) for point in points]
