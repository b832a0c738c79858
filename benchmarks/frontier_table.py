"""What `frontier.py` measures of each row, clip by clip, and the tables that all folds together make."""

from pathlib import Path

import numpy as np
from frontier_curve import curve_lines
from scipy.stats import wilcoxon

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.evaluation.judge import shut_opening
from facesynth.evaluation.lips import closure_rate, false_closure_rate
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.paired import holm
from facesynth.evaluation.sync import SyncJudge, in_step
from facesynth.evaluation.two_sample import two_sample
from facesynth.inference.closures import close_at
from facesynth.inference.lips import bilabial_spans
from facesynth.inference.motion import Motion
from facesynth.methods.learn.point_loss import lip_points

Motions = dict[str, Motion]
Folds = dict[int, dict[str, np.ndarray]]
"""By fold the rows [clips, FIGURES]."""
FIGURES = ("`lve`", "energy", "of the lips", "closure", "false", "closed: `lve`", "closure", "false", "in step", "told apart")
BEST = "eFASE soft, lips sharpened, residual"
MADE_ALIKE = ("", ", sharpened", ", lips sharpened, residual")
BESIDE = (
    ("eFASE soft", "network"),
    ("eFASE soft by component", "eFASE soft"),
    ("eFASE soft by component", "network, raised by component"),
    ("network, raised by component", "network"),
    ("anime graph soft", "network"),
)
"""Rows that are told from another that was made as lively in the same way."""


class Judge:
    """Figures of rows on the tested clips, kept in a file."""

    def __init__(self, learned: Corpus, tested: Corpus, nearest: float, path: Path) -> None:
        """nearest: gap of the lips to which the same step closes them in all rows."""
        self.tested, self.nearest, self.path = tested, nearest, path
        self.threshold = shut_opening(tested, [learned])
        self.sync = SyncJudge.learn(learned)
        self.recorded = {u.id: u.motion for u in tested}
        self.rows: dict[str, np.ndarray] = dict(np.load(path)) if path.is_file() else {}

    def add(self, row: str, motions: Motions) -> None:
        """Measure a row and keep it."""
        apart = told_apart(self.sync, motions, self.recorded)
        steps = in_step([shift_ms(self.sync, u, motions[u.id]) for u in self.tested])
        lines = []
        for u, step in zip(self.tested, steps, strict=True):
            own, shut = (figures(m, u, self.threshold) for m in (motions[u.id], closed(motions[u.id], u, self.nearest)))
            lines.append([*own, shut[0], *shut[3:], step, apart.get(u.id, np.nan)])
        self.rows[row] = np.array(lines)
        np.savez(self.path, **self.rows)

    def line(self, row: str) -> str:
        return cells(self.rows[row])


def join(folder: Path) -> None:
    """Tables over the folds that are there, one for each number of clips, and how errors fall from one to the next."""
    by_count: dict[int, Folds] = {}
    for path in sorted(folder.glob("figures_*_*.npz")):
        count, fold = map(int, path.stem.split("_")[1:])
        by_count.setdefault(count, {})[fold] = dict(np.load(path))
    for count, folds in sorted(by_count.items()):
        rows = joined(folds)
        print(f"\n{count} clips to learn from, {len(folds)} folds, {len(next(iter(rows.values())))} clips tested\n")
        print("| | " + " | ".join(FIGURES) + " |\n|---|" + "---:|" * len(FIGURES))
        for row, lines in rows.items():
            print(f"| {row} | {cells(lines)} |")
        compared(rows)
        made_alike(rows)
    if len(by_count) > 1:
        curve(by_count)


def joined(folds: Folds) -> dict[str, np.ndarray]:
    """Rows that all folds have, over all of them."""
    first, *others = (folds[fold] for fold in sorted(folds))
    shared = [row for row in first if all(row in other for other in others)]
    return {row: np.concatenate([first[row], *(other[row] for other in others)]) for row in shared}


def curve(by_count: dict[int, Folds]) -> None:
    """The rows and folds that every number of clips has, beside each other."""
    shared = sorted(set.intersection(*(set(folds) for folds in by_count.values())))
    if not shared:
        print("\nno fold has figures for every number of clips")
        return
    tables = {count: joined({fold: folds[fold] for fold in shared}) for count, folds in sorted(by_count.items())}
    rows = [row for row in tables[min(tables)] if row != "recorded" and all(row in table for table in tables.values())]
    errors, energies = ({row: {n: table[row][:, k] for n, table in tables.items()} for row in rows} for k in (0, 1))
    means = {row: {n: float(each.mean()) for n, each in numbers.items()} for row, numbers in energies.items()}
    print(f"\nlip error, mm (energy), by clips to learn from: folds {', '.join(map(str, shared))}\n")
    print("\n".join(curve_lines(errors, means)))


def compared(rows: dict[str, np.ndarray]) -> None:
    """The best search against every other row, clip by clip, Holm over all of them: lip error, and telling lips from recorded."""
    others = [name for name in rows if name not in (BEST, "recorded")]
    for what, column in (("lip error, mm", "`lve`"), ("told from recorded lips", "told apart")) if BEST in rows else ():
        k = FIGURES.index(column)
        apart = {name: differences(rows[name][:, k] - rows[BEST][:, k]) for name in others}
        apart = {name: each for name, each in apart.items() if len(each)}
        chances = holm([float(wilcoxon(each).pvalue) for each in apart.values()])
        print(f"\n{what}, beside that of {BEST}: more by")
        for (name, each), chance in zip(apart.items(), chances, strict=True):
            print(f"- {name}: {each.mean():.3f}, in {(each > 0).sum()} of {len(each)} clips, p = {chance:.2g}")


def made_alike(rows: dict[str, np.ndarray]) -> None:
    """Each row of `BESIDE` against its other, as it comes, sharpened, and with a residual: lip error, Holm over all of them."""
    pairs = [(f"{row}{how}", f"{other}{how}") for row, other in BESIDE for how in MADE_ALIKE]
    pairs = [pair for pair in pairs if set(pair) <= set(rows)]
    gains = [rows[other][:, 0] - rows[row][:, 0] for row, other in pairs]
    chances = holm([float(wilcoxon(each).pvalue) for each in gains])
    for (row, other), each, chance in zip(pairs, gains, chances, strict=True):
        clips = f"{(each > 0).sum()} of {len(each)} clips"
        print(f"- {row}, nearer than {other} by {each.mean():.4f} mm, in {clips}, p = {chance:.2g}")


def differences(each: np.ndarray) -> np.ndarray:
    """Those that can be told."""
    return each[np.isfinite(each)]


def cells(lines: np.ndarray) -> str:
    means = [np.nanmean(column) if np.isfinite(column).any() else np.nan for column in lines.T]
    return " | ".join("" if np.isnan(mean) else f"{mean:.3f}" if k in (0, 5) else f"{mean:.2f}" for k, mean in enumerate(means))


def told_apart(judge: SyncJudge, motions: Motions, recorded: Motions) -> dict[str, float]:
    """By clip how well a classifier tells lips from recorded ones; empty where too few clips are tested."""
    try:
        return two_sample(judge.shapes, motions, recorded)
    except UnavailableError:
        return {}


def figures(motion: Motion, utterance: Utterance, threshold: float) -> list[float]:
    """Lip error, energy, energy of the lips, closures, false closures."""
    phones, truth = utterance.speech.phones, utterance.motion
    rates = []
    for rate in (closure_rate, false_closure_rate):
        try:
            rates.append(rate(motion, phones, threshold))
        except UnavailableError:
            rates.append(np.nan)
    if not np.isfinite(motion.frames).all():  # the recording itself, which has gaps
        return [np.nan, np.nan, np.nan, *rates]
    return [lve(motion, truth), energy_ratio(motion, truth), lips_energy(motion, truth), *rates]


def lips_energy(motion: Motion, truth: Motion) -> float:
    """Energy ratio of the lip points alone."""
    lips = lip_points(truth.layout)
    count = min(len(motion), len(truth))
    made, recorded = (np.linalg.norm(np.diff(m.points[:count, lips], axis=0), axis=2) for m in (motion, truth))
    present = np.isfinite(recorded) & np.isfinite(made)
    return float(made[present].sum() / recorded[present].sum())


def closed(motion: Motion, utterance: Utterance, nearest: float) -> Motion:
    """With lips as near at p, b and m as recorded lips mostly come."""
    spans = bilabial_spans(utterance.speech.phones, motion.fps)
    frames = close_at(motion.frames.astype(np.float64), motion.layout, spans, nearest, motion.fps)
    return Motion(frames.astype(np.float32), motion.fps, motion.layout)


def shift_ms(judge: SyncJudge, utterance: Utterance, motion: Motion) -> float | None:
    """How late the lips are; None where that cannot be told."""
    try:
        return judge.shift_ms(utterance.speech, motion)
    except UnavailableError:
        return None
