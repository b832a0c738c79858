"""From speech to a face that one can watch: the way through the house, in order."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.formats import SUFFIXES, require_arkit, write_animation
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.solve.animate import animate
from facesynth.inference.errors import unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.method import Method
from facesynth.motion.sway import quiet_head

if TYPE_CHECKING:
    from facesynth.face.deform.skin import MarkerSkin
    from facesynth.face.rig.own_head import OwnHead

VIDEO_SUFFIXES = (".mp4",)
OUTPUTS = (*VIDEO_SUFFIXES, *SUFFIXES)


@dataclass(frozen=True, eq=False)
class Performance:
    """One utterance, said by a face."""

    speech: Speech
    motion: Motion
    """What the method made, at its own rate."""
    animation: FaceAnimation
    """The same on the head, at the rate asked for."""
    skin: MarkerSkin | None = None
    """The skin as the markers move it, in place of the weights, where that was asked for."""


@dataclass(frozen=True)
class Stage:
    """How a motion is put on the head."""

    fps: float = 30.0
    head_gain: float = 1.0
    eyes_gain: float = 1.0
    seed: int = 0
    deform: str = "shapes"
    """What moves the skin in pictures: `shapes` (the solved weights), or the markers by `distance` or by `regions`."""


def perform(
    method: Method,
    speech: Speech,
    rig: Rig,
    stage: Stage,
    options: Mapping[str, Any] | None = None,
    change: Callable[[Motion], Motion] | None = None,
) -> Performance:
    """Synthesise and put on the head; `options` go to the method, whose motion `change` may change.

    A method that makes no head motion gets a quiet sway with nods where the voice is loud.
    """
    motion = method.synthesize(speech, seed=stage.seed, **(options or {}))
    motion = change(motion) if change else motion
    lively = motion
    if motion.head is None:
        lively = replace(motion, head=quiet_head(len(motion), motion.fps, loudness(speech, motion), stage.seed))
    animation = animate(
        lively, rig, head_gain=stage.head_gain, eyes_gain=stage.eyes_gain, seed=stage.seed, phones=speech.phones
    ).resampled(stage.fps)
    return Performance(speech, motion, animation, _skin(motion, animation, rig, stage))


def _skin(motion: Motion, animation: FaceAnimation, rig: Rig, stage: Stage) -> MarkerSkin | None:
    if stage.deform == "shapes":
        return None
    from facesynth.face.deform.skin import marker_skin

    return marker_skin(stage.deform, rig, motion, animation)


def loudness(speech: Speech, motion: Motion) -> NDArray[np.float64]:
    """[T] root mean square of the sound around each frame, over its loudest tenth, at most 1."""
    window = max(int(0.03 * speech.sample_rate), 1)
    power = np.convolve(speech.audio.astype(np.float64) ** 2, np.ones(window) / window, mode="same")
    at = np.minimum((motion.times_s * speech.sample_rate).astype(np.int64), len(power) - 1)
    level = np.sqrt(power[at])
    return np.minimum(level / max(float(np.percentile(level, 90)), 1e-9), 1.0)


def check_output(path: str | Path) -> Path:
    """A path whose suffix can be written; FacesynthError for any other."""
    if Path(path).suffix.lower() not in OUTPUTS:
        raise unknown("output type", Path(path).suffix or str(path), OUTPUTS)
    return Path(path)


def write_performance(
    path: str | Path, performance: Performance, head: Rig | OwnHead, size: tuple[int, int] = (1280, 720)
) -> None:
    """Write one output of the head that is shown; the suffix says which. It appears whole or not at all."""
    from facesynth.face.rig.channel_map import on_channels
    from facesynth.face.rig.own_head import OwnHead

    shown = on_channels(performance.animation, head.map) if isinstance(head, OwnHead) else performance.animation
    if check_output(path).suffix.lower() in VIDEO_SUFFIXES:
        _write_video(path, replace(performance, animation=shown), head, size)
    else:
        write_animation(path, shown, head, performance.motion)


def _write_video(path: str | Path, performance: Performance, head: Rig | OwnHead, size: tuple[int, int]) -> None:
    from facesynth.face.draw.render import Renderer
    from facesynth.face.draw.video import write_video

    animation, speech = performance.animation, performance.speech
    vertices: Callable[[int], ArrayLike] = partial(head.vertices, animation)
    if isinstance(head, Rig):
        require_arkit(animation, path)
        vertices = performance.skin.vertices if performance.skin else vertices
    pictures = Renderer.of(head, size).pictures(len(animation), vertices)
    write_video(path, pictures, animation.fps, speech.audio, speech.sample_rate)
