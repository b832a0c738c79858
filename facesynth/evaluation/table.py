"""What came out of a comparison, as a table for people and as files for programs."""

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from facesynth.evaluation.emotion_recognition import Confusion
from facesynth.inference.errors import unknown

DRAWS = 2000
"""Bootstrap samples of the sentences."""
ARROWS: Mapping[str, str] = {"low": " ↓", "high": " ↑", "0": " → 0", "1": " → 1", "": ""}


@dataclass(frozen=True)
class Column:
    """One figure."""

    name: str
    unit: str
    best: str = ""
    """low, high, 0, 1, or nothing where no way is better."""


@dataclass(frozen=True)
class Row:
    """One method."""

    label: str
    values: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """By column: the figure of each utterance, NaN where it has none."""
    costs: Mapping[str, float] = field(default_factory=dict)
    """By column: figures of the whole run, which have no interval."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """By column: why utterances have no figure."""
    confusion: Confusion | None = None


@dataclass(frozen=True)
class Score:
    """Mean over the utterances that have a figure, with its 95 % bootstrap interval over sentences."""

    mean: float
    low: float
    high: float
    utterances: int
    of: int
    """Utterances of which anybody can have the figure."""

    def __str__(self) -> str:
        if not self.utterances:
            return "—"
        bounds = f" [{short_number(self.low)}, {short_number(self.high)}]" if self.low < self.high else ""
        return short_number(self.mean) + bounds + ("" if self.whole else f" ({self.utterances} of {self.of})")

    @property
    def whole(self) -> bool:
        """Whether no utterance is missing: means over other utterances are not compared."""
        return self.utterances == self.of


@dataclass(frozen=True)
class Comparison:
    """Methods judged on the same utterances."""

    columns: tuple[Column, ...]
    utterances: tuple[str, ...]
    rows: tuple[Row, ...]
    seed: int
    recorded_emotions: Confusion | None = None
    """What the emotion classifier makes of the recordings themselves: the most that a method can reach."""
    provenance: Mapping[str, object] = field(default_factory=dict)
    """The recordings learned from and judged by, and what the figures were computed with."""
    sentences: tuple[str, ...] = ()
    """Of each utterance: equal for the same words in other emotions and takes."""
    emotions: tuple[str, ...] = ()
    """Of each utterance."""

    @cached_property
    def scores(self) -> Mapping[str, Mapping[str, Score]]:
        """By row label and column name."""
        return {row.label: {column.name: self._score(row, column.name) for column in self.columns} for row in self.rows}

    @cached_property
    def possible(self) -> Mapping[str, int]:
        """By column name: of how many utterances some row has the figure, or no row has anything."""
        count = len(self.utterances)
        present = {
            column.name: [~np.isnan(row.values.get(column.name, [math.nan] * count)) for row in self.rows]
            for column in self.columns
        }
        silent = ~np.any([one for seen in present.values() for one in seen], axis=0)
        return {name: int((np.any(seen, axis=0) | silent).sum()) for name, seen in present.items()}

    def of_emotion(self, emotion: str) -> "Comparison":
        """The same methods on the utterances of one emotion; figures of the whole run are left out."""
        return self._of([i for i, one in enumerate(self.emotions) if one == emotion], self.rows)

    @cached_property
    def missing(self) -> Mapping[str, frozenset[int]]:
        """By row label: utterances of which it has no figure although others have; none for a row that has no figure at all."""
        count = len(self.utterances)
        has = {row.label: _known_of(row, count) for row in self.rows}
        anybody = np.any(list(has.values()), axis=0) if has else np.zeros(count, bool)
        return {
            label: frozenset(np.flatnonzero(anybody & ~own).tolist()) if own.any() else frozenset() for label, own in has.items()
        }

    def tables(self) -> "list[tuple[str, Comparison]]":
        """The same as tables with titles, in each of which all rows are of the same utterances.

        The first, without a title, has the rows of all utterances. A row that lacks some is in one of its own, beside all
        rows that have what it has; figures of the whole run are left out there.
        """
        whole = tuple(row for row in self.rows if not self.missing[row.label])
        found = [("", replace(self, rows=whole))]
        for gap in dict.fromkeys(missing for missing in self.missing.values() if missing):
            labels = ", ".join(label for label, missing in self.missing.items() if missing == gap)
            chosen = [i for i in range(len(self.utterances)) if i not in gap]
            spoken = [row for row in self.rows if _known_of(row, len(self.utterances)).any()]
            rows = [row for row in spoken if self.missing[row.label] <= gap]
            found.append((f"On the {len(chosen)} of {len(self.utterances)} utterances of {labels}:", self._of(chosen, rows)))
        return found

    def measured(self, columns: Sequence[str]) -> list[str]:
        """Those of the columns that are figures of utterances."""
        return [name for name in columns if any(name in row.values for row in self.rows)]

    def _of(self, chosen: Sequence[int], rows: Sequence[Row]) -> "Comparison":
        parts = tuple(
            Row(row.label, {name: tuple(values[i] for i in chosen) for name, values in row.values.items()}, {}, row.reasons)
            for row in rows
        )
        of_each = (self.utterances, self.sentences, self.emotions)
        names, sentences, emotions = (tuple(of[i] for i in chosen if of) for of in of_each)
        return Comparison(self.columns, names, parts, self.seed, sentences=sentences, emotions=emotions)

    def markdown(self, columns: Sequence[str] | None = None) -> str:
        """A table, a row per method: mean [95 % interval]; then those of rows that lack utterances (see `tables`), and why
        figures are missing.
        """
        (_, whole), *partial = self.tables()
        names = list(columns) if columns else [column.name for column in self.columns]
        spoken = self.measured(names)
        tables = [whole._markdown(names), *(f"{title}\n\n{part._markdown(spoken)}" for title, part in partial)]
        return "\n\n".join([*tables, *self.notes(names)]) + "\n"

    def _markdown(self, columns: Sequence[str]) -> str:
        chosen = [self._column(name) for name in columns]
        header = [
            "method",
            *(f"{c.name} ({c.unit}){ARROWS[c.best]}" if c.unit != "1" else c.name + ARROWS[c.best] for c in chosen),
        ]
        lines = [header, ["---"] + ["---:"] * len(chosen)]
        lines += [[row.label, *(str(self.scores[row.label][c.name]) for c in chosen)] for row in self.rows]
        return "\n".join("| " + " | ".join(line) + " |" for line in lines)

    def csv(self) -> str:
        """A line per method and figure: mean, interval, number of utterances, and why some are missing."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(("method", "figure", "unit", "best", "mean", "low", "high", "utterances", "reason"))
        for row in self.rows:
            for column in self.columns:
                score = self.scores[row.label][column.name]
                figures = [_plain(value) for value in (score.mean, score.low, score.high)]
                names = (row.label, column.name, column.unit, column.best)
                writer.writerow((*names, *figures, score.utterances, row.reasons.get(column.name, "")))
        return text.getvalue()

    def json(self) -> str:
        """Everything, each utterance's figures included; null where there is none."""
        plain = {
            "seed": self.seed,
            "utterances": self.utterances,
            "sentences": self.sentences,
            "emotions": self.emotions,
            "columns": [{"name": c.name, "unit": c.unit, "best": c.best} for c in self.columns],
            "rows": [self._row_dict(row) for row in self.rows],
            "recorded_emotions": _confusion_dict(self.recorded_emotions),
            "provenance": self.provenance,
        }
        return json.dumps(plain, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def _score(self, row: Row, column: str) -> Score:
        if column in row.costs:  # one figure of the whole run
            cost = row.costs[column]
            count = len(self.utterances)
            return Score(cost, cost, cost, 0 if math.isnan(cost) else count, count)
        values = np.array(row.values.get(column, ()), np.float64)
        present = np.flatnonzero(~np.isnan(values))
        if not present.size:
            return Score(math.nan, math.nan, math.nan, 0, self.possible[column])
        sentences = [(self.sentences or self.utterances)[i] for i in present]
        bounds = interval(values[present], sentences, self.seed)
        return Score(float(values[present].mean()), *bounds, len(present), self.possible[column])

    def _column(self, name: str) -> Column:
        for column in self.columns:
            if column.name == name:
                return column
        raise unknown("figure", name, (column.name for column in self.columns))

    def notes(self, columns: Sequence[str]) -> list[str]:
        """Reasons for missing figures, one for each, and the ceiling of the emotion classifier."""
        chosen = [self._column(name) for name in columns]
        labels: dict[tuple[str, str], list[str]] = {}
        for column in chosen:
            for row in self.rows:
                if not self.scores[row.label][column.name].utterances:
                    reason = row.reasons.get(column.name, "the method does not report it")
                    labels.setdefault((column.name, reason), []).append(row.label)
        figures: dict[tuple[str, str], list[str]] = {}
        for (name, reason), without in labels.items():
            figures.setdefault((reason, ", ".join(without)), []).append(name)
        notes = [f"— {', '.join(names)}: {reason} ({without})" for (reason, without), names in figures.items()]
        if self.recorded_emotions and any(column.name == "emotion_accuracy" for column in chosen):
            recall = short_number(self.recorded_emotions.unweighted_average_recall)
            accuracy = short_number(self.recorded_emotions.accuracy)
            notes.append(f"The recordings themselves: emotion accuracy {accuracy}, unweighted average recall {recall}.")
        return notes

    def _row_dict(self, row: Row) -> dict[str, object]:
        return {
            "label": row.label,
            "scores": {
                name: {"mean": _finite(s.mean), "low": _finite(s.low), "high": _finite(s.high), "utterances": s.utterances}
                for name, s in self.scores[row.label].items()
            },
            "values": {name: [_finite(value) for value in values] for name, values in row.values.items()},
            "reasons": dict(row.reasons),
            "confusion": _confusion_dict(row.confusion),
        }


def _known_of(row: Row, count: int) -> NDArray[np.bool_]:
    """[U] whether a row has any figure of each utterance."""
    known = np.zeros(count, bool)
    for values in row.values.values():
        known |= ~np.isnan(np.asarray(values, np.float64))
    return known


def interval(values: NDArray[np.float64], sentences: Sequence[str], seed: int) -> tuple[float, float]:
    """2.5 and 97.5 % of the means of DRAWS samples of the sentences of values [U], drawn with replacement.

    A sentence brings all its utterances: emotions and takes of the same words are not independent.
    """
    codes = np.unique(sentences, return_inverse=True)[1]
    totals, counts = np.bincount(codes, values - values[0]), np.bincount(codes)  # from the first: equal values stay equal
    draws = np.random.default_rng(seed).integers(len(counts), size=(DRAWS, len(counts)))
    means = values[0] + totals[draws].sum(axis=1) / counts[draws].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


def _confusion_dict(confusion: Confusion | None) -> dict[str, object] | None:
    if confusion is None:
        return None
    return {
        "emotions": confusion.emotions,
        "asked_by_recognised": confusion.counts.tolist(),
        "accuracy": _finite(confusion.accuracy),
        "unweighted_average_recall": _finite(confusion.unweighted_average_recall),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _plain(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def short_number(value: float) -> str:
    """Three significant digits, never in exponents."""
    if value == 0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 5)}f}"
