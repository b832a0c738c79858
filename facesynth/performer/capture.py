"""The performance as a motion capture stage would record it: 90 markers, noise, gaps, and a few takes gone wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.face.rig.arkit_rig import Rig, pose_points
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.pose import remove_head, rigid_points
from facesynth.performer.performance import Performance

NOISE_MM = 0.1
"""RMS distance between a marker and where the cameras see it."""
SHORT_GAPS_PER_S = 1.2
SHORT_GAP_S = (0.02, 0.09)
LONG_GAP_SHARE = 0.04
"""Share of utterances with a gap too long to fill."""
LONG_GAP_S = (0.15, 0.40)
CONTAMINATED_SHARE = 0.03
"""Share of utterances in which the markers of one phone went wrong."""
SHORTEST_CONTAMINATED_S = 0.045
JOLT_MM = (8.0, 16.0)
MARGIN = 6
"""Frames between two gaps of a marker, and between a gap and the ends: gaps at an end cannot be filled."""
SWAPS: tuple[tuple[str, str], ...] = (
    ("mouth_corner_l", "upper_lip_l2"),
    ("mouth_corner_r", "upper_lip_r2"),
    ("lower_lip", "chin"),
    ("upper_lip_l1", "lower_lip_l1"),
    ("upper_lip_r1", "lower_lip_r1"),
)
"""Neighbours that a labelling program confuses."""

Kind = Literal["short_gap", "long_gap", "swap", "jolt"]


@dataclass(frozen=True)
class Fault:
    """Something that is wrong with a recording, and known to be."""

    kind: Kind
    markers: tuple[str, ...]
    start: int
    """First frame."""
    stop: int
    """One past the last frame."""
    phone: int | None = None
    """Number of the phone that is contaminated, within its utterance."""

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "kind": self.kind,
            "markers": list(self.markers),
            "start": self.start,
            "stop": self.stop,
            "phone": self.phone,
        }


@dataclass(frozen=True, eq=False)
class Capture:
    """A recorded performance with the list of what is wrong with it."""

    motion: Motion
    faults: tuple[Fault, ...]


def capture(performance: Performance, phones: PhoneTrack, rig: Rig, *, rng: np.random.Generator, clean: bool = False) -> Capture:
    """Record the 90 markers, head motion taken out as from any recording; `clean` leaves noise and faults away."""
    layout = marker_layout(rig)
    world = pose_points(rig, marker_vertices(rig, layout), performance.weights, performance.head).astype(np.float64)
    faults: tuple[Fault, ...] = ()
    if not clean:
        world += rng.normal(0.0, NOISE_MM / np.sqrt(3), world.shape)
        faults = plan_faults(phones, layout, len(world), performance.fps, rng)
        world = _spoil(world, faults, layout, rng)
    neutral = layout.points(np.array(layout.neutral))
    points, head = remove_head(world, neutral, rigid_points(layout))
    motion = Motion(points.reshape(len(points), -1), performance.fps, layout, head=head, eyes=performance.eyes.astype(np.float32))
    return Capture(motion, faults)


def plan_faults(phones: PhoneTrack, layout: Layout, count: int, fps: float, rng: np.random.Generator) -> tuple[Fault, ...]:
    """Draw what goes wrong in an utterance of `count` frames; gaps of one marker never touch each other.

    Markers of the rigid group have none: their gaps would make the head pose a little worse, which nobody could tell.
    """
    rigid = set(rigid_points(layout).tolist())
    names = [name for index, name in enumerate(layout.names) if index not in rigid]
    faults = _contamination(phones, layout, fps, rng) if rng.random() < CONTAMINATED_SHARE else []
    gaps: list[tuple[Kind, tuple[float, float]]] = [("long_gap", LONG_GAP_S)] if rng.random() < LONG_GAP_SHARE else []
    gaps += [("short_gap", SHORT_GAP_S)] * int(rng.poisson(SHORT_GAPS_PER_S * count / fps))
    for kind, (shortest_s, longest_s) in gaps:
        length = max(2, int(rng.uniform(shortest_s, longest_s) * fps))
        marker = names[rng.integers(len(names))]
        start = int(rng.integers(MARGIN, max(MARGIN + 1, count - MARGIN - length)))
        gap = Fault(kind, (marker,), start, start + length)
        if gap.stop <= count - MARGIN and not any(_near(gap, other) for other in faults):
            faults.append(gap)
    return tuple(faults)


def _near(gap: Fault, other: Fault) -> bool:
    return gap.markers[0] in other.markers and gap.start < other.stop + MARGIN and other.start < gap.stop + MARGIN


def _contamination(phones: PhoneTrack, layout: Layout, fps: float, rng: np.random.Generator) -> list[Fault]:
    """One phone during which markers were confused or knocked."""
    bounds = phones.frame_bounds(fps).tolist()
    shortest = round(SHORTEST_CONTAMINATED_S * fps)
    long_enough = [
        number
        for number, label in enumerate(phones.labels)
        if label != SILENCE and bounds[number + 1] - bounds[number] >= shortest
    ]
    if not long_enough:
        return []
    number = int(rng.choice(long_enough))
    start, stop = bounds[number], bounds[number + 1]
    if rng.random() < 0.5:
        return [Fault("swap", SWAPS[rng.integers(len(SWAPS))], start, stop, number)]
    knocked = layout.group(str(rng.choice(["lower_lip", "jaw", "cheeks"])))
    return [Fault("jolt", tuple(layout.names[i] for i in knocked), start, stop, number)]


def _spoil(world: NDArray[np.float64], faults: Sequence[Fault], layout: Layout, rng: np.random.Generator) -> NDArray[np.float64]:
    """World tracks [T, K, 3] with the faults put in."""
    spoilt = world.copy()
    for fault in faults:
        index = np.array([layout.names.index(name) for name in fault.markers])
        frames = np.arange(fault.start, fault.stop)
        if fault.kind == "swap":
            spoilt[np.ix_(frames, index)] = world[np.ix_(frames, index[::-1])]
        elif fault.kind == "jolt":
            direction = rng.normal(size=3)
            knock = rng.uniform(*JOLT_MM) * direction / np.linalg.norm(direction)
            phase = (frames - fault.start + 1) / (len(frames) + 1)
            spoilt[np.ix_(frames, index)] += (np.sin(np.pi * phase) ** 0.5)[:, None, None] * knock
        else:
            spoilt[np.ix_(frames, index)] = np.nan
    return spoilt
