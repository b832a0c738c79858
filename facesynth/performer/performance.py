"""An utterance becomes a performance: 52 facial weights, head and eyes at every frame."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from facesynth.face.rig.arkit import gaze_weights
from facesynth.face.rig.markers import LipGap
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import Speech
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.articulation import Articulation, articulate
from facesynth.performer.cues import Cues, listen
from facesynth.performer.emotion import Feelings, feel, show, sides
from facesynth.performer.targets import CURVES, SHAPES
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
    "angry": Posture(down_deg=8.0, forward_mm=5.0, liveliness=1.3),
    "sad": Posture(down_deg=7.0, roll_deg=3.0, forward_mm=-2.0, down_mm=3.0, liveliness=0.6),
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


SHUT_S, STAY_S, OPEN_S = 0.07, 0.03, 0.16
"""A blink: down, closed, up again."""
BETWEEN_BLINKS_S = (1.6, 4.2)
BLINK_EVERY: Mapping[str, float] = {"neutral": 1.0, "happy": 1.0, "angry": 1.4, "sad": 1.2}
"""Factor of the time between blinks."""
FIXATION_S = (0.5, 1.8)
AWAY = 0.65
"""Share of fixations beside the listener's eyes."""
AWAY_DEG = (2.4, 1.3)
"""Standard deviation of such a look, sideways and up."""
COMPENSATION = 0.6
"""Share of the head's turn that the eyes undo."""
SAD_GAZE_DEG = -9.0


@dataclass(frozen=True, eq=False)
class Eyes:
    """What the eyes do over T frames."""

    blink: NDArray[np.float64]
    """[T] 0 open to 1 shut, by blinking alone."""
    gaze_rad: NDArray[np.float64]
    """[T, 2] relative to the head: to the performer's left, up."""


def look(feelings: Feelings, head: NDArray[np.float64], fps: float, rng: np.random.Generator) -> Eyes:
    """Eyes for a head [T, 6] that moves."""
    count = len(head)
    gaze_deg = _saccades(count, fps, rng)
    gaze_deg[:, 1] += SAD_GAZE_DEG * np.clip(feelings.share("sad"), 0.0, 1.2)
    gaze_deg += 0.15 * np.stack([wander(count, fps, 2.0, rng), wander(count, fps, 2.0, rng)], axis=1)
    down, left = head[:, 0], head[:, 1]
    gaze = np.radians(gaze_deg) + COMPENSATION * np.stack([-left, down], axis=1)
    return Eyes(_blinks(feelings, count, fps, rng), gaze)


def _saccades(count: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[T, 2] degrees: fixations, joined by jumps of some 30 ms."""
    gaze = np.zeros((count, 2))
    time_s = 0.0
    while time_s < count / fps:
        gaze[round(time_s * fps) :] = rng.normal(0.0, AWAY_DEG) * (rng.random() < AWAY)
        time_s += rng.uniform(*FIXATION_S)
    smooth: NDArray[np.float64] = gaussian_filter1d(gaze, 0.012 * fps, axis=0, mode="nearest")
    return smooth


def _blinks(feelings: Feelings, count: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    times = np.arange(count) / fps
    shares = np.clip(feelings.brows, 0.0, 1.0)
    rarer = 1.0 + shares @ np.array([BLINK_EVERY[emotion] - 1.0 for emotion in feelings.emotions])
    closed = np.zeros(count)
    start_s = rng.uniform(0.3, 1.5)
    while start_s + SHUT_S + STAY_S < times[-1]:
        since = times - start_s
        falling, rising = since / SHUT_S, 1.0 - (since - SHUT_S - STAY_S) / OPEN_S
        closed = np.maximum(closed, np.clip(np.minimum(falling, rising), 0.0, 1.0))
        start_s += rng.uniform(*BETWEEN_BLINKS_S) * rarer[min(round(start_s * fps), count - 1)]
    return closed * closed * (3 - 2 * closed)


TUCK_GAP_MM = 1.8
"""Inner-lip gap where the lower lip is at the upper teeth."""
TIGHTEST_GAP_MM = -1.2
"""Beyond this the lips would pass through each other: the jaw gives way."""
FAVOURED_SIDE = 0.04
"""The performer articulates this much more on the left than on the right."""
SIDEWAYS = 0.035
"""Standard deviation of the weights that shift jaw and mouth sideways."""
_CENTRE = slice(2, 5)


@dataclass(frozen=True, eq=False)
class Performance:
    """Everything that the built-in performer's face and head do over T frames."""

    fps: float
    weights: NDArray[np.float64]
    """[T, 52] ARKit weights, 0..1, in the rig's order."""
    head: NDArray[np.float64]
    """[T, 6] rotation vector (rad) and translation (mm) about the rig's pivot."""
    eyes: NDArray[np.float64]
    """[T, 3] opening 0..1, gaze to the performer's left (rad), gaze up (rad)."""
    tongue_up: NDArray[np.float64]
    """[T] 0..1 raised tip of the tongue, which ARKit lacks."""
    articulation: Articulation

    def __len__(self) -> int:
        return len(self.weights)


def perform(speech: Speech, lips: LipGap, *, pitch_hz: NDArray[np.float64], fps: float, seed: int) -> Performance:
    """Act an utterance. pitch_hz: [F] of the voice every 5 ms, 0 where unvoiced; `seed` is the take."""
    count = int(speech.phones.frame_bounds(fps)[-1])
    if not count:
        raise FacesynthError(f"an utterance of {speech.duration_s:.3f} s has no frame at {fps:g} fps; record more")
    streams = iter(np.random.default_rng(seed).spawn(5))
    cues = listen(speech, pitch_hz, count, fps)
    feelings = feel(speech.emotions, count, fps, next(streams))
    articulation = articulate(speech.phones, cues.loudness, fps, effort=feelings.effort, rng=next(streams))
    head = move_head(feelings, cues, fps, next(streams))
    eyes = look(feelings, head, fps, next(streams))
    shapes = _spoken(articulation) | _sideways(count, fps, cues, next(streams))
    for name, track in show(feelings, cues, articulation).items():
        shapes[name] = shapes.get(name, 0.0) + track
    weights = _as_weights(shapes, eyes, count)
    weights = touch(weights, articulation, lips)
    opening = 1.0 - weights[:, [ARKIT_NAMES.index("eyeBlinkLeft"), ARKIT_NAMES.index("eyeBlinkRight")]].mean(axis=1)
    tongue_up = articulation.curves[:, CURVES.index("tongue_up")]
    return Performance(fps, weights, head, np.column_stack([opening, eyes.gaze_rad]), tongue_up, articulation)


def touch(weights: NDArray[np.float64], articulation: Articulation, lips: LipGap) -> NDArray[np.float64]:
    """Bring the lips together, [T, 52], where the articulation closes them, and keep them from passing through each other.

    The inner-lip gap is linear in the weights, and mouthClose narrows it whatever the jaw, a smile or a snarl left open:
    the missing millimetres over its slope are what it takes.
    """
    weights = lips.closed(weights, articulation.closed_gap_mm, articulation.closure)
    weights = lips.closed(weights, TUCK_GAP_MM, articulation.tuck)
    weights = np.clip(weights, 0.0, 1.0)
    jaw = ARKIT_NAMES.index("jawOpen")
    crossed_mm = np.maximum(TIGHTEST_GAP_MM - lips.gaps_mm(weights)[:, _CENTRE].min(axis=1), 0.0)
    weights[:, jaw] += crossed_mm / lips.slopes_mm[_CENTRE, jaw].mean()
    return np.clip(weights, 0.0, 1.0)


def _spoken(articulation: Articulation) -> dict[str, NDArray[np.float64]]:
    tracks: dict[str, NDArray[np.float64]] = {}
    for column, curve in enumerate(CURVES):
        if curve in SHAPES:
            for name, factor in sides(SHAPES[curve], FAVOURED_SIDE).items():
                tracks[name] = factor * articulation.curves[:, column]
    return tracks


def _sideways(count: int, fps: float, cues: Cues, rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """Jaw and mouth never move quite straight down."""
    tracks: dict[str, NDArray[np.float64]] = {}
    for part in ("jaw", "mouth"):
        shift = SIDEWAYS * wander(count, fps, 1.0, rng) * cues.talking
        tracks |= {f"{part}Left": np.maximum(shift, 0.0), f"{part}Right": np.maximum(-shift, 0.0)}
    return tracks


def _as_weights(shapes: dict[str, NDArray[np.float64]], eyes: Eyes, count: int) -> NDArray[np.float64]:
    """[T, 52]: lids are the blink's while it lasts, and the lids follow the gaze."""
    weights = np.zeros((count, len(ARKIT_NAMES)))
    for name, track in shapes.items():
        weights[:, ARKIT_NAMES.index(name)] = track
    weights = gaze_weights(np.clip(weights, 0.0, 1.0), eyes.gaze_rad)
    for side in ("Left", "Right"):
        lid = ARKIT_NAMES.index(f"eyeBlink{side}")
        weights[:, lid] = np.maximum(weights[:, lid], eyes.blink)
        for name in ("eyeSquint", "eyeWide", "eyeLookUp", "eyeLookDown"):
            weights[:, ARKIT_NAMES.index(f"{name}{side}")] *= 1.0 - eyes.blink
    return weights
