"""Phones become movements of jaw, lips and tongue: a co-articulation model after Cohen and Massaro (1993).

Every phone is a gesture whose claim on an articulator rises before it sounds and fades after it. What the articulator does
is the mean of all targets, weighted by their claims, so that strong claims (rounding for `w`, a shut jaw for `s`) pull
their neighbours along and weak ones (`hh`, `k`) take the shape of what surrounds them. Contacts are no matter of averages:
lips that close for p, b, m do close, and are carried as tracks of their own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.phones import VOWELS
from facesynth.inference.speech import PhoneTrack
from facesynth.performer.targets import CURVES, DIPHTHONGS, GLIDE_AT, Closes, Target, load_targets

REACH_S = 0.6
"""Beyond this a gesture is not felt."""
FULL_VOWEL_S = 0.10
"""Vowels shorter than this undershoot their targets."""
PAUSE_S = 0.22
"""The mouth shuts in silences that last at least this long."""
FLOOR = 1e-6
"""Dominance of the rest pose where nothing else is claimed."""
FADE: Mapping[str, float] = {
    "long": 0.0826,
    "loud": 0.4458,
    "held": 0.0306,
    "before_s": 0.0396,
    "before": 0.1086,
    "after_s": 0.0307,
    "after": 0.0657,
    "smooth_s": 0.0379,
}
"""How openings rise and fade, calibrated on a recorded talker by train/performer_targets.py: exponents of a vowel's length and
loudness; the share of a phone to either side of its middle over which it is felt in full; time constants before and after it,
and what each second of it adds to them; inertia of the jaw."""
SMOOTH_S = {"jaw": FADE["smooth_s"], "lips": 0.7 * FADE["smooth_s"], "tongue": 0.009}
"""Inertia of the articulators: standard deviation of the Gaussian that smooths them."""
TIGHTEST_MM, LOOSEST_MM = -0.4, 0.3
"""Inner-lip gap at a closure: lips are pressed together more or less, from token to token."""
JAW, OPENING, LIP_WIDTH = (
    [CURVES.index("jaw_open")],
    [CURVES.index("lower_down"), CURVES.index("upper_up")],
    [CURVES.index(name) for name in ("pucker", "funnel", "stretch", "smile")],
)


@dataclass(frozen=True, eq=False)
class Articulation:
    """What jaw, lips and tongue do over T frames."""

    curves: NDArray[np.float64]
    """[T, 14] value of each curve of `CURVES`, 0..1, emotions left out."""
    closure: NDArray[np.float64]
    """[T] 1 where the lips are shut, 0 where they are free."""
    closed_gap_mm: NDArray[np.float64]
    """[T] inner-lip gap that the closure aims at."""
    tuck: NDArray[np.float64]
    """[T] 1 where the lower lip is at the upper teeth."""


@dataclass(frozen=True, eq=False)
class Gesture:
    """One phone, or half a diphthong, as it is meant this time."""

    target: Target
    start_s: float
    end_s: float
    closed_gap_mm: float

    @property
    def duration_s(self) -> float:
        """How long it sounds, seconds."""
        return self.end_s - self.start_s

    @property
    def closes(self) -> Closes:
        """Which contact it makes; short silences make none."""
        short = self.target.closes == "rest" and self.duration_s < PAUSE_S
        return "" if short else self.target.closes


def articulate(
    phones: PhoneTrack,
    loudness: NDArray[np.float64],
    fps: float,
    *,
    effort: NDArray[np.float64] | float = 1.0,
    rng: np.random.Generator,
) -> Articulation:
    """Move jaw, lips and tongue through the phones.

    loudness: [T] of the voice at each frame, 1 = loud; effort: [T] or one factor of every movement (anger articulates
    more, sadness less); rng: tokens of one phone differ by a tenth in size and some milliseconds in time.
    """
    count = len(loudness)
    if not count or not fps > 0:
        raise FacesynthError(f"articulation needs frames and a rate; got {count} frames at {fps} fps")
    times = np.arange(count) / fps
    gestures = [_as_meant(gesture, times, loudness, rng) for gesture in gestures_of(phones)]
    curves = _blend(gestures, times)
    for who, sigma in (("jaw", SMOOTH_S["jaw"]), ("tongue", SMOOTH_S["tongue"]), ("", SMOOTH_S["lips"])):
        columns = [i for i, name in enumerate(CURVES) if _inertia(name) == who]
        curves[:, columns] = gaussian_filter1d(curves[:, columns], sigma * fps, axis=0, mode="nearest")
    closure, gap, tuck = contacts(gestures, times)
    curves = curves * np.broadcast_to(effort, count)[:, None]
    return Articulation(_with_contacts(curves, closure, tuck), closure, gap, tuck)


def gestures_of(phones: PhoneTrack) -> list[Gesture]:
    """Phones in order as gestures; diphthongs are two."""
    targets = load_targets()
    gestures: list[Gesture] = []
    for label, start, end in zip(phones.labels, phones.starts_s.tolist(), phones.ends_s.tolist(), strict=True):
        if label not in targets and label not in DIPHTHONGS:
            raise unknown("phone", label, [*targets, *DIPHTHONGS])
        first, *rest = DIPHTHONGS.get(label, (label,))
        middle = start + GLIDE_AT * (end - start) if rest else end
        gestures.append(Gesture(targets[first], start, middle, 0.0))
        gestures += [Gesture(targets[name], middle, end, 0.0) for name in rest]
    return gestures


def _as_meant(gesture: Gesture, times: NDArray[np.float64], loudness: NDArray[np.float64], rng: np.random.Generator) -> Gesture:
    """One token of the phone: undershot where short or weak, and never quite the same twice."""
    jaw, opening, width = np.exp(rng.normal(0.0, (0.08, 0.10, 0.10)))
    shift = float(np.clip(rng.normal(0.0, 0.006), -0.012, 0.012)) if gesture.closes == "" else 0.0
    gap = float(rng.uniform(TIGHTEST_MM, LOOSEST_MM))
    pose = gesture.target.pose.copy()
    pose[JAW] *= jaw
    pose[OPENING] *= opening
    pose[LIP_WIDTH] *= width
    if gesture.target.phone in VOWELS:
        reached = _reached(gesture, times, loudness)
        pose[JAW] *= reached
        pose[OPENING] *= reached
    if gesture.target.closes == "rest" and gesture.closes == "":
        pose[JAW] = 0.03  # a short pause stays a little open
    target = replace(gesture.target, pose=pose)
    return Gesture(target, gesture.start_s + shift, gesture.end_s + shift, gap)


def _reached(gesture: Gesture, times: NDArray[np.float64], loudness: NDArray[np.float64]) -> float:
    """Share of a vowel's opening that is reached: less where it is short or weak, more where it is long and loud."""
    long = float(np.clip((gesture.duration_s / FULL_VOWEL_S) ** FADE["long"], 0.4, 1.25))
    return long * heard_loudness(gesture, times, loudness) ** FADE["loud"]


def heard_loudness(gesture: Gesture, times: NDArray[np.float64], loudness: NDArray[np.float64]) -> float:
    """How loud the loudest part of a gesture is, 0.3..1.4; loudness: [T] at times [T] (s)."""
    heard = loudness[(times >= gesture.start_s) & (times <= gesture.end_s)]
    return float(np.clip(heard.max(initial=0.3), 0.3, 1.4))


def _blend(gestures: Sequence[Gesture], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, 14] targets weighted by dominance (Cohen and Massaro 1993, equations 1-3).

    `D_p(t) = alpha_p exp(-(theta_p |tau|)^c)` with tau the time from the gesture, and
    `F(t) = sum_p D_p(t) T_p / sum_p D_p(t)`. Here tau is 0 over the middle of the phone, c = 1.25, and 1/theta grows
    with the phone's duration: fast speech reaches less far, and so do its targets. It is larger before the phone than after
    it, since speakers prepare more than they linger.
    """
    weighted = np.zeros((len(times), len(CURVES)))
    claimed = np.full((len(times), len(CURVES)), FLOOR)
    for gesture in gestures:
        near = slice(*np.searchsorted(times, [gesture.start_s - REACH_S, gesture.end_s + REACH_S]))
        dominance = gesture.target.dominance * _felt(gesture, times[near])[:, None]
        weighted[near] += dominance * gesture.target.pose
        claimed[near] += dominance
    return weighted / claimed


def _felt(gesture: Gesture, times: NDArray[np.float64]) -> NDArray[np.float64]:
    centre, duration = (gesture.start_s + gesture.end_s) / 2, gesture.duration_s
    away = np.maximum(np.abs(times - centre) - FADE["held"] * duration, 0.0)
    before = gesture.target.early * (FADE["before_s"] + FADE["before"] * min(duration, 0.16))
    after = gesture.target.late * (FADE["after_s"] + FADE["after"] * min(duration, 0.16))
    felt: NDArray[np.float64] = np.exp(-((away / np.where(times < centre, before, after)) ** 1.25))
    return felt


def contacts(
    gestures: Sequence[Gesture], times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Closure [T], the gap it aims at [T] and tuck [T]: contacts are held, whatever the neighbours want."""
    closure, tuck = np.zeros(len(times)), np.zeros(len(times))
    aim, weight = np.zeros(len(times)), np.full(len(times), FLOOR)
    for index, gesture in enumerate(gestures):
        if gesture.closes == "":
            continue
        near = slice(*np.searchsorted(times, [gesture.start_s - REACH_S, gesture.end_s + REACH_S]))
        held = _held(gestures, index, times[near])
        track = tuck if gesture.closes == "teeth" else closure
        track[near] = np.maximum(track[near], held)
        if gesture.closes != "teeth":
            aim[near] += held * gesture.closed_gap_mm
            weight[near] += held
    return closure, aim / weight, tuck


def _held(gestures: Sequence[Gesture], index: int, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far a contact is made over time: 1 while it is held, with smooth ways in and out that the neighbours' time allows."""
    gesture, duration = gestures[index], gestures[index].duration_s
    start, end = gesture.start_s, gesture.end_s
    if gesture.closes == "teeth":
        return bump(times, start + 0.1 * duration, start + 0.85 * duration, 0.06, 0.06)
    if gesture.closes == "rest":
        first, last = index == 0, index == len(gestures) - 1
        return 0.97 * bump(times, start - 1.0 if first else start + 0.10, end + 1.0 if last else end - 0.10, 0.12, 0.10)
    before = gestures[index - 1].duration_s if index else 0.12
    after = gestures[index + 1].duration_s if index + 1 < len(gestures) else 0.12
    shut = start + 0.12 * duration - 0.004
    opened = start + 0.80 * duration if gesture.target.phone in ("m", "em") else start + 0.62 * duration
    attack, release = np.clip(0.65 * before, 0.045, 0.09), np.clip(0.6 * after, 0.04, 0.08)
    return bump(times, shut, max(opened, shut + 0.022), attack, release)


def bump(times: NDArray[np.float64], start_s: float, end_s: float, attack_s: float, release_s: float) -> NDArray[np.float64]:
    """[T] 1 from start to end, with a smooth step of `attack_s` before and of `release_s` after; 0 elsewhere."""
    inside = np.minimum(1 - (start_s - times) / attack_s, 1 - (times - end_s) / release_s)
    ramp = np.clip(inside, 0.0, 1.0)
    smooth: NDArray[np.float64] = ramp * ramp * (3 - 2 * ramp)
    return smooth


def _with_contacts(curves: NDArray[np.float64], closure: NDArray[np.float64], tuck: NDArray[np.float64]) -> NDArray[np.float64]:
    """Curves that only make sense with a contact follow it, and those that would prise it open give way."""
    column = {name: i for i, name in enumerate(CURVES)}
    tucked = load_targets()["f"].pose[column["roll_lower"]]
    result = curves.copy()
    result[:, column["roll_lower"]] = np.maximum(curves[:, column["roll_lower"]] * (1 - tuck), tuck * tucked)
    result[:, column["roll_upper"]] *= (1 - tuck) * np.minimum(1.3 * closure, 1.0)
    result[:, column["press"]] *= np.minimum(1.3 * closure, 1.0)
    for name in ("lower_down", "upper_up", "funnel"):
        result[:, column[name]] *= 1 - 0.92 * closure
    result[:, column["lower_down"]] *= 1 - 0.85 * tuck
    result[:, column["tongue_out"]] *= 1 - np.maximum(closure, tuck)
    return np.clip(result, 0.0, 1.0)


def _inertia(curve: str) -> str:
    return curve.split("_", maxsplit=1)[0] if curve.startswith(("jaw", "tongue")) else ""
