"""What a model of noise assumes of its residuals, tested: that they are white, and that their sources are independent.

White: the autocorrelations r_k of N samples, up to lag h, are as small as chance makes them. Ljung and Box (1978):

    Q = N (N + 2) sum over k of r_k² / (N - k)   is distributed as chi-squared with h degrees of freedom.

Independent: the mutual information of two sources, from a table of their ranks in b classes each, is as small as chance makes
it: 2 N I is distributed as chi-squared with (b - 1)² degrees of freedom, and half of those over N is what chance adds to I.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.stats import chi2, rankdata

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError

LAGS = 10
CLASSES = 8


def ljung_box(clips: Sequence[Floats], lags: int = LAGS) -> tuple[float, float]:
    """Q, and the chance of one as large from white noise, of a signal in clips [T] that do not go on in one another."""
    count = sum(len(clip) for clip in clips)
    if not 1 <= lags < min(map(len, clips), default=0):
        raise FacesynthError(f"{lags} lags need clips of more samples; got {[len(clip) for clip in clips][:5]}")
    mean = np.concatenate(clips).mean()
    signals = [clip - mean for clip in clips]
    power = sum(float(signal @ signal) for signal in signals)
    if not power > 0:
        raise FacesynthError("the residuals are constant: nothing can be said about their whiteness")
    shares = [sum(float(s[k:] @ s[:-k]) for s in signals) / power for k in range(1, lags + 1)]
    pairs = [count - k * len(clips) for k in range(1, lags + 1)]
    q = count * (count + 2) * sum(share**2 / n for share, n in zip(shares, pairs, strict=True))
    return q, float(chi2.sf(q, lags))


def mutual_information(x: Floats, y: Floats, classes: int = CLASSES) -> tuple[float, float]:
    """Mutual information (nats, less what chance adds) of two signals [N], and the chance of as much from independent ones."""
    if len(x) != len(y) or len(x) < 5 * classes**2:
        raise FacesynthError(f"mutual information needs two signals of {5 * classes**2} samples or more; got {len(x)}, {len(y)}")
    table = np.zeros((classes, classes))
    np.add.at(table, (_classes(x, classes), _classes(y, classes)), 1 / len(x))
    independent = table.sum(axis=1, keepdims=True) * table.sum(axis=0)
    found = table > 0
    information = float((table[found] * np.log(table[found] / independent[found])).sum())
    freedom = (classes - 1) ** 2
    return information - freedom / (2 * len(x)), float(chi2.sf(2 * len(x) * information, freedom))


def pairwise_information(sources: Floats) -> tuple[float, float]:
    """Of sources [N, p]: mean mutual information of a pair, and the share of pairs that may be independent (chance over .05)."""
    found = [mutual_information(sources[:, i], sources[:, j]) for i, j in combinations(range(sources.shape[1]), 2)]
    return float(np.mean([one for one, _ in found])), float(np.mean([chance > 0.05 for _, chance in found]))


def _classes(x: Floats, count: int) -> np.ndarray:
    """[N] class by rank, all equally full."""
    return ((rankdata(x, method="ordinal") - 1) * count // len(x)).astype(np.int64)
