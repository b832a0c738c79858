"""A family of variants in one picture: error, movement and time against what they differ in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from facesynth.evaluation.compare import OVERTAKEN
from facesynth.evaluation.contestants import Family
from facesynth.evaluation.figures import COLOURS, as_uri, new_figure
from facesynth.evaluation.table import Comparison, Score

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIGURES = ("marker_error", "lve", "lve_centred", "energy_ratio", "rtf", "train_s")
"""Times are the processor's where they were measured."""


TIMES = ("rtf", "train_s")


def family_figure(comparison: Comparison, family: Family) -> str:
    """Means with 95 % intervals of each figure: over the family's axis, or a line for each variant."""
    labels = [label for label in family.labels if label in comparison.scores]
    if not labels:
        return ""
    places = _places(comparison, family, labels)
    height = 5.0 if places is not None else 1.0 + 0.55 * len(labels)
    figure, axes = new_figure(11, height, 2, 3) if places is not None else new_figure(11, 2 * height, 2, 3, sharey=True)
    for axis, asked in zip(axes.ravel(), FIGURES, strict=True):
        timed = OVERTAKEN.get(asked, asked)
        name = timed if all(comparison.scores[label][timed].utterances for label in labels) else asked
        scores = [comparison.scores[label][name] for label in labels]
        unit = next(column.unit for column in comparison.columns if column.name == name)
        axis.set_title(name if unit == "1" else f"{name} ({unit})", fontsize=9)
        if places is None:
            _lines(axis, scores, labels, from_zero=asked in TIMES)
        else:
            _curve(axis, scores, places, from_zero=asked in TIMES)
            axis.set_xlabel("minutes learned from" if family.axis == "minutes" else family.axis)
            if family.log:
                axis.set_xscale("log")
            axis.set_xticks(places, [f"{place:.3g}" for place in places])
            axis.minorticks_off()
    return as_uri(figure)


def _places(comparison: Comparison, family: Family, labels: Sequence[str]) -> list[float] | None:
    """Where each variant stands on the axis; minutes are those that it learned from, not those that were asked for."""
    if not family.axis:
        return None
    if family.axis == "minutes":
        return [comparison.scores[label]["train_minutes"].mean for label in labels]
    return [value for label, value in zip(family.labels, family.values, strict=True) if label in labels]


def _curve(axis: Axes, scores: Sequence[Score], places: Sequence[float], *, from_zero: bool) -> None:
    order = np.argsort(places)
    at, means = np.asarray(places)[order], np.array([s.mean for s in scores])[order]
    low, high = (np.array([getattr(s, side) for s in scores])[order] for side in ("low", "high"))
    axis.fill_between(at, low, high, color=COLOURS[0], alpha=0.15, linewidth=0)
    axis.plot(at, means, "o-", color=COLOURS[0], markersize=4)
    if from_zero:
        axis.set_ylim(0, 1.1 * np.nanmax(means))


def _lines(axis: Axes, scores: Sequence[Score], labels: Sequence[str], *, from_zero: bool) -> None:
    rows = np.arange(len(labels))
    means, low, high = (np.array([getattr(s, side) for s in scores]) for side in ("mean", "low", "high"))
    axis.errorbar(means, rows, xerr=[means - low, high - means], fmt="o", color=COLOURS[0], markersize=4, linewidth=1)
    axis.axvline(means[0], color="#cccccc", linewidth=0.8, zorder=0)
    if from_zero:
        axis.set_xlim(0, 1.1 * np.nanmax(means))
    axis.locator_params(axis="x", nbins=5)
    axis.set_yticks(rows, labels, fontsize=8)
    axis.set_ylim(len(labels) - 0.5, -0.5)
