"""What two motions must share before one is judged by the other, and the differences between them."""

import math

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion

Array = NDArray[np.float64]


class UnavailableError(FacesynthError):
    """A metric that has no value for this motion; the message is the reason that tables print."""


def require_alike(synthesised: Motion, truth: Motion) -> None:
    """Refuse two motions of different layout, rate or length; nothing is ever cut or resampled to fit.

    Missing samples (NaN) of the truth are left out of every mean; a synthesised motion has none.
    """
    mine, yours = synthesised.layout, truth.layout
    if (mine.kind, mine.names) != (yours.kind, yours.names):
        raise FacesynthError(
            f"the synthesised motion has {len(mine.names)} {mine.kind}, the truth {len(yours.names)} {yours.kind}, "
            "or their names differ; compare motions of one layout"
        )
    if not math.isclose(synthesised.fps, truth.fps, rel_tol=1e-6):
        raise FacesynthError(f"the synthesised motion runs at {synthesised.fps:g} fps, the truth at {truth.fps:g}; resample one")
    if len(synthesised) != len(truth):
        raise FacesynthError(
            f"the synthesised motion has {len(synthesised)} frames, the truth {len(truth)}; nothing is cut to fit: "
            "synthesise for the phones of this recording"
        )
    if not np.isfinite(synthesised.frames).all():
        raise FacesynthError("the synthesised motion holds NaN or infinite samples; a method must fill every frame")


def paired_points(synthesised: Motion, truth: Motion) -> tuple[Array, Array]:
    """[T, K, dimension] of both, after `require_alike`; NaN in both where the truth is missing a point."""
    require_alike(synthesised, truth)
    mine, yours = synthesised.points.astype(np.float64), truth.points.astype(np.float64)
    missing = np.isnan(yours).any(axis=2)
    mine[missing], yours[missing] = np.nan, np.nan
    return mine, yours


def distances(mine: Array, yours: Array) -> Array:
    """[T, K] Euclidean distance of each point in each frame, from points [T, K, dimension]."""
    return np.asarray(np.linalg.norm(mine - yours, axis=2))


def mean_present(values: Array) -> float:
    """Mean of what is not NaN; UnavailableError where nothing is left."""
    present = values[~np.isnan(values)]
    if not present.size:
        raise UnavailableError("the truth is missing every sample that this needs")
    return float(present.mean())
