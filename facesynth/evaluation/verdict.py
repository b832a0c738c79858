"""Whether each method is worth more than the mean face, and where its error lies: computed, so that nobody need believe."""

from __future__ import annotations

from dataclasses import dataclass

from facesynth.evaluation.compare import Evaluation
from facesynth.evaluation.contestants import SECOND_TAKE
from facesynth.evaluation.paired import Difference
from facesynth.evaluation.table import short_number

MEAN_FACE = "mean face"
FIGURES = ("marker_error", "lve")


@dataclass(frozen=True)
class Verdict:
    """One method beside the mean face."""

    label: str
    good: bool
    """Better than the mean face by marker error and by lip error, on average."""
    text: str


def verdicts(result: Evaluation) -> list[Verdict]:
    """A sentence or two on each method; nothing where there is no mean face to compare with."""
    labels = [row.label for row in result.comparison.rows if row.label not in (SECOND_TAKE, MEAN_FACE)]
    if MEAN_FACE not in result.comparison.scores:
        return []
    return [_verdict(result, label) for label in labels]


def _verdict(result: Evaluation, label: str) -> Verdict:
    scores, parts, good = result.comparison.scores, [], True
    units = {column.name: column.unit for column in result.comparison.columns}
    for figure in FIGURES:
        mine, still = scores[label][figure], scores[MEAN_FACE][figure]
        if not mine.utterances or not still.utterances:
            continue
        good = good and mine.mean < still.mean
        sure = _sure(result.differences, label, figure)
        way = "less" if mine.mean < still.mean else "MORE"
        parts.append(
            f"{figure} {short_number(mine.mean)} {units[figure]}, {way} than the mean face's {short_number(still.mean)}"
            f" ({'told apart' if sure else 'not told apart'})"
        )
    why = "" if good else " " + reason(result, label)
    return Verdict(label, good, f"{'; '.join(parts)}.{why}")


def reason(result: Evaluation, label: str) -> str:
    """Which part of the lip error is movement and which the pose held, from the curve of sizes of movement."""
    trade = sorted((p for p in result.details[label].trade if p.sharpening == 0), key=lambda point: point.gain)
    if not trade:
        return "The layout does not tell lip error by size of movement."
    whole = next(point for point in trade if point.gain == 1.0)
    still, best = trade[0], min(trade, key=lambda point: point.lve)
    unmoved = result.comparison.scores[MEAN_FACE]["lve"].mean
    parts = [
        f"Held still at each utterance's own mean pose it would have an lve of {short_number(still.lve)} "
        f"(the mean face: {short_number(unmoved)})"
    ]
    if still.lve > unmoved:
        parts.append("so the pose that it holds is wrong to begin with")
    if best.gain < 1:
        parts.append(
            f"and its movement, at {short_number(whole.energy_ratio)} of the recorded energy, is worth most at {best.gain:g} "
            f"times its size ({short_number(best.lve)}): part of it is not where the recorded movement is"
        )
    return ", ".join(parts) + "."


def _sure(differences: tuple[Difference, ...], label: str, figure: str) -> bool:
    return any(
        one.figure == figure and {one.first, one.second} == {label, MEAN_FACE} and one.distinguishable for one in differences
    )
