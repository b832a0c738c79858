"""What identification found, drawn: how many states there are, and what the noise looks like."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.method import LDS

SOURCES_SHOWN = 8
SHARES_SHOWN = (0.001, 0.999)
"""A histogram reaches from one to the other: a few samples lie far out."""


def plot_orders(model: LDS, path: Path) -> None:
    """Singular values and canonical correlations, and the held-out errors that chose the orders; PNG or SVG."""
    figure = _figure(10, 6)
    (values, correlations), (deterministic, stochastic) = figure.subplots(2, 2)
    facts = model.facts
    shown = np.asarray(facts["singular_values"])[:40]
    values.semilogy(np.arange(1, len(shown) + 1), shown / shown[0], "o-", markersize=3)
    values.set(title="deterministic part", xlabel="state", ylabel="singular value, of the largest")
    shown = np.asarray(facts["canonical_correlations"])[:40]
    correlations.plot(np.arange(1, len(shown) + 1), shown, "o-", markersize=3)
    correlations.set(title="stochastic part", xlabel="state", ylabel="canonical correlation", ylim=(0, 1))
    for axes, name in ((deterministic, "deterministic_order"), (stochastic, "stochastic_order")):
        choice = facts[name]
        if choice["candidates"]:
            axes.plot(choice["candidates"], choice["errors"], "o-", markersize=3)
        axes.axvline(choice["chosen"], color="tab:red", linewidth=1, label=f"chosen: {choice['chosen']:g}")
        axes.set(xlabel="states", ylabel="held-out squared error")
        axes.legend()
    _save(figure, path)


def plot_innovations(model: LDS, path: Path) -> None:
    """`innovations_figure` as a file."""
    _save(innovations_figure(model), path)


def innovations_figure(model: LDS) -> Any:
    """Histograms of the independent sources of the noise beside a Gaussian of their variance, with their kurtosis."""
    edges, cumulative = model.innovations.edges.double().numpy(), model.innovations.cumulative.double().numpy()
    shown = min(len(edges), SOURCES_SHOWN)
    figure = _figure(12, 5)
    panels = np.atleast_1d(figure.subplots(2, (shown + 1) // 2, squeeze=False)).ravel()
    for axes, edge, share, kurtosis in zip(panels, edges, cumulative, model.facts["kurtosis"], strict=False):
        density = np.diff(share) / np.diff(edge)
        axes.stairs(density, edge, fill=True)
        least, most = np.interp(SHARES_SHOWN, share, edge).tolist()
        v = np.linspace(least, most, 200)
        axes.plot(v, _gaussian(v, edge, share), color="black", linewidth=0.8)
        axes.set(title=f"excess kurtosis {kurtosis:.1f}", yticks=[], xlim=(v[0], v[-1]))
    return figure


def _gaussian(v: NDArray[Any], edge: NDArray[Any], share: NDArray[Any]) -> NDArray[Any]:
    middle, weight = (edge[1:] + edge[:-1]) / 2, np.diff(share)
    mean = (middle * weight).sum()
    variance = ((middle - mean) ** 2 * weight).sum()
    return np.exp(-((v - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)


def _figure(width: float, height: float) -> Any:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise FacesynthError("plots need matplotlib; install it with `pip install 'facesynth[report]'`") from None
    return Figure(figsize=(width, height), layout="constrained")


def _save(figure: Any, path: Path) -> None:
    with atomic_path(path) as part:
        figure.savefig(part, dpi=110)
