"""From speech to a face that one can watch: the way through the house, in order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.write import SUFFIXES, require_arkit, write_animation
from facesynth.face.rig.arkit_rig import Rig, pose
from facesynth.face.solve.animate import animate
from facesynth.inference.errors import unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.method import Method
from facesynth.motion.sway import quiet_head
from facesynth.progress import track

if TYPE_CHECKING:
    from facesynth.face.deform.skin import MarkerSkin
    from facesynth.face.draw.render import Renderer
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
    gains = {"head_gain": stage.head_gain, "eyes_gain": stage.eyes_gain}
    animation = animate(lively, rig, seed=stage.seed, phones=speech.phones, **gains).resampled(stage.fps)
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
    path: str | Path, performance: Performance, rig: Rig, size: tuple[int, int] = (1280, 720), own: OwnHead | None = None
) -> None:
    """Write one output; the suffix says which. It appears whole or not at all.

    own: the head that is shown, if it is not the built-in one.
    """
    is_video = check_output(path).suffix.lower() in VIDEO_SUFFIXES
    if own is not None and (is_video or Path(path).suffix.lower() != ".bvh"):
        _write_on(own, path, performance, size)
        return
    if not is_video:
        write_animation(path, performance.animation, rig, performance.motion)
        return
    from facesynth.face.draw.render import Renderer
    from facesynth.face.draw.video import write_video

    require_arkit(performance.animation, path)
    frames = rendered(performance, rig, Renderer(rig, size))
    write_video(path, frames, performance.animation.fps, performance.speech.audio, performance.speech.sample_rate)


def _write_on(own: OwnHead, path: str | Path, performance: Performance, size: tuple[int, int]) -> None:
    from facesynth.face.files.own import write_own
    from facesynth.face.own_animation import on_channels

    animation = on_channels(performance.animation, own.map)
    if Path(path).suffix.lower() not in VIDEO_SUFFIXES:
        write_own(path, animation, own)
        return
    from facesynth.face.draw.own_render import OwnRenderer
    from facesynth.face.draw.video import write_video

    pictures = OwnRenderer(own, size).pictures(animation)
    write_video(path, pictures, animation.fps, performance.speech.audio, performance.speech.sample_rate)


def rendered(performance: Performance, rig: Rig, renderer: Renderer) -> Iterator[NDArray[np.uint8]]:
    """Pictures [h, w, 3] of the face, one for each frame; the next two are drawn while one is encoded."""
    animation, skin = performance.animation, performance.skin

    def draw(k: int) -> NDArray[np.uint8]:
        return renderer.render(skin.vertices(k)) if skin else picture(animation, k, rig, renderer)

    frames, ahead = iter(range(len(animation))), deque[Future[NDArray[np.uint8]]]()
    with ThreadPoolExecutor(2, "picture") as painters:
        for _ in track(range(len(animation)), "rendering"):
            for k in islice(frames, 3 - len(ahead)):
                ahead.append(painters.submit(draw, k))
            yield ahead.popleft().result()


def picture(animation: FaceAnimation, k: int, rig: Rig, renderer: Renderer) -> NDArray[np.uint8]:
    """The face [h, w, 3] at frame k."""
    vertices = pose(rig, animation.weights[k], animation.head[k], animation.gaze[k], float(animation.tongue_up[k]))
    return renderer.render(vertices)
