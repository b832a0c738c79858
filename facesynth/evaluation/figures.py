"""Pictures of a comparison, each as a data URI that needs no other file."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from facesynth.evaluation.details import Details
from facesynth.evaluation.emotion_recognition import Confusion
from facesynth.evaluation.pair import Array
from facesynth.evaluation.point_face import PointFace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8C6D1F", "#56B4E9", "#6A3D9A", "#E69F00", "#444444", "#B22222",
    "#17BECF", "#8FB339", "#FF5CA8", "#1F1F8F",
)  # fmt: skip
"""For methods, in order; told apart by most people who see colours differently."""
STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "facesynth",
    "svg.fonttype": "path",
}


def colour_of(labels: Sequence[str]) -> dict[str, str]:
    """A colour for each method; more methods than there are good colours share a rainbow."""
    import matplotlib as mpl

    if len(labels) <= len(COLOURS):
        return dict(zip(labels, COLOURS, strict=False))
    rainbow = mpl.colormaps["turbo"]
    return {label: mpl.colors.to_hex(rainbow(i / (len(labels) - 1))) for i, label in enumerate(labels)}


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure of `width` × `height` inches with its axes, which no global state knows."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure((width, height), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False, **options)


def as_uri(figure: Figure, kind: str = "svg") -> str:
    """The figure as `data:` URI; the same figure gives the same text."""
    import matplotlib as mpl

    stream = io.BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(stream, format=kind, dpi=110, metadata={"Date": None} if kind == "svg" else None)
    mime = "image/svg+xml" if kind == "svg" else "image/png"
    return data_uri(mime, stream.getvalue())


def data_uri(mime: str, content: bytes) -> str:
    """Any content as `data:` URI."""
    return f"data:{mime};base64,{base64.b64encode(content).decode()}"


def _panels(count: int, across: int, height: float, **options: Any) -> tuple[Figure, Any]:
    """At most `across` panels of `height` inches in a row; those beyond `count` stay empty."""
    columns = min(max(count, 1), across)
    rows = -(-max(count, 1) // columns)
    figure, axes = new_figure(11, height * rows, rows, columns, **options)
    for axis in axes.ravel()[count:]:
        axis.axis("off")
    return figure, axes


def face_figure(details: Mapping[str, Details], face: PointFace, unit: str) -> str:
    """The mean error of every point, as colour on the face; as bars for curves."""
    shown = {label: one.points for label, one in details.items() if one.points.size and np.isfinite(one.points).any()}
    worst = max((float(np.nanmax(points)) for points in shown.values()), default=1.0)
    figure, axes = _panels(len(shown), 4, 4.6 if len(face.bars) else 3.4)
    rows, columns = axes.shape
    drawn = None
    for k, (axis, (label, points)) in enumerate(zip(axes.ravel(), shown.items(), strict=False)):
        bars = len(face.bars) > 0
        drawn = _bars(axis, points, face, worst, first=k % columns == 0) if bars else _coloured(axis, points, face, worst)
        axis.set_title(f"{label}: {np.nanmean(points):.3g} {unit}", fontsize=9)
    if drawn is not None:
        figure.colorbar(drawn, ax=axes, shrink=min(0.6, 1.2 / rows), anchor=(0, 1), label=f"mean error ({unit})")
    return as_uri(figure, "png")


def _coloured(axis: Axes, points: Array, face: PointFace, worst: float) -> Any:
    x, y = face.rest[:, 0], face.rest[:, 1]
    values = np.nan_to_num(points)
    axis.set_aspect("equal")
    axis.axis("off")
    if not len(face.triangles):
        return axis.scatter(x, y, c=values, cmap="inferno_r", vmin=0, vmax=worst)
    return axis.tripcolor(x, y, face.triangles, values, shading="gouraud", cmap="inferno_r", vmin=0, vmax=worst)


def _bars(axis: Axes, points: Array, face: PointFace, worst: float, *, first: bool) -> Any:
    import matplotlib as mpl

    drawn = mpl.cm.ScalarMappable(mpl.colors.Normalize(0, worst), "inferno_r")
    values = np.nan_to_num(points[face.bars])
    axis.barh(range(len(values)), values, color=drawn.to_rgba(values))
    names = [face.layout.names[k] for k in face.bars]
    axis.set(yticks=range(len(values)), xlim=(0, worst))
    axis.set_yticklabels(names if first else [], fontsize=6)
    axis.invert_yaxis()
    return drawn


def histogram_figure(details: Mapping[str, Details], unit: str, colours: Mapping[str, str]) -> str:
    """How lip residuals are spread, with the normal distribution of the same variance beside it (Saisan 2004, fig. 1)."""
    shown = {label: one for label, one in details.items() if one.histogram.size and one.histogram.sum() > 0}
    if not shown:
        return ""
    figure, axes = _panels(len(shown), 5, 2.1, sharex=True, sharey=True)
    for axis, (label, one) in zip(axes.ravel(), shown.items(), strict=False):
        _histogram(axis, label, one, colours[label])
    for axis in axes[-1]:
        axis.set_xlabel(f"residual ({unit})")
    return as_uri(figure)


def _histogram(axis: Axes, label: str, one: Details, colour: str) -> None:
    edges = np.linspace(-one.histogram_reach, one.histogram_reach, len(one.histogram) + 1)
    middle, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    mean, spread = one.residual_mean, one.residual_spread
    axis.bar(middle, one.histogram / width, width, color=colour, alpha=0.6)
    if spread > 0:
        normal = np.exp(-0.5 * ((middle - mean) / spread) ** 2) / (spread * np.sqrt(2 * np.pi))
        axis.plot(middle, normal, color="#333333", linewidth=0.8)
        axis.text(
            0.98,
            0.95,
            f"excess\nkurtosis {one.residual_kurtosis:.1f}",
            transform=axis.transAxes,
            ha="right",
            va="top",
            fontsize=7,
        )
    axis.set_title(label, fontsize=9)


def confusion_figure(matrices: Mapping[str, Confusion]) -> str:
    """Asked (rows) and recognised (columns) emotions of each method, as shares of the asked."""
    if not matrices:
        return ""
    figure, axes = _panels(len(matrices), 4, 2.7)
    for axis, (label, matrix) in zip(axes.ravel(), matrices.items(), strict=False):
        _confusion(axis, label, matrix)
    return as_uri(figure)


def _confusion(axis: Axes, label: str, matrix: Confusion) -> None:
    share = matrix.counts / np.maximum(matrix.counts.sum(axis=1, keepdims=True), 1)
    axis.imshow(share, vmin=0, vmax=1, cmap="Blues")
    for (i, j), count in np.ndenumerate(matrix.counts):
        axis.text(j, i, str(count), ha="center", va="center", fontsize=8, color="white" if share[i, j] > 0.6 else "black")
    ticks = range(len(matrix.emotions))
    axis.set(xticks=ticks, yticks=ticks)
    axis.set_xticklabels(matrix.emotions, fontsize=7, rotation=30)
    axis.set_yticklabels(matrix.emotions, fontsize=7)
    axis.set_title(f"{label}: recall {matrix.unweighted_average_recall:.2f}", fontsize=9)
