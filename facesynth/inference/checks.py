"""Sound, rates and seeds as strangers give them: refused where they cannot be meant."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FacesynthError
from .layout import Layout
from .long_arrays import all_finite


def checked_piece(audio: ArrayLike) -> NDArray[np.float32]:
    """Mono sound [S], -1..1, possibly none of it."""
    samples = np.asarray(audio)
    if samples.ndim != 1:
        raise FacesynthError(f"audio has shape {list(samples.shape)}; wanted mono samples [S]: take the mean of the channels")
    if samples.dtype.kind != "f":
        raise FacesynthError(f"audio is {samples.dtype}; wanted floats in -1..1: divide samples of 16 bits by 32768")
    if not all_finite(samples):
        raise FacesynthError("audio holds NaN or infinite samples; export the sound again")
    return samples.astype(np.float32, copy=False)


def checked_audio(audio: ArrayLike) -> NDArray[np.float32]:
    """The same, at least one sample."""
    samples = checked_piece(audio)
    if not len(samples):
        raise FacesynthError("audio has shape [0]; wanted mono samples [S] with S > 0")
    return samples


def checked_seed(seed: int) -> int:
    """A seed that numpy's generators take."""
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise FacesynthError(f"seed is {seed!r}; wanted a whole number that is not negative")
    return int(seed)


def checked_rate(got: float, wanted: int) -> None:
    """FacesynthError where sound has another rate than the one wanted."""
    if got != wanted:
        raise FacesynthError(
            f"the sound has {got} Hz; wanted {wanted} Hz: bring pieces there with Resampler, whole sounds with resample"
        )


def require_layout(got: Layout, own: Layout, does: str) -> None:
    """FacesynthError where motion is not of the layout of a model, which `does` so with it."""
    if (got.kind, got.names) != (own.kind, own.names):
        raise FacesynthError(
            f"this model {does} motion of its own layout ({len(own.names)} {own.kind}); "
            f"got {len(got.names)} {got.kind} with other names: train both on one performer"
        )


def require_open(ended: bool) -> None:
    """FacesynthError where a stream was finished already."""
    if ended:
        raise FacesynthError("the stream was finished; open another one with model.stream()")
