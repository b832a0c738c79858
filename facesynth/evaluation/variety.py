"""How different the samples of a stochastic method are, and how good their mean and their best are."""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np

from facesynth.evaluation.geometry import marker_error
from facesynth.evaluation.pair import require_alike
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion


def diversity(samples: Sequence[Motion]) -> float:
    """Mean `marker_error` (unit of the layout) over the pairs of samples made for one utterance; N = 10 is usual."""
    if len(samples) < 2:
        raise FacesynthError(f"diversity needs at least two samples of one utterance; got {len(samples)}")
    return float(np.mean([marker_error(one, other) for one, other in combinations(samples, 2)]))


def error_of_mean(samples: Sequence[Motion], truth: Motion) -> float:
    """`marker_error` (unit of the layout) of the mean of the samples."""
    for sample in samples:
        require_alike(sample, truth)
    mean = np.mean([sample.frames.astype(np.float64) for sample in samples], axis=0)
    return marker_error(Motion(mean.astype(np.float32), samples[0].fps, samples[0].layout), truth)


def error_of_best(samples: Sequence[Motion], truth: Motion) -> float:
    """`marker_error` (unit of the layout) of the sample that is nearest to the truth."""
    return min(marker_error(sample, truth) for sample in samples)


VARIETY: Mapping[str, Callable[[Sequence[Motion], Motion], float]] = {
    "diversity": lambda samples, truth: diversity(samples),
    "error_of_mean": error_of_mean,
    "error_of_best": error_of_best,
}
"""By figure: what it is of samples and truth."""
