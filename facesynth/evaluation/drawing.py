"""Lines, bars and signals over time, as reports and papers' figures draw them; each is a data URI."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from facesynth.evaluation.figures import as_uri, colour_of, new_figure
from facesynth.evaluation.pair import Array
from facesynth.inference.quaternions import from_rotvec, one_hemisphere, to_angles

RECORDED = "recorded"
"""The signal of this name is drawn black and first."""
ANGLES = ("pitch, °", "yaw, °", "roll, °")
SMALL = {"fontsize": 8, "frameon": False}


def lines_figure(
    lines: Mapping[str, tuple[ArrayLike, ArrayLike]],
    xlabel: str,
    ylabel: str,
    *,
    style: str = "o-",
    mark: float | None = None,
    **axis: Any,
) -> str:
    """Each label's (x, y) as a line; `mark` draws an upright one; `axis` is what matplotlib's `Axes.set` takes."""
    figure, axes = new_figure(7, 4)
    colours = colour_of(list(lines))
    for label, (x, y) in lines.items():
        axes[0][0].plot(x, y, style, color=colours[label], label=label, linewidth=1, markersize=4)
    if mark is not None:
        axes[0][0].axvline(mark, color="0.6", linewidth=0.8)
    axes[0][0].set(xlabel=xlabel, ylabel=ylabel, **axis)
    if len(lines) > 1:
        axes[0][0].legend(**SMALL)
    return as_uri(figure)


def bars_figure(bars: Mapping[str, float], xlabel: str) -> str:
    """A bar for each label, the first on top."""
    figure, axes = new_figure(7, 0.8 + 0.25 * len(bars))
    axes[0][0].barh(list(bars), list(bars.values()), color="0.5")
    axes[0][0].set(xlabel=xlabel)
    axes[0][0].invert_yaxis()
    return as_uri(figure)


def tracks_figure(fps: float, panels: Mapping[str, Mapping[str, Array]], longest_s: float = 15.0) -> str:
    """By the title of a panel, with its unit: signals [T] by label, over time; no more than so many seconds."""
    figure, axes = new_figure(10, 0.6 + 1.7 * len(panels), len(panels), 1, sharex=True)
    labels = list(dict.fromkeys(label for tracks in panels.values() for label in tracks if label != RECORDED))
    colours = {RECORDED: "black", **colour_of(labels)}
    for axis, (title, tracks) in zip(axes[:, 0], panels.items(), strict=True):
        for label, track in sorted(tracks.items(), key=lambda pair: pair[0] != RECORDED):
            shown = track[: round(longest_s * fps)]
            axis.plot(np.arange(len(shown)) / fps, shown, color=colours[label], label=label, linewidth=1)
        axis.set_title(title, fontsize=8, loc="left")
    axes[-1, 0].set(xlabel="s")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), **SMALL, ncols=4, loc="outside upper center")
    return as_uri(figure)


def head_figure(fps: float, heads: Mapping[str, Array]) -> str:
    """Three angles of heads [T, 6] by label, over time."""
    angles = {label: np.degrees(to_angles(one_hemisphere(from_rotvec(poses[:, :3])))) for label, poses in heads.items()}
    return tracks_figure(fps, {name: {label: track[:, k] for label, track in angles.items()} for k, name in enumerate(ANGLES)})


def variance_figure(shares: Sequence[float] | Array, used: int) -> str:
    """Cumulative share of the variance by the number of dimensions; `used` is marked."""
    held = 100 * np.cumsum(shares)
    return lines_figure({"held": (np.arange(1, len(held) + 1), held)}, "dimensions", "variance, %", mark=used)
