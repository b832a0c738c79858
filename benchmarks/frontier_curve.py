"""How lip errors fall with how much is learned from: a table, millimetres per doubling, and tests sentence by sentence."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.stats import wilcoxon

from facesynth.evaluation.paired import bootstrap, holm
from facesynth.inference.arrays import Floats

Errors = Mapping[int, Floats]
"""[S] lip errors (mm) of the same sentences, by how many recordings were learned from, fewest first."""
DRAWS = 20_000


@dataclass(frozen=True)
class Step:
    """What more recordings take off a row's error."""

    row: str
    fewer: int
    more: int
    gain: float
    """mm by which errors are smaller with more; negative where they are larger."""
    nearer: int
    """Sentences that are nearer with more …"""
    sentences: int
    """… of so many."""
    p: float
    """Wilcoxon, two-sided, corrected by Holm for all rows and steps."""


def per_doubling(errors: Errors) -> Floats:
    """[S] mm by which each error changes where twice as much is learned from: least squares along log2 of how much."""
    doublings = np.log2(list(errors))
    centred = doublings - doublings.mean()
    return np.asarray(centred @ np.stack(list(errors.values())) / (centred @ centred))


def steps(rows: Mapping[str, Errors]) -> list[Step]:
    """Each number of recordings against the next one, for each row."""
    found = []
    for row, errors in rows.items():
        for (fewer, before), (more, after) in pairwise(errors.items()):
            gains = before - after
            chance = float(wilcoxon(gains).pvalue) if gains.any() else 1.0
            found.append((row, fewer, more, float(gains.mean()), int((gains > 0).sum()), len(gains), chance))
    corrected = holm([each[-1] for each in found])
    return [Step(*each[:-1], p) for each, p in zip(found, corrected, strict=True)]


def curve_lines(rows: Mapping[str, Errors], energies: Mapping[str, Mapping[int, float]]) -> list[str]:
    """The table in Markdown, and the tests below it; energies: mean of each row for each number of recordings."""
    counts = list(next(iter(rows.values())))
    lines = ["| learned from | " + " | ".join(map(str, counts)) + " | mm per doubling (95 %) |"]
    lines.append("|---|" + "---:|" * (len(counts) + 1))
    for row, errors in rows.items():
        cells = [f"{errors[count].mean():.3f} ({energies[row][count]:.2f})" for count in counts]
        slopes = per_doubling(errors)
        low, high, _ = bootstrap(slopes[:, None], 0, DRAWS)[0]
        lines.append(f"| {row} | {' | '.join(cells)} | {slopes.mean():.3f} ({low:.3f} to {high:.3f}) |")
    return [*lines, "", *(told(step) for step in steps(rows))]


def told(step: Step) -> str:
    """In a line."""
    which = f"{step.nearer} of {step.sentences}"
    return f"- {step.row}, {step.fewer} to {step.more}: {step.gain:.3f} mm nearer, in {which}, p = {step.p:.2g}"
