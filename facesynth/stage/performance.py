"""A mouth's motion on a head in three dimensions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.formats import SUFFIXES, require_arkit, write_animation
from facesynth.face.rig.arkit import arkit_columns
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import LipGap
from facesynth.face.solve.animate import animate, with_close_within_jaw
from facesynth.face.solve.closures import with_closures_shown
from facesynth.inference.errors import unknown
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.stage.cast import Cast
from facesynth.stage.request import Request
from facesynth.stage.whole_face import whole_face

if TYPE_CHECKING:
    from facesynth.face.deform.skin import MarkerSkin
    from facesynth.face.rig.own_head import OwnHead

VIDEO_SUFFIXES = (".mp4",)
OUTPUTS = (*VIDEO_SUFFIXES, *SUFFIXES)
FPS, SIZE = 30.0, (1280, 720)
"""Rate, Hz, and size of the video, px, where none is asked for."""


@dataclass(frozen=True)
class Written:
    """What is said of a file that was written."""

    line: str
    """For a person."""
    facts: Mapping[str, Any] = field(default_factory=dict)
    """As JSON can hold it."""


def check_output(path: str | Path) -> Path:
    """A path whose suffix can be written; FacesynthError for any other."""
    if Path(path).suffix.lower() not in OUTPUTS:
        raise unknown("output type", Path(path).suffix or str(path), OUTPUTS)
    return Path(path)


@dataclass(frozen=True, eq=False)
class Performance:
    """One utterance, said by a head."""

    speech: Speech
    motion: Motion
    """What the models made, head and eyes among it, at the mouth's rate."""
    animation: FaceAnimation
    """The same on the built-in head, at the rate asked for."""
    head: Rig | OwnHead
    """The head that is shown."""
    size: tuple[int, int]
    """Of the video, px."""
    skin: MarkerSkin | None = None
    """The skin as the markers move it, in place of the weights, where that was asked for."""

    @property
    def sources(self) -> Mapping[str, str]:
        """Who moves each part of the face."""
        return self.animation.sources

    def write(self, path: Path) -> Written:
        """Write one output; the suffix says which. It appears whole or not at all."""
        from facesynth.face.rig.channel_map import on_channels
        from facesynth.face.rig.own_head import OwnHead

        shown = on_channels(self.animation, self.head.map) if isinstance(self.head, OwnHead) else self.animation
        if check_output(path).suffix.lower() in VIDEO_SUFFIXES:
            self._write_video(path, shown)
        else:
            write_animation(path, shown, self.head, self.motion)
        return Written(f"{path}: {self.speech.duration_s:.2f} s at {self.animation.fps:.5g} fps")

    def _write_video(self, path: Path, animation: FaceAnimation) -> None:
        from facesynth.face.draw.render import Renderer
        from facesynth.face.draw.video import write_video

        vertices: Callable[[int], ArrayLike] = partial(self.head.vertices, animation)
        if isinstance(self.head, Rig):
            require_arkit(animation, path)
            vertices = self.skin.vertices if self.skin else vertices
        pictures = Renderer.of(self.head, self.size).pictures(len(animation), vertices)
        write_video(path, pictures, animation.fps, self.speech.audio, self.speech.sample_rate)


@dataclass(frozen=True, eq=False)
class HeadStage:
    """The built-in head, or one's own, ready for motion after motion."""

    rig: Rig
    own: OwnHead | None
    request: Request
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, request: Request) -> HeadStage:
        """The head that a request asks for."""
        from facesynth.face.rig.arkit_rig import load_head
        from facesynth.face.rig.own_head import load_own_head

        own = load_own_head(request.rig, request.mapping) if request.rig else None
        return cls(load_head(), own, request, tuple(f"{own.source.name}: {remark}" for remark in own.remarks) if own else ())

    def perform(self, motion: Motion, speech: Speech, cast: Cast) -> Performance:
        """Put a mouth's motion on the head, with what moves head and eyes beside it, at the rate asked for."""
        asked = self.request
        face = whole_face(cast, self.as_arkit(motion), speech, asked)
        whole = animate(
            face.motion,
            self.rig,
            eyes_gain=asked.eyes.factor,
            mouth_gain=asked.mouth,
            seed=asked.seed,
            phones=speech.phones,
            eyes=face.eyes,
        )
        shown, lips = whole.resampled(float(asked.fps or FPS)), LipGap.of(self.rig)
        shown = with_close_within_jaw(with_closures_shown(shown, whole, lips, speech.phones), lips)
        animation = replace(shown, sources=face.sources)
        skin = self._skin(face.motion, animation)
        return Performance(speech, face.motion, animation, self.own or self.rig, asked.size or SIZE, skin)

    def as_arkit(self, motion: Motion) -> Motion:
        """Curves under own names as ARKit's, where a mapping says how and the head that is shown has not the same names."""
        own_names = motion.layout.kind == "curves" and not arkit_columns(motion.layout)
        known = self.own is not None and set(self.own.names) <= set(motion.layout.names)
        if self.request.mapping is None or not own_names or known:
            return motion
        from facesynth.face.rig.channel_map import ChannelMap
        from facesynth.face.rig.presets import asked_for

        names, asked = motion.layout.names, self.request.mapping
        given = asked_for(asked, names).channels
        channel_map = ChannelMap.of(names, {name: channel for name, channel in given.items() if name in names})
        frames = channel_map.arkit(motion.frames).astype(np.float32)
        return replace(motion, frames=frames, layout=Layout("curves", ARKIT_NAMES))

    def _skin(self, motion: Motion, animation: FaceAnimation) -> MarkerSkin | None:
        if self.request.deform == "shapes":
            return None
        from facesynth.face.deform.skin import marker_skin

        return marker_skin(self.request.deform, self.rig, motion, animation)
