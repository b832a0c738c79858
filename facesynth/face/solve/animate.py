"""From a motion to an animation of the built-in head."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.face.animation import FaceAnimation
from facesynth.face.behaviour.eyes import EyeMotion, quiet_eyes
from facesynth.face.rig.arkit import BLINKS, arkit_columns, gaze_of, gaze_weights, shows_gaze
from facesynth.face.rig.arkit_rig import PIVOT_MM, Rig
from facesynth.face.rig.markers import MIDDLE_LIPS, LipGap, marker_vertices
from facesynth.face.solve.blendshapes import MarkerBasis, solve_markers
from facesynth.face.solve.closures import MOUTH, with_lips_apart, with_lips_met
from facesynth.face.solve.fitting import fit_layout, is_of_the_head, rest_of
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.long_arrays import all_finite, by_blocks, joined, row_blocks
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.pose import rigid_points

# On ARKit's heads mouthClose undoes jawOpen at the lips: more of it than of the jaw drives one lip through the other.
JAW, CLOSE = ARKIT_NAMES.index("jawOpen"), ARKIT_NAMES.index("mouthClose")
SHUT_MM, OPEN_MM = 0.7, 2.0
"""Lips nearer than the first are shut and stay as near; wider than the second they are free; between, less and less."""


# The gaps of the lips are linear in the weights: times g, a gap becomes r + g (gap - r), with r the gap at rest. For g < 1 that
# brings shut lips nearer to rest, where they are shut as well; a larger g would drive them apart or through each other, so it
# fades to 1 as the lips come together.
def amplified(weights: ArrayLike, gain: float, lips: LipGap) -> NDArray[np.float64]:
    """Weights [T, 52] with the mouth's times `gain`, in 0..1; lips that were shut stay shut, and none pass through each other."""
    if not (np.isfinite(gain) and gain >= 0):
        raise FacesynthError(f"a gain of the mouth must be 0 (still) or a positive factor; got {gain}")
    values = np.clip(np.asarray(weights, np.float64), 0, 1)
    if gain > 1:
        free = 1 - nearly_shut(lips.opening_mm(values))
        values[:, MOUTH] *= 1 + (gain - 1) * free[:, None]
        values[:, [JAW, CLOSE]] /= np.maximum(values[:, [JAW, CLOSE]].max(axis=1, keepdims=True), 1.0)
        moved = free > 0
        values[np.ix_(moved, np.array(MOUTH))] = with_lips_apart(values[moved], lips)[:, MOUTH]
        return np.clip(values, 0, 1)
    values[:, MOUTH] *= gain
    return values


def nearly_shut(opening_mm: ArrayLike) -> NDArray[np.float64]:
    """[T] 1 where lips [T] are shut, 0 where they are free, between the two in between."""
    return 1 - np.clip((np.asarray(opening_mm, np.float64) - SHUT_MM) / (OPEN_MM - SHUT_MM), 0, 1)


# What mouthClose closes beyond the jaw, the shapes that part the lips give way to: with m = excess · |slope of mouthClose| and
# p = Σ slope · weight of those shapes, their weights become (1 - m / p) of what they were.
def close_within_jaw(weights: ArrayLike, lips: LipGap) -> NDArray[np.float64]:
    """Weights [T, 52] whose mouthClose is nowhere above jawOpen, with lips as near as they were."""
    values = np.array(weights, np.float64)
    excess = np.maximum(values[:, CLOSE] - values[:, JAW], 0)
    values[:, CLOSE] = np.minimum(values[:, CLOSE], values[:, JAW])
    slopes_mm = lips.slopes_mm[MIDDLE_LIPS].mean(axis=0)
    parting = [i for i in np.flatnonzero(slopes_mm > 0) if i != JAW]
    open_mm = values[:, parting] @ slopes_mm[parting]
    missing_mm = excess * -slopes_mm[CLOSE]
    values[:, parting] *= 1 - np.clip(missing_mm / np.maximum(open_mm, 1e-9), 0, 1)[:, None]
    return values


def with_close_within_jaw(animation: FaceAnimation, lips: LipGap) -> FaceAnimation:
    """An animation of ARKit's shapes with `close_within_jaw` in every frame; one of other channels as it is."""
    if animation.names != ARKIT_NAMES:
        return animation
    return replace(animation, weights=by_blocks(partial(close_within_jaw, lips=lips), animation.weights, np.float32))


TIP_UP: Mapping[str, float] = {
    **dict.fromkeys(["t", "d", "n", "en", "l", "el"], 1.0),
    **dict.fromkeys(["s", "z"], 0.7),
    "r": 0.6,
    **dict.fromkeys(["th", "dh", "er", "y"], 0.5),
    **dict.fromkeys(["sh", "zh", "ch", "jh", "iy", "ey"], 0.4),
    **dict.fromkeys(["ih", "ay", "oy"], 0.3),
    "eh": 0.2,
    **dict.fromkeys(["ae", "ah", "ax", "k", "g", "ng"], 0.1),
}
"""How far the tip is lifted, 0..1; 0 where a phone is not listed."""

TIP_OUT: Mapping[str, float] = {"th": 0.34, "dh": 0.34, "l": 0.06, "el": 0.06}
"""Weight of tongueOut."""

SMOOTHING_S = 0.022
"""Standard deviation of the Gaussian between one target and the next."""


def tongue_track(targets: Mapping[str, float], phones: PhoneTrack | None, count: int, fps: float) -> NDArray[np.float64]:
    """[T] a target per phone as a smooth curve; zeros without phones."""
    if phones is None:
        return np.zeros(count)
    phone = np.searchsorted(phones.ends_s, (np.arange(count) + 0.5) / fps, side="right")
    heights = np.array([targets.get(label, 0.0) for label in phones.labels] + [0.0])  # nothing after the last phone
    return gaussian_filter1d(heights[phone], SMOOTHING_S * fps, mode="nearest")


ALREADY_BLINKS = 0.5
"""A motion whose lids shut this far has blinks of its own."""


def animate(
    motion: Motion,
    rig: Rig,
    *,
    head_gain: float = 1.0,
    eyes_gain: float = 1.0,
    mouth_gain: float = 1.0,
    seed: int = 0,
    phones: PhoneTrack | None = None,
    eyes: EyeMotion = quiet_eyes,
) -> FaceAnimation:
    """Put a motion on a rig, at the motion's rate.

    Points become weights by bounded least squares on the rig, wherever they lie on it (`fit_layout`); curves with ARKit
    names pass through, and where no curve has such a name all keep their own. Blinks and
    gaze are the motion's own where it has them, otherwise made by `eyes` and `seed`. The tongue follows `phones`, and so do
    the lips of another performer's points at p, b and m; those lips never pass through each other.

    Parameters
    ----------
    head_gain : factor on the head's turns and shifts; 0 keeps it still
    eyes_gain : factor on the gaze; 0 keeps the eyes open and straight
    mouth_gain : factor on the movement of mouth and jaw; lips that are shut stay shut
    """
    for name, gain in (("head_gain", head_gain), ("eyes_gain", eyes_gain)):
        if not (np.isfinite(gain) and gain >= 0):
            raise FacesynthError(f"{name} must be 0 (off) or a positive factor; got {gain}")
    _check_whole(motion)
    head = _head_on(rig, motion, head_gain)
    made = eyes(head, motion.fps, phones, seed)
    gaze = _gaze(motion, made) * eyes_gain
    if motion.layout.kind == "curves" and not arkit_columns(motion.layout):
        if mouth_gain != 1:
            odd = ", ".join(motion.layout.names[:3])
            raise FacesynthError(
                f"the curves {odd} … are not ARKit's, so nobody knows the mouth; give a mapping file (--mapping)"
            )
        values = np.clip(motion.frames, 0, 1)
        return FaceAnimation(motion.layout.names, values, head, gaze, np.zeros(len(motion)), motion.fps)
    weights, residual = _weights(motion, rig, phones)
    weights = amplified(weights, mouth_gain, LipGap.of(rig)) if mouth_gain != 1 else weights
    shut = _lids(motion, weights, made) if eyes_gain else np.zeros(len(motion))
    out, tip = (tongue_track(targets, phones, len(motion), motion.fps) for targets in (TIP_OUT, TIP_UP))
    lips, column = LipGap.of(rig), rig.index("tongueOut")[0]

    def finished(rows: slice) -> NDArray[np.float64]:
        some = np.array(weights[rows])
        _set_lids(some, shut[rows], awake=eyes_gain == 0)
        some = gaze_weights(some, gaze[rows])
        some[:, column] = _tongue_out(some, column, lips, out[rows])
        return np.clip(some, 0, 1)

    whole = joined(finished(rows) for rows in row_blocks(weights))
    return FaceAnimation(rig.names, whole, head, gaze, np.clip(tip, 0, 1), motion.fps, residual)


def on_head(motion: Motion, rig: Rig, phones: PhoneTrack | None) -> Motion:
    """A motion of points, or of curves with ARKit names, as the 52 weights of the built-in head, turned about its pivot."""
    _check_whole(motion)
    weights, _ = _weights(motion, rig, phones)
    head = None if motion.head is None else _head_on(rig, motion, 1.0).astype(np.float32)
    frames = np.clip(weights, 0, 1).astype(np.float32)
    return Motion(frames, motion.fps, Layout("curves", ARKIT_NAMES), head, motion.eyes)


def _check_whole(motion: Motion) -> None:
    if not len(motion):
        raise FacesynthError("a motion without frames cannot be put on a face")
    for name in ("frames", "head", "eyes"):
        values = getattr(motion, name)
        if values is not None and not all_finite(values):
            raise FacesynthError(f"{name} of the motion hold NaN or infinite values; fill the gaps first")


def _weights(motion: Motion, rig: Rig, phones: PhoneTrack | None) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    if motion.layout.kind == "curves":
        return _curves(motion), None
    known = None if motion.eyes is None else by_blocks(lambda eyes: _looking(eyes, len(rig.names)), motion.eyes, np.float64)
    if is_of_the_head(motion.layout):
        return solve_markers(MarkerBasis.of(rig, motion.layout), motion.frames, motion.fps, known)
    fit = fit_layout(rig, motion.layout, rest_of(motion))
    weights, residual = solve_markers(MarkerBasis.fitted(rig, motion.layout, fit), motion.frames, motion.fps, known)
    lips = LipGap.of(rig)
    met = weights if phones is None else with_lips_met(weights, lips, phones, motion.fps)
    return with_lips_apart(close_within_jaw(met, lips), lips), residual


def _looking(eyes: NDArray[np.float32], count: int) -> NDArray[np.float64]:
    return gaze_weights(np.zeros((len(eyes), count)), eyes[:, 1:])


def _curves(motion: Motion) -> NDArray[np.float64]:
    weights = np.zeros((len(motion), len(ARKIT_NAMES)))
    for name, column in arkit_columns(motion.layout).items():
        weights[:, ARKIT_NAMES.index(name)] = np.clip(motion.frames[:, column], 0, 1)
    return weights


# A motion's pose turns the head about the centroid c of its neutral rigid markers, the rig's about its pivot p:
# R (x - c) + c + t = R (x - p) + p + t'  with  t' = t + (R - 1)(p - c).
def _head_on(rig: Rig, motion: Motion, gain: float) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    if motion.head is None:
        return np.zeros((len(motion), 6))
    head = motion.head.astype(np.float64) * gain
    lever = PIVOT_MM - _pose_centre(rig, motion)
    head[:, 3:] += Rotation.from_rotvec(head[:, :3]).apply(lever) - lever
    return head


def _pose_centre(rig: Rig, motion: Motion) -> NDArray[np.float64]:
    layout = motion.layout
    if layout.kind != "markers":
        return PIVOT_MM
    if not is_of_the_head(layout):
        return fit_layout(rig, layout, rest_of(motion)).placed_mm()[rigid_points(layout)].mean(axis=0)
    rigid = rigid_points(layout)
    if layout.neutral is not None:
        return np.asarray(layout.neutral).reshape(-1, 3)[rigid].mean(axis=0)
    return rig.rest_mm[marker_vertices(rig, layout)[rigid]].mean(axis=0).astype(np.float64)


def _gaze(motion: Motion, made: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, 2] the motion's own gaze where it has one, else the one that was made for it."""
    if motion.eyes is not None:
        return motion.eyes[:, 1:].astype(np.float64)
    return gaze_of(_curves(motion)) if shows_gaze(motion.layout) else made[:, 1:]


def _lids(motion: Motion, weights: NDArray[np.float64], made: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T] how far blinks shut the lids, on top of what the expression does."""
    if motion.eyes is not None:
        return np.clip(1 - motion.eyes[:, 0].astype(np.float64), 0, 1)
    seen = weights[:, [ARKIT_NAMES.index(name) for name in BLINKS]].min(axis=1)
    return np.zeros(len(motion)) if (seen > ALREADY_BLINKS).any() else 1 - made[:, 0]


def _set_lids(weights: NDArray[np.float64], shut: NDArray[np.float64], *, awake: bool) -> None:
    for side in ("Left", "Right"):
        blink, squint, wide = (ARKIT_NAMES.index(f"eye{what}{side}") for what in ("Blink", "Squint", "Wide"))
        weights[:, blink] = 0.0 if awake else np.maximum(weights[:, blink], shut)
        weights[:, [squint, wide]] *= 1 - shut[:, None]


def _tongue_out(weights: NDArray[np.float64], column: int, lips: LipGap, out: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T] how far the tongue comes out: as it does already, or as the phones ask [T] where lips are open; else it would show."""
    room = np.clip((lips.opening_mm(weights) - 1.0) / 3.0, 0, 1)
    return np.maximum(weights[:, column], out * room)
