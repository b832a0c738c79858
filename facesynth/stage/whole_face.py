"""One whole face of what several models make: mouth first, then the head, then the eyes, which go with the head."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facesynth.face.behaviour.eyes import EyeMotion, still_eyes
from facesynth.face.rig.arkit import shows_gaze
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.capabilities import Accounting, Looking
from facesynth.methods.registry import ask
from facesynth.methods.trained import TrainedModel
from facesynth.motion.resample import resample
from facesynth.stage.cast import Cast
from facesynth.stage.request import Request
from facesynth.zoo.shelf import load

HEAD, EYES = "head", "eyes"
"""Models that come with the package, for faces of which nobody recorded these."""


@dataclass(frozen=True, eq=False)
class WholeFace:
    """A motion with the head and eyes of whoever moves them."""

    motion: Motion
    eyes: EyeMotion
    """Moves the eyes where the motion shows none of its own."""
    sources: Mapping[str, str]
    """Who moves the mouth, the head and the eyes, and who adds expression to it."""


def whole_face(cast: Cast, motion: Motion, speech: Speech, request: Request) -> WholeFace:
    """Head and eyes beside a mouth's motion, with the factors that were asked for: what the eyes go with is what is shown."""
    sources = {"mouth": described(cast.mouth)}
    if cast.expression is not None:
        sources["expression"] = described(cast.expression)
    follows = _head_may_follow(cast, motion, request)
    motion, sources["head"] = _with_head(cast, motion, speech, request)
    motion, eyes, sources["eyes"] = _with_eyes(cast, motion, speech, request)
    if follows and eyes is packaged_eyes:
        motion, eyes = _head_led_by_eyes(motion, speech, request)
        sources["head"] += ", and with wide shifts of the gaze"
    return WholeFace(motion, eyes, sources)


def described(model: TrainedModel) -> str:
    """A model by its method and file."""
    return model.name if model.path is None else f"{model.name} ({model.path.name})"


def _with_head(cast: Cast, motion: Motion, speech: Speech, request: Request) -> tuple[Motion, str]:
    if request.head.source == "off":
        return replace(motion, head=None), "off"
    if cast.head is not None:
        own = cast.options(request, speech.phones, cast.head)
        head = at_clock(cast.head.synthesize(speech, seed=request.seed, **own), motion).head
        return replace(motion, head=scaled(head, request.head.gain)), described(cast.head)
    if motion.head is not None:
        return replace(motion, head=scaled(motion.head, request.head.gain)), "as the mouth's model recorded it"
    if request.head.source == "recorded":
        return motion, "still: none was recorded"
    head = at_clock(_packaged_head().synthesize(speech, seed=request.seed), motion).head if len(motion) else None
    return replace(motion, head=scaled(head, request.head.gain)), "from the sound, as other people's of the package"


def _with_eyes(cast: Cast, motion: Motion, speech: Speech, request: Request) -> tuple[Motion, EyeMotion, str]:
    if request.eyes.source == "off":
        return motion, still_eyes, "off"
    if cast.eyes is not None:
        said = described(cast.eyes) + _account(cast.eyes, speech, request)
        return _looking(cast, cast.eyes, motion, speech, request), still_eyes, said
    if motion.eyes is not None:
        return motion, still_eyes, "as the mouth's model recorded them"
    if request.eyes.source == "recorded":
        return motion, still_eyes, "as the mouth's motion shows them, else still"
    return motion, packaged_eyes, "as the mouth's motion shows them, else grown from recorded ones of the package"


def _looking(cast: Cast, eyes: TrainedModel, motion: Motion, speech: Speech, request: Request) -> Motion:
    """The motion with the eyes of their own model, which turns the head only where the head is not held still."""
    if (looking := ask(eyes, Looking)) is None:
        own = cast.options(request, speech.phones, eyes)
        return replace(motion, eyes=at_clock(eyes.synthesize(speech, seed=request.seed, **own), motion).eyes)
    return looking.look(motion, seed=request.seed, phones=speech.phones, turning=request.head.factor)


def _head_may_follow(cast: Cast, motion: Motion, request: Request) -> bool:
    """Whether the package's head moves, which follows the package's eyes; any other is left to whoever moves it."""
    packaged = cast.head is None and motion.head is None and request.head.source == "default"
    return packaged and len(motion) > 0 and min(request.head.gain, request.eyes.gain) > 0 and not shows_gaze(motion.layout)


def _head_led_by_eyes(motion: Motion, speech: Speech, request: Request) -> tuple[Motion, EyeMotion]:
    """The package's head, which follows the wide shifts of the package's eyes, and these eyes as an `EyeMotion`."""
    looked = _packaged().look(motion, seed=request.seed, phones=speech.phones, turning=request.head.gain)
    eyes = np.asarray(looked.eyes, np.float64)
    return replace(motion, head=looked.head), lambda *_: eyes


def _account(model: TrainedModel, speech: Speech, request: Request) -> str:
    if (accounting := ask(model, Accounting)) is None:
        return ""
    facts = accounting.account(speech, seed=request.seed).facts
    return ": " + ", ".join(f"{name} {value}" for name, value in facts.items())


def packaged_eyes(head: NDArray[np.floating], fps: float, phones: PhoneTrack | None, seed: int) -> NDArray[np.float64]:
    """An `EyeMotion` of the model that comes with the package, beside a head that does not follow it."""
    still = Motion(np.zeros((len(head), 1), np.float32), fps, Layout("curves", ("still",)), head.astype(np.float32))
    eyes = _packaged().look(still, seed=seed, phones=phones, turning=0.0).eyes
    return np.zeros((0, 3)) if eyes is None else eyes.astype(np.float64)


@cache
def _packaged() -> Looking:
    model = ask(load(EYES), Looking)
    if model is None:
        raise TypeError(f"the model {EYES} moves no eyes")
    return model


@cache
def _packaged_head() -> TrainedModel:
    return load(HEAD)


def scaled(head: NDArray[np.float32] | None, gain: float) -> NDArray[np.float32] | None:
    """A head [T, 6] that turns and shifts by a factor."""
    return None if head is None else (gain * head).astype(np.float32)


def at_clock(part: Motion, motion: Motion) -> Motion:
    """Head and eyes of one motion at the frames of another, which may be a frame longer: there they are held."""
    still = np.zeros((len(part), 1), np.float32)
    there = resample(replace(part, frames=still, layout=Layout("curves", ("still",))), motion.fps)
    at = np.minimum(np.arange(len(motion)), len(there) - 1)
    head, eyes = (None if value is None else value[at] for value in (there.head, there.eyes))
    return replace(there, frames=there.frames[at], head=head, eyes=eyes)
