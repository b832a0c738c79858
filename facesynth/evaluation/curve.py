"""Error against motion: a method is judged by all the compromises that it offers, not by one of them.

Whatever predicts the average is near and moves too little, whatever keeps the motion pays in error. A curve is the set
of points (`energy_ratio`, `lve`) that a method reaches over its settings, each also with quick movement raised
(`sharpen`), which any method's motion can be given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, lve_centred
from facesynth.evaluation.pair import Array, UnavailableError
from facesynth.evaluation.regions import lip_points
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.sharpening import sharpen
from facesynth.methods.method import Method
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion
from facesynth.progress import track

LIVELY = (0.9, 1.1)
"""Energy ratios that count as neither smoothed away nor invented."""
SHARPENINGS = (0.0, 0.3, 0.6, 1.0, 1.5)


@dataclass(frozen=True)
class Point:
    """One compromise: means over the utterances of a test corpus."""

    setting: str
    """What the method was told, in words."""
    sharpening: float
    """How much quick movement was raised afterwards; 0 = as the method made it."""
    lve: float
    """Unit of the layout."""
    lve_centred: float
    """Unit of the layout."""
    energy_ratio: float
    lip_energy_ratio: float
    """The same over the lip points alone: what `lve` looks at."""


@dataclass(frozen=True)
class Curve:
    """All points of one method."""

    label: str
    points: tuple[Point, ...]

    @property
    def nearest(self) -> Point:
        """The point of least `lve`."""
        return min(self.points, key=lambda point: point.lve)

    @property
    def lively(self) -> Point | None:
        """The point of least `lve` among those whose energy ratio lies in LIVELY; None where there is none."""
        inside = [point for point in self.points if LIVELY[0] <= point.energy_ratio <= LIVELY[1]]
        return min(inside, key=lambda point: point.lve, default=None)

    @property
    def front(self) -> tuple[Point, ...]:
        """By rising energy, the points that no other point beats in error and in how near the energy is to 1."""
        kept = [p for p in self.points if not any(_beats(other, p) for other in self.points)]
        return tuple(sorted(kept, key=lambda point: point.energy_ratio))

    def rows(self) -> list[dict[str, Any]]:
        """One dictionary for each point, for tables and files."""
        return [{"method": self.label, **asdict(point)} for point in self.points]


def curve(
    label: str,
    variants: Mapping[str, Callable[[], Method]],
    test: Corpus,
    *,
    sharpenings: Sequence[float] = SHARPENINGS,
    seed: int = 0,
) -> Curve:
    """Let each variant of a method (setting in words → trained method) speak a test corpus, and measure every sharpening."""
    points: list[Point] = []
    for setting, make in variants.items():
        figures: dict[float, list[Array]] = {share: [] for share in sharpenings}
        method = make()
        for utterance in track(test, f"{label}, {setting}", len(test)):
            made = method.synthesize(utterance.speech, seed=seed)
            for share in sharpenings:
                figures[share] += _figures(sharpened(made, share), utterance.motion)
        points += [Point(setting, share, *np.mean(rows, axis=0).tolist()) for share, rows in figures.items() if rows]
    return Curve(label, tuple(points))


def efase_variants(
    model: Efase, temperatures: Iterable[float], audio_weights: Iterable[float] = (), pose_weights: Iterable[float] = ()
) -> dict[str, Callable[[], Method]]:
    """A trained eFASE at each temperature, and at its own temperature under each weight of its audio terms."""
    settings = [{"temperature": value} for value in temperatures]
    settings += [{"audio_weight": value} for value in audio_weights]
    settings += [{"pose_weight": value} for value in pose_weights]
    named = {", ".join(f"{key} {value:g}" for key, value in setting.items()): setting for setting in settings}
    return {name: lambda setting=setting: model.with_weights(**setting) for name, setting in named.items()}  # type: ignore[misc]


def sharpened(motion: Motion, share: float) -> Motion:
    """The motion with its quick movement raised; see `facesynth.methods.efase.sharpening`."""
    if share == 0:
        return motion
    return replace(motion, frames=sharpen(motion.frames.astype(np.float64), share, motion.fps).astype(np.float32))


def _figures(made: Motion, truth: Motion) -> list[Array]:
    """The numbers of `Point`, in its order; nothing where an utterance has no motion to compare with."""
    try:
        lips = energy_ratio(_lips(made), _lips(truth))
        return [np.array([lve(made, truth), lve_centred(made, truth), energy_ratio(made, truth), lips])]
    except UnavailableError:
        return []


def _lips(motion: Motion) -> Motion:
    """The lip points alone."""
    layout, lips = motion.layout, lip_points(motion.layout)
    chosen = motion.points[:, lips]
    names = tuple(layout.names[int(i)] for i in lips)
    return Motion(chosen.reshape(len(motion), -1), motion.fps, Layout(layout.kind, names, {}))


def _beats(one: Point, other: Point) -> bool:
    """Whether a point is better in one respect and no worse in the other."""
    faults = [(point.lve, abs(1 - point.energy_ratio)) for point in (one, other)]
    return faults[0] != faults[1] and all(a <= b for a, b in zip(*faults, strict=True))
