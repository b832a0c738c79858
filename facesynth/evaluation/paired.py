"""Which methods can be told apart: paired differences, bootstrapped over sentences, corrected for how many are looked at."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from facesynth.evaluation.contestants import is_recorded
from facesynth.evaluation.table import Column, Comparison, Row
from facesynth.inference.arrays import Floats

COMPARED = (
    "marker_error", "lve", "lve_centred", "velocity_error", "fdd_abs", "lip_gap_corr", "closure_rate",
    "false_closure_rate", "energy_ratio", "emotion_accuracy",
)  # fmt: skip
"""Figures that are compared: each further one makes all the others harder to tell apart."""
DRAWS = 100_000
"""Bootstrap samples."""
CHUNK, WIDTH = 5_000, 128
"""Samples and differences that are computed at once."""
LEVEL = 0.05
MOST_NAMED = 12
"""Pairs that cannot be told apart are named one by one up to so many."""


@dataclass(frozen=True)
class Difference:
    """Two methods by one figure, on the utterances that both have."""

    figure: str
    unit: str
    first: str
    second: str
    mean: float
    """How much worse the first is (unit): of |x - 0| or |x - 1| where that value is best, of -x where high is."""
    low: float
    high: float
    """95 % bootstrap interval over sentences, of this difference alone."""
    sentences: int
    p: float
    """Two-sided, of this difference alone."""
    p_holm: float = 1.0
    """Corrected for all pairs and figures compared."""

    @property
    def distinguishable(self) -> bool:
        """Whether it stands after the correction (5 %)."""
        return self.p_holm < LEVEL

    @property
    def better(self) -> str:
        """The method with the better mean."""
        return self.second if self.mean > 0 else self.first


def compare_pairs(comparison: Comparison, figures: Sequence[str] = COMPARED) -> tuple[Difference, ...]:
    """Every pair of methods by every figure, with Holm's correction over all of them; the second take is no method.

    A sentence's difference is the mean over its utterances: emotions and takes of one sentence are not independent.
    Sentences are drawn with replacement; p is twice the share of samples whose mean has the other sign. Where none has,
    p is that of Student's t of the mean, for the correction over thousands of pairs asks for less than any number of
    samples resolves. Few sentences make both too sure of themselves, so p is never below 2^(1 - n), what a sign test of n
    sentences could reach.
    """
    sentences = np.unique(comparison.sentences, return_inverse=True)[1]
    columns = [column for column in comparison.columns if column.name in figures]
    found: list[tuple[Column, Row, Row, Floats]] = []
    for column in columns:
        for first, second in combinations([row for row in comparison.rows if not is_recorded(row.label)], 2):
            worse = _worse(first, column, len(sentences)) - _worse(second, column, len(sentences))
            by_sentence = _by_sentence(worse, sentences)
            if (~np.isnan(by_sentence)).sum() >= 2:
                found.append((column, first, second, by_sentence))
    if not found:
        return ()
    table = np.stack([f[3] for f in found], axis=1)
    bounds = [one for k in range(0, len(found), WIDTH) for one in bootstrap(table[:, k : k + WIDTH], comparison.seed, DRAWS)]
    tested = [
        Difference(c.name, c.unit, a.label, b.label, float(np.nanmean(d)), low, high, int((~np.isnan(d)).sum()), p)
        for (c, a, b, d), (low, high, p) in zip(found, bounds, strict=True)
    ]
    corrected = holm([one.p for one in tested])
    return tuple(Difference(**{**vars(one), "p_holm": p}) for one, p in zip(tested, corrected, strict=True))


def bootstrap(differences: Floats, seed: int, draws: int) -> list[tuple[float, float, float]]:
    """2.5 %, 97.5 % and two-sided p of each column's mean, from differences [S, M] by sentence; NaN is left out.

    The same samples of sentences serve every column.
    """
    count = len(differences)
    present = ~np.isnan(differences)
    values = np.where(present, differences, 0.0)
    rng = np.random.default_rng(seed)
    means = []
    for _ in range(0, draws, CHUNK):
        times = rng.multinomial(count, np.full(count, 1 / count), size=CHUNK).astype(np.float64)
        seen = times @ present
        means.append(np.divide(times @ values, seen, out=np.zeros_like(seen), where=seen > 0).astype(np.float32))
    drawn = np.ascontiguousarray(np.concatenate(means).T)
    low, high = np.percentile(drawn, [2.5, 97.5], axis=1)
    tail = np.minimum((drawn <= 0).mean(axis=1), (drawn >= 0).mean(axis=1))
    seen = present.sum(axis=0)
    p = np.where(tail > 0, 2 * tail, np.minimum(1 / draws, _far_tail(drawn, seen)))
    p = np.clip(p, 2.0 ** (1 - seen), 1.0)
    p[(values == 0).all(axis=0)] = 1.0
    return [(float(a), float(b), float(c)) for a, b, c in zip(low, high, p, strict=True)]


def _far_tail(drawn: NDArray[np.float32], sentences: NDArray[np.int64]) -> Floats:
    """[M] two-sided p of Student's t, of means drawn [M, draws] from so many sentences [M] each."""
    spread = drawn.std(axis=1, dtype=np.float64) * np.sqrt(sentences / (sentences - 1))
    mean = np.abs(drawn.mean(axis=1, dtype=np.float64))
    steps = np.divide(mean, spread, out=np.full(len(mean), np.inf), where=spread > 0)
    return np.asarray(2 * student.sf(steps, sentences - 1))


def holm(p: Sequence[float]) -> list[float]:
    """Holm's step-down correction: sorted p times the number of hypotheses left, never falling, at most 1."""
    values = np.asarray(p, np.float64)
    order = np.argsort(values, kind="stable")
    stepped = np.maximum.accumulate(values[order] * (len(values) - np.arange(len(values))))
    corrected = np.empty(len(values))
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected.tolist()


def statements(differences: Sequence[Difference]) -> list[tuple[str, str]]:
    """(figure, plain words) for each figure: who is better than whom, and which pairs cannot be told apart."""
    return [
        (figure, _statement([one for one in differences if one.figure == figure]))
        for figure in dict.fromkeys(one.figure for one in differences)
    ]


def tallied(differences: Sequence[Difference]) -> dict[str, dict[str, tuple[int, int]]]:
    """For each method and figure: from how many it is told apart as the better one, and as the worse one."""
    found: dict[str, dict[str, tuple[int, int]]] = {}
    for one in differences:
        for label in (one.first, one.second):
            won, lost = found.setdefault(label, {}).get(one.figure, (0, 0))
            better = one.distinguishable and label == one.better
            found[label][one.figure] = (won + better, lost + (one.distinguishable and not better))
    return found


def _statement(pairs: Sequence[Difference]) -> str:
    beaten: dict[str, list[str]] = {}
    for one in pairs:
        if one.distinguishable:
            beaten.setdefault(one.better, []).append(one.first if one.better == one.second else one.second)
    alike = [f"{one.first} and {one.second}" for one in pairs if not one.distinguishable]
    if not beaten:
        return "no two methods can be told apart."
    ranked = sorted(beaten.items(), key=lambda item: (-len(item[1]), item[0]))
    text = "; ".join(f"{winner} is better than {', '.join(losers)}" for winner, losers in ranked)
    if len(alike) > MOST_NAMED:
        return f"{text}. The other {len(alike)} of {len(pairs)} pairs are not told apart."
    return f"{text}. Not to be told apart: {'; '.join(alike)}." if alike else f"{text}. Every pair is told apart."


def _worse(row: Row, column: Column, count: int) -> Floats:
    """[U] the figure turned so that more is worse; NaN where the row has none."""
    values = np.asarray(row.values.get(column.name, [np.nan] * count), np.float64)
    if column.best in ("0", "1"):
        return np.abs(values - float(column.best))
    return -values if column.best == "high" else values


def _by_sentence(values: Floats, sentences: NDArray[np.int64]) -> Floats:
    """[S] mean of the utterances of each sentence; NaN where none has a value."""
    seen = ~np.isnan(values)
    total = np.bincount(sentences, weights=np.where(seen, values, 0.0))
    count = np.bincount(sentences, weights=seen)
    return np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
