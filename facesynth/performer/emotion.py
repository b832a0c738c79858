"""Feelings on the face: poses that grow, waver, differ from take to take, and give way to what the mouth has to do."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.errors import unknown
from facesynth.inference.speech import EmotionTrack
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.articulation import Articulation
from facesynth.performer.cues import Cues
from facesynth.performer.targets import CURVES
from facesynth.performer.wander import wander

POSES: Mapping[str, Mapping[str, float]] = {
    "neutral": {},
    "happy": {
        "mouthSmile": 0.72,
        "cheekSquint": 0.62,
        "mouthDimple": 0.15,
        "eyeSquint": 0.10,
        "browOuterUp": 0.20,
        "browInnerUp": 0.12,
        "mouthUpperUp": 0.30,
        "mouthLowerDown": 0.12,
    },
    "angry": {
        "browDown": 1.0,
        "eyeSquint": 0.30,
        "mouthFrown": 0.80,
        "mouthFunnel": 0.28,
        "mouthShrugUpper": 0.25,
        "mouthLowerDown": 0.50,
    },
    "sad": {
        "browInnerUp": 1.0,
        "browDown": 0.80,
        "mouthFrown": 0.38,
        "mouthShrugLower": 0.60,
        "eyeBlink": 0.25,
    },
}
"""ARKit shapes of each emotion at full strength; a name stands for both sides of the face.

By action units of FACS: happy 6 + 12 + 25; angry 4, 7, 10, 15, 16, 22 and 25; sad 1 + 4 + 15 + 17, the lids low."""

EFFORT: Mapping[str, float] = {"neutral": 1.0, "happy": 1.08, "angry": 1.18, "sad": 0.86}
"""How much an emotion enlarges articulation."""

ACCENT: Mapping[str, Mapping[str, float]] = {
    "neutral": {"browInnerUp": 0.15, "browOuterUp": 0.18},
    "happy": {"browInnerUp": 0.17, "browOuterUp": 0.20, "mouthSmile": 0.06},
    "angry": {"browDown": 0.15, "eyeSquint": 0.12},
    "sad": {"browInnerUp": 0.10, "browOuterUp": 0.07},
}
"""What an accent of the voice adds."""

WIDENING = ("mouthSmile", "mouthDimple", "mouthStretch", "mouthFrown")
"""Shapes that rounded lips weaken."""
OPENING = ("mouthUpperUp", "mouthLowerDown", "mouthShrugUpper", "mouthShrugLower", "mouthFunnel")
"""Shapes that a contact of the lips weakens."""
ROUNDING_WEAKENS = 0.45
CONTACT_WEAKENS = 0.9
WAVER = 0.16
"""Standard deviation of an emotion's strength over time."""
WAVER_HZ = 0.5
CROSSFADE_S = 0.35


@dataclass(frozen=True, eq=False)
class Feelings:
    """How strongly each emotion is felt, over T frames."""

    emotions: tuple[str, ...]
    brows: NDArray[np.float64]
    """[T, E] strength on the upper face, around 0..1.2."""
    mouth: NDArray[np.float64]
    """[T, E] strength on the lower face: it wavers by itself."""
    asymmetry: NDArray[np.float64]
    """[E] how much more the left side shows it than the right."""

    @property
    def effort(self) -> NDArray[np.float64]:
        """[T] how much larger or smaller articulation becomes."""
        extra = np.array([EFFORT[emotion] for emotion in self.emotions]) - 1.0
        return 1.0 + np.clip(self.mouth, 0.0, 1.2) @ extra

    def share(self, emotion: str) -> NDArray[np.float64]:
        """[T] strength of one emotion on the upper face; 0 where it is not felt at all."""
        return self.brows[:, self.emotions.index(emotion)] if emotion in self.emotions else np.zeros(len(self.brows))


def feel(emotions: EmotionTrack, count: int, fps: float, rng: np.random.Generator) -> Feelings:
    """One take's feelings: onset, strength, asymmetry and wavering are drawn anew for each."""
    for emotion in emotions.labels:
        if emotion not in POSES:
            raise unknown("emotion of the built-in performer", emotion, POSES)
    names = tuple(POSES)
    present = _present(emotions, names, count, fps)
    start, grow_s = rng.uniform(0.3, 0.8), rng.uniform(0.25, 0.6)
    growth = start + (1 - start) * np.clip(np.arange(count) / fps / grow_s, 0.0, 1.0)
    life = present * gaussian_filter1d(growth, 0.1 * fps, mode="nearest")[:, None]
    strength = rng.uniform(0.85, 1.08, len(names))
    brows, mouth = (np.stack([_waver(count, fps, rng) for _ in names], axis=1) for _ in range(2))
    return Feelings(names, life * strength * brows, life * strength * mouth, rng.normal(0.04, 0.06, len(names)))


def show(feelings: Feelings, cues: Cues, articulation: Articulation) -> dict[str, NDArray[np.float64]]:
    """Weights [T] by ARKit shape and side that feelings and accents add to what the mouth says."""
    shown: dict[str, NDArray[np.float64]] = {}
    for index, emotion in enumerate(feelings.emotions):
        side = feelings.asymmetry[index]
        for shape, amount in POSES[emotion].items():
            track = feelings.mouth if shape.startswith(("mouth", "jaw")) else feelings.brows
            _add(shown, shape, amount * np.clip(track[:, index], 0.0, 1.25), side)
    shares = np.clip(feelings.brows, 0.0, 1.0)
    shares[:, feelings.emotions.index("neutral")] = np.clip(1.0 - shares[:, 1:].sum(axis=1), 0.0, 1.0)
    for index, emotion in enumerate(feelings.emotions):
        for shape, amount in ACCENT[emotion].items():
            _add(shown, shape, amount * shares[:, index] * cues.accents, feelings.asymmetry[index])
    return {name: track * _given_way(name, cues, articulation) for name, track in shown.items()}


def _present(emotions: EmotionTrack, names: tuple[str, ...], count: int, fps: float) -> NDArray[np.float64]:
    """[T, E] intensity of each emotion, cross-faded where the track changes; neutral is the absence of the others."""
    index = emotions.index_at(np.arange(count) / fps)
    present = np.zeros((count, len(names)))
    for interval, (label, intensity) in enumerate(zip(emotions.labels, emotions.intensities, strict=True)):
        if label != "neutral":
            present[index == interval, names.index(label)] = intensity
    faded: NDArray[np.float64] = gaussian_filter1d(present, CROSSFADE_S / 3 * fps, axis=0, mode="nearest")
    return faded


def _waver(count: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    return 1.0 + WAVER * np.clip(wander(count, fps, WAVER_HZ, rng), -2.0, 2.0)


def _add(shown: dict[str, NDArray[np.float64]], shape: str, track: NDArray[np.float64], asymmetry: float) -> None:
    for name, factor in sides(shape, asymmetry).items():
        shown[name] = shown.get(name, np.zeros(len(track))) + factor * track


def sides(shape: str, asymmetry: float) -> dict[str, float]:
    """The ARKit shapes that a name for both sides stands for, and how much of it each side gets."""
    if shape in ARKIT_NAMES:
        return {shape: 1.0}
    return {f"{shape}Left": 1.0 + asymmetry, f"{shape}Right": 1.0 - asymmetry}


def _given_way(name: str, cues: Cues, articulation: Articulation) -> NDArray[np.float64]:
    """[T] what is left of an emotional shape where the mouth needs the same muscles."""
    left = np.ones(len(articulation.closure))
    if name.startswith(WIDENING):
        rounded = articulation.curves[:, CURVES.index("pucker")] + articulation.curves[:, CURVES.index("funnel")]
        left *= 1.0 - ROUNDING_WEAKENS * np.clip(rounded, 0.0, 1.0)
    if name.startswith(OPENING):
        left *= 1.0 - CONTACT_WEAKENS * np.maximum(articulation.closure, articulation.tuck)
    if name.startswith("mouthPress"):
        left *= 1.0 - cues.talking
    return left
