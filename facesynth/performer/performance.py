"""An utterance becomes a performance: 52 facial weights, head and eyes at every frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.face.rig.arkit import gaze_weights
from facesynth.face.rig.markers import LipGap
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import Speech
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.performer.articulation import Articulation, articulate
from facesynth.performer.cues import Cues, listen
from facesynth.performer.emotion import feel, show, sides
from facesynth.performer.eyes import Eyes, look
from facesynth.performer.head_motion import move_head
from facesynth.performer.targets import CURVES, SHAPES
from facesynth.performer.wander import wander

TUCK_GAP_MM = 2.4
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
