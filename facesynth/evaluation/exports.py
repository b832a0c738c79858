"""A comparison as files for programs and for papers."""

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.atomic import write_text
from facesynth.evaluation.compare import Evaluation
from facesynth.evaluation.contestants import Family, is_recorded
from facesynth.evaluation.curve import Curve
from facesynth.evaluation.details import Details, overall_aligned
from facesynth.evaluation.paired import statements
from facesynth.evaluation.table import Comparison, Score, short_number

WAYS = {"low": r"$\downarrow$", "high": r"$\uparrow$", "0": r"$\to 0$", "1": r"$\to 1$", "": ""}
LATEX = {"&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}"}
LATEX |= {"^": r"\textasciicircum{}", "\\": r"\textbackslash{}", "²": "$^2$", "—": "--"}


def write_exports(folder: Path, result: Evaluation, families: Sequence[Family]) -> None:
    """Everything of the page that is a number, as CSV, JSON and LaTeX."""
    comparison, curves = result.comparison, result.curves(families)
    texts = {
        "table.md": "\n".join([comparison.markdown(), *(f"{one}\n" for one in result.warnings())]),
        "table.csv": comparison.csv(),
        "table.tex": latex(comparison, result.main_columns()),
        "utterances.csv": utterances_csv(comparison),
        "comparisons.csv": comparisons_csv(result),
        "phones.csv": phones_csv(result.details),
        "emotions.csv": emotions_csv(comparison, result.main_columns()),
        "points.csv": points_csv(result),
        "trade.csv": trade_csv(curves),
        "residuals.csv": residuals_csv(result.details),
        "confusions.csv": confusions_csv(comparison),
        "report.json": report_json(result, families, curves),
    }
    for name, text in texts.items():
        write_text(folder / name, text)


def latex(comparison: Comparison, columns: Sequence[str]) -> str:
    """Tables for `booktabs`: mean with the half width of the 95 % interval, the best of each column bold.

    The first is of all utterances; each further one, under its title, of those that some row has alone.
    """
    (_, whole), *partial = comparison.tables()
    spoken = comparison.measured(columns)
    return "\n".join([_tabular(whole, columns), *(f"% {title}\n{_tabular(part, spoken)}" for title, part in partial)])


def _tabular(comparison: Comparison, columns: Sequence[str]) -> str:
    chosen = [column for column in comparison.columns if column.name in columns]
    lines = [r"\begin{tabular}{l" + "r" * len(chosen) + "}", r"\toprule"]
    heads = [escape(c.name) + (f" ({escape(c.unit)})" if c.unit != "1" else "") + " " + WAYS[c.best] for c in chosen]
    lines += [" & ".join(["", *(head.strip() for head in heads)]) + r" \\", r"\midrule"]
    best = {column.name: best_labels(comparison, column.name, column.best) for column in chosen}
    for row in comparison.rows:
        cells = [_latex_cell(comparison.scores[row.label][c.name], bold=row.label in best[c.name]) for c in chosen]
        lines.append(" & ".join([escape(row.label), *cells]) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def best_labels(comparison: Comparison, figure: str, best: str) -> set[str]:
    """Rows with the best mean of a figure; none where no way is better.

    Recordings do not compete, nor does who lacks utterances that others have.
    """
    rows = [row for row in comparison.rows if not is_recorded(row.label)]
    scores = {row.label: comparison.scores[row.label][figure] for row in rows}
    means = {label: score.mean for label, score in scores.items() if score.whole}
    known = {label: _badness(mean, best) for label, mean in means.items() if math.isfinite(mean)}
    return {label for label, bad in known.items() if bad <= min(known.values())} if best else set()


def escape(text: str) -> str:
    """Text with LaTeX's special characters taken literally."""
    return re.sub("[" + re.escape("".join(LATEX)) + "]", lambda found: LATEX[found[0]], text)


def utterances_csv(comparison: Comparison) -> str:
    """A line for each method and utterance, a column for each figure."""
    names = [c.name for c in comparison.columns if any(c.name in row.values for row in comparison.rows)]
    lines = [("method", "utterance", "sentence", "emotion", *names)]
    for row in comparison.rows:
        for i, about in enumerate(zip(comparison.utterances, comparison.sentences, comparison.emotions, strict=True)):
            lines.append((row.label, *about, *(plain(row.values[n][i]) if n in row.values else "" for n in names)))
    return to_csv(lines)


def comparisons_csv(result: Evaluation) -> str:
    """A line for each pair of methods and figure."""
    names = ("figure", "unit", "first", "second", "mean", "low", "high", "sentences", "p", "p_holm", "distinguishable")
    lines = [[_cell(getattr(one, name)) for name in names] for one in result.differences]
    return to_csv([(*names[:4], "first_is_worse_by", *names[5:]), *lines])


def phones_csv(details: Mapping[str, Details]) -> str:
    """A line for each method and phone."""
    names = ("phone", "count", "marker_error", "lip_error", "aligned_lip_error")
    lines = [[label, *(_cell(getattr(row, name)) for name in names)] for label, one in details.items() for row in one.phones]
    return to_csv([("method", *names), *lines])


def emotions_csv(comparison: Comparison, columns: Sequence[str]) -> str:
    """A line for each emotion, method and figure."""
    lines: list[Sequence[Any]] = [("emotion", "method", "figure", "mean", "low", "high", "utterances")]
    for emotion in dict.fromkeys(comparison.emotions):
        for label, scores in comparison.of_emotion(emotion).scores.items():
            chosen = [(n, s) for n, s in scores.items() if n in columns and s.utterances]
            lines += [(emotion, label, n, plain(s.mean), plain(s.low), plain(s.high), s.utterances) for n, s in chosen]
    return to_csv(lines)


def points_csv(result: Evaluation) -> str:
    """A line for each point of the face and method: its mean error."""
    lines = [(label, k, plain(float(value))) for label, one in result.details.items() for k, value in enumerate(one.points)]
    return to_csv([("method", "point", "mean_error"), *lines])


def trade_csv(curves: Sequence[Curve]) -> str:
    """A line for each point of each curve of error against movement."""
    rows = [row for curve in curves for row in curve.rows()]
    return to_csv([tuple(rows[0]), *([_cell(value) for value in row.values()] for row in rows)] if rows else [])


def residuals_csv(details: Mapping[str, Details]) -> str:
    """The histograms of lip residuals: the share of each bin, by its middle."""
    lines = []
    for label, one in details.items():
        edges = np.linspace(-one.histogram_reach, one.histogram_reach, len(one.histogram) + 1)
        bins = zip((edges[1:] + edges[:-1]) / 2, one.histogram, strict=True)
        lines += [(label, plain(float(middle)), plain(float(share))) for middle, share in bins]
    return to_csv([("method", "residual", "share"), *lines])


def confusions_csv(comparison: Comparison) -> str:
    """Which emotion was asked and which recognised, how often; of the recordings too."""
    matrices = {"recorded": comparison.recorded_emotions, **{row.label: row.confusion for row in comparison.rows}}
    lines = [
        (label, matrix.emotions[i], matrix.emotions[j], int(count))
        for label, matrix in matrices.items()
        if matrix is not None
        for (i, j), count in np.ndenumerate(matrix.counts)
    ]
    return to_csv([("method", "asked", "recognised", "utterances"), *lines])


def report_json(result: Evaluation, families: Sequence[Family], curves: Sequence[Curve]) -> str:
    """Everything, for programs."""
    whole: dict[str, Any] = json.loads(result.comparison.json())
    whole["overall"] = {label: dict(overall_aligned(one.phones)) for label, one in result.details.items()}
    whole["comparisons"] = [vars(one) | {"distinguishable": one.distinguishable} for one in result.differences]
    whole["statements"] = dict(statements(result.differences))
    whole["folds"] = [{"train": fold.train, "test": fold.test} for fold in result.folds]
    whole["made_of"] = {label: list(accounts) for label, accounts in result.accounts.items()}
    whole["curves"] = [row for curve in curves for row in curve.rows()]
    whole["families"] = [vars(family) for family in families]
    return json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def to_csv(lines: Iterable[Sequence[Any]]) -> str:
    """Lines of cells as CSV with Unix line ends."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    return text.getvalue()


def plain(value: float) -> str:
    """A number for a file; nothing for NaN."""
    return f"{value:.8g}" if math.isfinite(value) else ""


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return plain(value) if isinstance(value, float) else str(value)


def _badness(mean: float, best: str) -> float:
    return {"low": mean, "high": -mean}.get(best, abs(mean - float(best if best in ("0", "1") else 0)))


def _latex_cell(score: Score, *, bold: bool) -> str:
    if not score.utterances:
        return "--"
    text = rf"\textbf{{{short_number(score.mean)}}}" if bold else short_number(score.mean)
    half = rf" {{\scriptsize$\pm${short_number((score.high - score.low) / 2)}}}" if score.low < score.high else ""
    return text + half + ("" if score.whole else rf" {{\scriptsize({score.utterances} of {score.of})}}")
