"""The head: it drifts, nods on accents, follows pitch and loudness, and carries the emotion in its posture."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from facesynth.performer.cues import Cues
from facesynth.performer.emotion import Feelings
from facesynth.performer.wander import wander


@dataclass(frozen=True)
class Posture:
    """How an emotion carries the head."""

    down_deg: float = 0.0
    roll_deg: float = 0.0
    forward_mm: float = 0.0
    down_mm: float = 0.0
    liveliness: float = 1.0
    """Factor of all movement."""


POSTURES: Mapping[str, Posture] = {
    "neutral": Posture(),
    "happy": Posture(down_deg=-2.0, roll_deg=2.5, forward_mm=1.0, liveliness=1.25),
    "angry": Posture(down_deg=4.0, forward_mm=5.0, liveliness=1.3),
    "sad": Posture(down_deg=6.0, roll_deg=3.0, forward_mm=-2.0, down_mm=3.0, liveliness=0.6),
}


def move_head(feelings: Feelings, cues: Cues, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[T, 6] rotation vector (rad) and translation (mm) about the rig's pivot."""
    count = len(cues.pitch)
    shares = np.clip(feelings.brows, 0.0, 1.2)
    livelier = np.array([POSTURES[emotion].liveliness - 1.0 for emotion in feelings.emotions])
    lively = 1.0 + shares @ livelier
    angles_deg = _swing(count, cues, fps, rng) * lively[:, None]
    shift_mm = np.stack([wander(count, fps, hz, rng) for hz in (0.3, 0.35, 0.3)], axis=1) * (1.2, 0.6, 1.5)
    shift_mm[:, 2] += 1.0 * gaussian_filter1d(cues.accents, 0.06 * fps, mode="nearest") * lively
    for index, emotion in enumerate(feelings.emotions):
        posture = POSTURES[emotion]
        angles_deg += shares[:, index, None] * (posture.down_deg, 0.0, posture.roll_deg)
        shift_mm += shares[:, index, None] * (0.0, -posture.down_mm, posture.forward_mm)
    turns = Rotation.from_euler("YXZ", angles_deg[:, [1, 0, 2]], degrees=True)
    return np.concatenate([turns.as_rotvec(), shift_mm], axis=1)


def _swing(count: int, cues: Cues, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[T, 3] degrees down, to the performer's left, and roll."""
    nods = gaussian_filter1d(cues.accents, 0.035 * fps, mode="nearest")
    loud = gaussian_filter1d(np.clip(cues.loudness, 0.0, 1.5), 0.15 * fps, mode="nearest")
    down, left, roll = (amount * wander(count, fps, hz, rng) for amount, hz in ((1.1, 0.45), (1.6, 0.35), (1.1, 0.3)))
    lean = rng.normal(0.0, (0.8, 1.2, 0.8))
    down = down + 2.6 * nods - 1.0 * cues.pitch + 0.6 * (loud - loud.mean())
    left = left + rng.normal(0.0, 0.5) * cues.pitch
    swing: NDArray[np.float64] = gaussian_filter1d(np.stack([down, left, roll], axis=1), 0.05 * fps, axis=0, mode="nearest")
    return swing + lean
