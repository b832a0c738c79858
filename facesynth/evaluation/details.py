"""Where the error of a method lies: at which phones, on which points, how it is spread, and what it trades for movement."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation.curve import Point, compromises, mean_points
from facesynth.evaluation.pair import Array, UnavailableError, distances, paired_points
from facesynth.evaluation.regions import lip_points
from facesynth.evaluation.time_alignment import aligned_distances
from facesynth.inference.motion import Motion
from facesynth.inference.phones import SILENCE

BINS = 61
HISTOGRAM_SPREADS = 3.0
"""The residual histogram reaches so many standard deviations of the recorded lip movement either way."""


@dataclass(frozen=True)
class PhoneError:
    """Mean errors over the frames of one phone, in the unit of the layout."""

    phone: str
    count: int
    """How often the phone is said."""
    marker_error: float
    lip_error: float
    """Mean distance of the lip points, frame by frame."""
    aligned_lip_error: float
    """The same after the frames are matched in time (`aligned_distances`)."""


@dataclass(frozen=True, eq=False)
class Details:
    """Where the error of one method lies."""

    phones: tuple[PhoneError, ...] = ()
    points: Array = field(default_factory=lambda: np.zeros(0))
    """[K] mean distance of each point; NaN where the truth never has it."""
    histogram: Array = field(default_factory=lambda: np.zeros(0))
    """[BINS] share of the lip residuals (synthesised - recorded, each coordinate) in each bin."""
    histogram_reach: float = 0.0
    """Outer edges of the bins, ± in the unit of the layout; the outer bins hold what lies beyond."""
    residual_mean: float = 0.0
    residual_spread: float = 0.0
    """Standard deviation of the lip residuals, those beyond the histogram as they are; unit of the layout."""
    residual_kurtosis: float = 0.0
    """Their excess kurtosis; 0 = normal."""
    trade: tuple[Point, ...] = ()
    """What the method would score with its movement changed, see `compromises`."""


def residual_reach(utterances: Iterable[Utterance]) -> float:
    """Reach of the residual histograms of all methods: 3 standard deviations of the recorded lip movement."""
    spreads = []
    for utterance in utterances:
        try:
            lips = utterance.motion.points[:, lip_points(utterance.motion.layout)].astype(np.float64)
        except UnavailableError:
            return 0.0
        seen = ~np.isnan(lips)
        mean = np.where(seen, lips, 0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        spreads.append(float((np.where(seen, lips - mean, 0) ** 2).sum() / max(seen.sum(), 1)))
    return HISTOGRAM_SPREADS * float(np.sqrt(np.mean(spreads))) if spreads else 0.0


class DetailSums:
    """Sums over utterances, from which `Details` come."""

    def __init__(self, reach: float) -> None:
        self.reach = reach
        self.phones: dict[str, list[Array]] = {}
        self.points: list[tuple[Array, Array]] = []
        self.histogram = np.zeros(BINS)
        self.powers = np.zeros(5)
        """Sums of the lip residuals to the powers of 0 to 4."""
        self.trade: list[Array] = []

    def add(self, utterance: Utterance, motion: Motion) -> None:
        """Count one utterance."""
        mine, yours = paired_points(motion, utterance.motion)
        apart = distances(mine, yours)
        self.points.append((np.where(np.isnan(apart), 0, apart).sum(axis=0), (~np.isnan(apart)).sum(axis=0)))
        try:
            lips = lip_points(motion.layout)
        except UnavailableError:
            return
        aligned = aligned_distances(mine[:, lips], yours[:, lips], motion.fps)
        self._add_phones(utterance, np.stack([_mean(apart), _mean(apart[:, lips]), aligned], axis=1))
        self._add_residuals(mine[:, lips] - yours[:, lips])
        self._add_trade(motion, utterance.motion)

    def details(self) -> Details:
        """What was counted."""
        if not self.points:
            return Details()
        total, count = (np.sum(part, axis=0) for part in zip(*self.points, strict=True))
        points = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
        counted = self.histogram.sum()
        histogram = self.histogram / counted if counted else self.histogram
        return Details(self._phone_errors(), points, histogram, self.reach, *_shape(self.powers), trade=mean_points(self.trade))

    def _add_phones(self, utterance: Utterance, errors: Array) -> None:
        bounds = utterance.speech.phones.frame_bounds(utterance.motion.fps)
        for label, (start, stop) in zip(utterance.speech.phones.labels, pairwise(bounds), strict=True):
            part = errors[start:stop]
            if len(part) and not np.isnan(part).all(axis=0).any():
                self.phones.setdefault(label, []).append(np.nanmean(part, axis=0))

    def _add_residuals(self, residuals: Array) -> None:
        """Residuals beyond the outer edges count in the outer bins, and as what they are in the powers."""
        present = residuals[~np.isnan(residuals)]
        self.powers += [(present**power).sum() for power in range(5)]
        if self.reach > 0:
            self.histogram += np.histogram(np.clip(present, -self.reach, self.reach), BINS, (-self.reach, self.reach))[0]

    def _add_trade(self, motion: Motion, truth: Motion) -> None:
        try:
            self.trade.append(compromises(motion, truth))
        except UnavailableError:
            return

    def _phone_errors(self) -> tuple[PhoneError, ...]:
        rows = [
            PhoneError(label, len(errors), *map(float, np.mean(errors, axis=0)))
            for label, errors in sorted(self.phones.items())
            if label != SILENCE
        ]
        return tuple(sorted(rows, key=lambda row: (-row.count, row.phone)))


def overall_aligned(phones: Iterable[PhoneError]) -> Mapping[str, float]:
    """The three errors averaged over everything that is said, each phone as often as it is."""
    rows = tuple(phones)
    count = sum(row.count for row in rows)
    names = ("marker_error", "lip_error", "aligned_lip_error")
    return {name: sum(getattr(row, name) * row.count for row in rows) / count for name in names} if count else {}


def _shape(powers: Array) -> tuple[float, float, float]:
    """Mean, standard deviation and excess kurtosis from sums of powers 0 to 4; 0 where nothing is spread."""
    if not powers[0]:
        return 0.0, 0.0, 0.0
    mean, second, third, fourth = powers[1:] / powers[0]
    variance = second - mean**2
    if not variance > 1e-12 * second:
        return float(mean), 0.0, 0.0
    about_mean = fourth - 4 * mean * third + 6 * mean**2 * second - 3 * mean**4
    return float(mean), float(np.sqrt(variance)), float(about_mean / variance**2 - 3)


def _mean(apart: Array) -> Array:
    """[T] mean over the points that the frame has; NaN where it has none."""
    seen = ~np.isnan(apart)
    total, count = np.where(seen, apart, 0.0).sum(axis=1), seen.sum(axis=1)
    return np.divide(total, count, out=np.full(len(apart), np.nan), where=count > 0)
