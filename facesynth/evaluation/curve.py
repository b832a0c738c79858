"""Error against motion: a method is judged by all the compromises that it offers, not by one of them.

Whatever predicts the average is near and moves too little, whatever keeps the motion pays in error. A curve is the set
of points (`energy_ratio`, `lve`) that a method reaches over its settings, each also with quick movement raised
(`sharpen`), which any method's motion can be given. Beside it stands the same motion made smaller or larger about each
utterance's mean pose, which no method needs to be asked for.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.evaluation.contestants import Family, is_recorded
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, lve_centred
from facesynth.evaluation.pair import Array, UnavailableError, require_alike
from facesynth.evaluation.regions import lip_points
from facesynth.inference.filters import sharpen
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

LIVELY = (0.9, 1.1)
"""Energy ratios that count as neither smoothed away nor invented."""
SHARPENINGS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.0)
GAINS = (0.0, 0.25, 0.5, 0.75, 1.25, 1.5)
"""Sizes of movement about an utterance's own mean pose, beside 1."""
VARIATIONS = (*((1.0, share) for share in SHARPENINGS), *((gain, 0.0) for gain in GAINS))
"""(gain, sharpening) of every point of one setting."""

Measure = Literal["lve", "lve_centred"]
MEASURES: tuple[Measure, ...] = ("lve", "lve_centred")


@dataclass(frozen=True)
class Point:
    """One compromise: means over the tested utterances."""

    gain: float
    """Size of the movement about each utterance's mean pose; 1 = as the method made it."""
    sharpening: float
    """How much quick movement was raised afterwards; 0 = as the method made it."""
    energy_ratio: float
    lip_energy_ratio: float
    """The same over the lip points alone: what `lve` looks at."""
    lve: float
    """Unit of the layout."""
    lve_centred: float
    """Unit of the layout."""
    setting: str = ""
    """The label of what made it."""


@dataclass(frozen=True)
class Curve:
    """All points of one method."""

    label: str
    points: tuple[Point, ...]
    """All settings and sharpenings."""
    scaled: tuple[Point, ...] = ()
    """Every setting with its movement made smaller and larger."""

    def nearest(self, measure: Measure = "lve") -> Point:
        """The point of least error."""
        return min(self.points, key=lambda point: getattr(point, measure))

    def lively(self, measure: Measure = "lve") -> Point | None:
        """The point of least error among those whose energy ratio lies in LIVELY; None where there is none."""
        inside = [point for point in self.points if LIVELY[0] <= point.energy_ratio <= LIVELY[1]]
        return min(inside, key=lambda point: getattr(point, measure), default=None)

    def front(self, measure: Measure = "lve") -> tuple[Point, ...]:
        """By rising energy, the points that no other point beats in error and in how near the energy is to 1."""
        kept = [p for p in self.points if not any(_beats(other, p, measure) for other in self.points)]
        return tuple(sorted(kept, key=lambda point: point.energy_ratio))

    def scaled_of(self, setting: str) -> tuple[Point, ...]:
        """One setting's motion from none to more than the method's own, by rising gain."""
        own = [point for point in (*self.points, *self.scaled) if point.setting == setting and point.sharpening == 0]
        return tuple(sorted(own, key=lambda point: point.gain))

    def rows(self) -> Iterator[dict[str, Any]]:
        """One dictionary for each point, for files: the point, and what it is among those of the curve."""
        marks = [(measure, set(self.front(measure)), self.nearest(measure), self.lively(measure)) for measure in MEASURES]
        for point in (*self.points, *self.scaled):
            row: dict[str, Any] = {"curve": self.label, **asdict(point)}
            for measure, front, nearest, lively in marks:
                row[f"{measure}_front"] = point in front
                row[f"{measure}_nearest"] = point == nearest
                row[f"{measure}_lively"] = point == lively
            yield row


def compromises(made: Motion, truth: Motion) -> Array:
    """[V, 4] of one utterance at each of VARIATIONS: energy ratio, that of the lips, `lve`, `lve_centred`.

    Two sharpened motions tell all: `sharpen` is linear in its share. Speeds, and so both energies, are proportional to
    the gain. UnavailableError where a figure has no value.
    """
    require_alike(made, truth)
    lips = lip_points(truth.layout)
    lips_truth, frames = _lips(truth, truth.points, lips), made.frames.astype(np.float64)
    once, twice = (made.layout.points(sharpen(frames, share, made.fps)) for share in (1.0, 2.0))
    points, recorded = made.layout.points(frames), truth.points.astype(np.float64)
    moving = np.asarray(~np.isnan(np.diff(recorded, axis=0)).any(axis=2))
    speed = _speed(recorded, moving) if moving.any() else 0.0
    if not speed > 0:
        raise UnavailableError("the motion to compare with does not move")
    mouth, rows = points[:, lips], list[tuple[float, ...]]()
    for gain, share in VARIATIONS:
        if gain == 1:
            changed = points if share == 0 else once + (share - 1) * (twice - once)
            lips_made = _lips(made, changed, lips)
            energies = _speed(changed, moving) / speed, energy_ratio(lips_made, lips_truth)
        else:
            mean = mouth.mean(axis=0)
            lips_made = _lips(made, mean + gain * (mouth - mean), np.arange(len(lips)))
            energies = gain * rows[0][0], gain * rows[0][1]
        rows.append((*energies, lve(lips_made, lips_truth), lve_centred(lips_made, lips_truth)))
    return np.array(rows)


def mean_points(rows: Sequence[Array]) -> tuple[Point, ...]:
    """The points of one setting from `compromises` of its utterances; none where there are no utterances."""
    if not rows:
        return ()
    means = np.mean(rows, axis=0)
    return tuple(Point(*variation, *row) for variation, row in zip(VARIATIONS, means.tolist(), strict=True))


def curves_of(points: Mapping[str, Sequence[Point]], families: Sequence[Family]) -> tuple[Curve, ...]:
    """From the points of each contestant: one curve for each family that is one method, one for everybody else.

    The second take is no method: a recording needs neither sharpening nor scaling.
    """
    together = {family.curve: family.labels for family in families if family.curve}
    taken = {label for labels in together.values() for label in labels}
    alone = {label: (label,) for label in points if label not in taken}
    return tuple(
        found
        for name, labels in (together | alone).items()
        if (found := _curve(name, [(label, points[label]) for label in labels if points.get(label)])).points
    )


def _curve(name: str, settings: Sequence[tuple[str, Sequence[Point]]]) -> Curve:
    named = [replace(point, setting=label) for label, points in settings for point in points]
    own = tuple(p for p in named if p.gain == 1 and (p.sharpening == 0 or not is_recorded(name)))
    return Curve(name, own, tuple(p for p in named if p.gain != 1 and not is_recorded(name)))


def _lips(motion: Motion, points: NDArray[np.floating], lips: NDArray[np.int64]) -> Motion:
    """The lip points alone, of a motion whose points [T, K, dimension] were changed."""
    names = tuple(f"lip {k}" for k in range(len(lips)))
    mouth = Layout(motion.layout.kind, names, {"mouth": tuple(range(len(names)))})
    return Motion(points[:, lips].reshape(len(motion), -1).astype(np.float32), motion.fps, mouth)


def _speed(points: Array, moving: NDArray[np.bool_]) -> float:
    """Mean speed (unit of the layout a frame) where the truth has both frames."""
    steps = np.diff(points, axis=0)[moving]
    return float(np.sqrt(np.einsum("nd,nd->n", steps, steps)).mean())


def _beats(one: Point, other: Point, measure: Measure) -> bool:
    """Whether a point is better in one respect and no worse in the other."""
    faults = [(getattr(point, measure), abs(1 - point.energy_ratio)) for point in (one, other)]
    return faults[0] != faults[1] and all(a <= b for a, b in zip(*faults, strict=True))
