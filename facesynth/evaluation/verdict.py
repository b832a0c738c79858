"""Whether each method is worth more than the mean face, and where its error lies: computed, so that nobody need believe."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facesynth.evaluation.compare import Evaluation
from facesynth.evaluation.contestants import is_recorded
from facesynth.evaluation.curve import Point
from facesynth.evaluation.paired import Difference
from facesynth.evaluation.table import short_number

MEAN_FACE = "mean face"
FIGURES = ("marker_error", "lve")
HARDLY = 0.98
"""Movement at its best size that leaves more than this share of the error of standing still brings next to nothing."""


@dataclass(frozen=True)
class Verdict:
    """One method beside the mean face."""

    label: str
    good: bool
    """Better than the mean face by marker error and by lip error, on average over the utterances that both have."""
    text: str
    unsure: tuple[str, ...]
    """Figures by which it is not told apart from the mean face."""


def verdicts(result: Evaluation) -> list[Verdict]:
    """A sentence or two on each method; nothing where there is no mean face to compare with."""
    labels = [row.label for row in result.comparison.rows if row.label != MEAN_FACE and not is_recorded(row.label)]
    scores = result.comparison.scores
    if MEAN_FACE not in scores:
        return []
    return [_verdict(result, label) for label in labels if any(scores[label][figure].utterances for figure in FIGURES)]


def _verdict(result: Evaluation, label: str) -> Verdict:
    parts, lost, unsure = list[str](), list[str](), list[str]()
    units = {column.name: column.unit for column in result.comparison.columns}
    for figure in FIGURES:
        mine, still, count = _common(result, (label, figure), (MEAN_FACE, figure))
        if not count:
            continue
        way = "less"
        if mine >= still:
            way = "MORE"
            lost.append(figure)
        if not _sure(result.differences, label, figure):
            unsure.append(figure)
        parts.append(
            f"{figure} {short_number(mine)} {units[figure]}, {way} than the mean face's {short_number(still)}"
            f" ({'not told apart' if figure in unsure else 'told apart'}{_of_how_many(result, figure, count)})"
        )
    why = " ".join(["", *reasons(result, label, lost)]) if lost else ""
    return Verdict(label, not lost, f"{'; '.join(parts)}.{why}", tuple(unsure))


def reasons(result: Evaluation, label: str, lost: Sequence[str]) -> list[str]:
    """Sentences on where the error comes from: the pose held, the movement made, and what is drawn from chance."""
    found = ["Over the lips it is better; it loses over the rest of the face."] if lost == ["marker_error"] else []
    trade = sorted((p for p in result.details[label].trade if p.sharpening == 0), key=lambda point: point.gain)
    if not trade:
        return [*found, "The layout does not tell lip error by size of movement."]
    _, unmoved, _ = _common(result, (label, "lve"), (MEAN_FACE, "lve"))
    return [*found, _pose(trade[0], unmoved), _movement(trade), *_chance(result, label)]


def _pose(still: Point, unmoved: float) -> str:
    words = f"Standing still in the mean pose of each of its utterances it would have an lve of {short_number(still.lve)}"
    if still.lve < unmoved:
        return f"{words}, less than the mean face's {short_number(unmoved)}: how it holds the face is not the fault."
    return (
        f"{words}, and the mean face has {short_number(unmoved)}: "
        "how it holds the face in an utterance is no nearer to the recording than the mean of all recordings."
    )


def _movement(trade: Sequence[Point]) -> str:
    """`trade` by rising gain."""
    whole, best = next(point for point in trade if point.gain == 1.0), min(trade, key=lambda point: point.lve)
    words = f"It moves {short_number(whole.energy_ratio)} times as much as recorded"
    if best.lve > HARDLY * trade[0].lve:
        return f"{words}, and next to nothing of that movement follows the recorded one."
    if best.gain < 1:
        nearest = f"nearest ({short_number(best.lve)}) moving {best.gain:g} times as far"
        return f"{words}, and would be {nearest}: it follows the recorded movement in part."
    return f"{words}, and moving less would not bring it nearer."


def _chance(result: Evaluation, label: str) -> list[str]:
    scores = result.comparison.scores[label]
    if not scores["error_of_mean"].utterances:
        return []
    mean, still, _ = _common(result, (label, "error_of_mean"), (MEAN_FACE, "marker_error"))
    side = "less" if mean < still else "no less"
    return [
        f"It draws from chance: the mean of several drawn motions has a marker_error of {short_number(mean)}, "
        f"{side} than the mean face; a single one has {short_number(scores['marker_error'].mean)}."
    ]


def _common(result: Evaluation, *wanted: tuple[str, str]) -> tuple[float, float, int]:
    """Means of two (row label, figure) over the utterances that both have, and how many these are."""
    rows = {row.label: row.values for row in result.comparison.rows}
    missing = [np.nan] * len(result.comparison.utterances)
    values = np.array([rows[label].get(figure, missing) for label, figure in wanted], np.float64)
    both = values[:, ~np.isnan(values).any(axis=0)]
    mine, still = both.mean(axis=1) if both.size else (np.nan, np.nan)
    return float(mine), float(still), both.shape[1]


def _of_how_many(result: Evaluation, figure: str, count: int) -> str:
    possible = result.comparison.possible[figure]
    return f", on {count} of {possible} utterances" if count < possible else ""


def _sure(differences: tuple[Difference, ...], label: str, figure: str) -> bool:
    return any(
        one.figure == figure and {one.first, one.second} == {label, MEAN_FACE} and one.distinguishable for one in differences
    )
