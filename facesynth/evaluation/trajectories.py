"""Lip points over time, recorded and synthesised (Deng 2006 figs 5.18 and 5.30, Deng 2008 figs 15 and 16), and the error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation.figures import as_uri, new_figure
from facesynth.evaluation.pair import Array, UnavailableError, distances, paired_points
from facesynth.evaluation.regions import lip_points
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_SHOWN = 6
"""Methods in one picture; more lines cannot be told apart."""
LONGEST_S = 8.0


def shown_channels(layout: Layout, frames: Array) -> list[tuple[str, int]]:
    """(name, channel) of what is drawn: height of the lower lip's middle and of a mouth corner; of curves, what moves most."""
    lips = lip_points(layout)
    if layout.kind == "curves":
        most = lips[np.argsort(-np.nanstd(frames[:, lips], axis=0), kind="stable")[:2]]
        return [(layout.names[k], int(k)) for k in most]
    rest = layout.points(np.nanmean(frames, axis=0))
    centre = np.nanmean(rest[lips, 0])
    low = np.array([pair[1] for pair in layout.lip_pairs] or lips)
    middle = int(low[np.argmin(np.abs(rest[low, 0] - centre))])
    corner = int(lips[np.argmax(rest[lips, 0])])
    return [
        (f"{layout.names[k]} ({what}), height", k * layout.dimension + 1)
        for what, k in (("lower lip", middle), ("mouth corner", corner))
    ]


def trajectory_figure(
    utterance: Utterance,
    motions: Mapping[str, Motion],
    colours: Mapping[str, str],
    channels: Sequence[tuple[str, int]] | None = None,
) -> str:
    """Position and velocity of two lip points, or of other (name, channel), and the lip error; a colour for each method."""
    truth = utterance.motion
    try:
        channels = channels or shown_channels(truth.layout, truth.frames.astype(np.float64))
    except UnavailableError:
        return ""
    few = dict(list(motions.items())[:MOST_SHOWN])
    figure, axes = new_figure(11, 9.5, 2 * len(channels) + 1, 1, sharex=True)
    unit, count = truth.layout.unit, round(LONGEST_S * truth.fps)
    for row, (name, channel) in enumerate(channels):
        tracks = {label: motion.frames[:count, channel].astype(np.float64) for label, motion in few.items()}
        position, velocity = axes[2 * row, 0], axes[2 * row + 1, 0]
        recorded = truth.frames[:count, channel].astype(np.float64)
        _overlay(position, truth.times_s[:count], recorded, tracks, colours)
        position.set(ylabel=unit)
        position.set_title(f"{name}: position", fontsize=9)
        speeds = {label: np.gradient(track) * truth.fps for label, track in tracks.items()}
        _overlay(velocity, truth.times_s[:count], np.gradient(recorded) * truth.fps, speeds, colours)
        velocity.set(ylabel=f"{unit}/s")
        velocity.set_title(f"{name}: velocity", fontsize=9)
    _errors(axes[-1, 0], truth, few, colours, count)
    _phones(axes[-1, 0], utterance)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=MOST_SHOWN + 1, loc="outside upper center"
    )
    return as_uri(figure)


def _overlay(axis: Axes, times_s: Array, truth: Array, tracks: Mapping[str, Array], colours: Mapping[str, str]) -> None:
    axis.plot(times_s, truth, color="black", linewidth=1.8, label="recorded")
    for label, track in tracks.items():
        axis.plot(times_s, track, color=colours[label], linewidth=0.9, label=label)


def _errors(axis: Axes, truth: Motion, motions: Mapping[str, Motion], colours: Mapping[str, str], count: int) -> None:
    lips = lip_points(truth.layout)
    for label, motion in motions.items():
        mine, yours = paired_points(motion, truth)
        apart = distances(mine[:count, lips], yours[:count, lips])
        largest = np.where(np.isnan(apart), -np.inf, apart).max(axis=1)
        axis.plot(truth.times_s[:count], np.where(np.isinf(largest), np.nan, largest), color=colours[label], linewidth=0.9)
    axis.set(ylabel=truth.layout.unit, xlabel="s", ylim=(0, None))
    axis.set_title("largest lip error in each frame", fontsize=9)


def _phones(axis: Axes, utterance: Utterance) -> None:
    """Phones along the lower edge."""
    phones = utterance.speech.phones
    for label, start, end in zip(phones.labels, phones.starts_s, phones.ends_s, strict=True):
        if start < LONGEST_S:
            axis.axvline(start, color="#dddddd", linewidth=0.5, zorder=0)
            axis.text(
                (start + min(end, LONGEST_S)) / 2,
                0.97,
                label,
                transform=axis.get_xaxis_transform(),
                fontsize=6,
                ha="center",
                va="top",
            )
