"""How the heads and the eyes of one method move in all its utterances together, beside the recorded ones.

Nobody nods or blinks twice at the same moment: what is compared are distributions, so these are figures of the whole run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation import head_statistics
from facesynth.evaluation.eyes import Samples, blink_statistics, distances, fixation_statistics, gaze_statistics, pooled
from facesynth.evaluation.head_statistics import HeadSample, take_apart
from facesynth.evaluation.table import Column
from facesynth.inference.motion import Motion
from facesynth.methods.capabilities import Part
from facesynth.motion.lids import Lids

HEAD = {
    "speed in speech": "head_speed",
    "speed in pauses": "head_pause_speed",
    "range": "head_range",
    "spectrum": "head_spectrum",
    "pause ratio": "head_pause_ratio",
}
EYES = {
    "fixation, s": "gaze_fixation",
    "shift, °": "gaze_shift",
    "speed, °/s": "gaze_speed",
    "sideways, °": "gaze_sideways",
    "up, °": "gaze_up",
    "spectrum, Hz": "gaze_spectrum",
    "blink, s": "blink_length",
    "between blinks, s": "blink_interval",
    "blinks a minute": "blink_rate",
    "opening": "lid_opening",
}
"""Columns by what `head_statistics.distances` and `eyes.distances` call them."""
PART_COLUMNS = tuple(Column(name, "1", "1" if name == "head_pause_ratio" else "low") for name in (*HEAD.values(), *EYES.values()))
PART_DEFINITIONS: Mapping[str, str] = {
    **{name: f"Kolmogorov-Smirnov distance (0 alike, 1 apart) of the head's {what}." for what, name in HEAD.items()},
    "head_spectrum": "Half the absolute difference of the shares of the head's power in five bands up to 8 Hz (0..1).",
    "head_pause_ratio": "Mean speed of the head in pauses over that in speech.",
    **{name: f"Kolmogorov-Smirnov distance (0 alike, 1 apart) of {what}." for what, name in EYES.items()},
}


@dataclass(frozen=True, eq=False)
class PartSums:
    """Heads and eyes of one method and the recorded ones, of the utterances in which both are known all along."""

    heads: list[tuple[HeadSample, HeadSample]] = field(default_factory=list)
    """(made, recorded)"""
    eyes: list[tuple[Motion, Motion]] = field(default_factory=list)

    def add(self, utterance: Utterance, made: Motion, part: Part = "mouth") -> None:
        """Take in one utterance of a method that moves a part, a mouth moving the others too."""
        recorded = utterance.motion
        if part != "eyes" and _known(made.head, recorded.head):
            self.heads.append((take_apart(made, utterance.speech), take_apart(recorded, utterance.speech)))
        if part != "head" and _known(made.eyes, recorded.eyes):
            self.eyes.append((made, recorded))

    def figures(self) -> dict[str, float]:
        """By column; those alone of which there is something recorded."""
        found: dict[str, float] = {}
        if self.heads:
            apart = head_statistics.distances(*map(list, zip(*self.heads, strict=True)))
            found |= {HEAD[name]: value for name, value in apart.items() if np.isfinite(value)}
        if self.eyes:
            made, recorded = (_eye_samples(side) for side in zip(*self.eyes, strict=True))
            found |= {EYES[name]: value for name, value in distances(made, recorded).items() if len(recorded[name])}
        return found


def _known(made: np.ndarray | None, recorded: np.ndarray | None) -> bool:
    """Whether both are there in every frame."""
    return (
        made is not None
        and recorded is not None
        and len(made) > 1
        and bool(np.isfinite(made).all() & np.isfinite(recorded).all())
    )


def _eye_samples(motions: Sequence[Motion]) -> Samples:
    """Fixations, gaze and blinks of one side together."""
    lids, parts = Lids.of(motions), list[Samples]()
    for motion in motions:
        assert motion.eyes is not None  # noqa: S101 - chosen by `add`
        gaze = motion.eyes[:, 1:].astype(np.float64)
        still = np.zeros((len(gaze), 6)) if motion.head is None else motion.head
        moves = gaze_statistics(gaze, still, motion.fps)
        blinks = blink_statistics(lids.opening(motion)[:, 0], motion.fps)
        parts.append({**fixation_statistics(gaze, motion.fps), **{n: moves[n] for n in moves if n in EYES}, **blinks})
    return pooled(parts)
