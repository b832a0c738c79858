"""What a head will do, shown while the speech is still being edited.

A window of the mouth's motion becomes weights within a few hundredths of a second: only its frames are solved, at the rate
that is shown, and head and eyes, which follow the sound, are made once for each sound. `HeadStage` makes what is exported: from
all frames at the mouth's own rate, which a preview differs from by little.
"""

from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.behaviour.eyes import still_eyes
from facesynth.face.rig.channel_map import on_channels
from facesynth.face.solve.animate import animate
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.capabilities import Draft
from facesynth.methods.editing import editor_of
from facesynth.stage.cast import Cast
from facesynth.stage.performance import FPS, HeadStage
from facesynth.stage.request import Request
from facesynth.stage.whole_face import whole_face

MARGIN_S = 0.1
"""Frames around a window that are solved with it, so that it does not begin or end otherwise than the whole."""
STILL = Layout("curves", ("still",))


@dataclass(frozen=True, eq=False)
class Previewed:
    """A speech as it stands; its parts are made when they are asked for."""

    preview: "Preview"
    speech: Speech
    request: Request
    draft: Draft

    def animation(self, start_s: float = 0.0, stop_s: float | None = None) -> FaceAnimation:
        """The frames from `start_s` to `stop_s`, at the rate asked for (30 Hz otherwise), on the head that is shown."""
        fps = float(self.request.fps or FPS)
        count = max(round(self.speech.duration_s * fps), 1)
        last = count if stop_s is None else min(round(stop_s * fps), count)
        first = min(max(round(start_s * fps), 0), max(last - 1, 0))
        margin = round(MARGIN_S * fps)
        around = range(max(first - margin, 0), min(max(last, first + 1) + margin, count))
        own = slice(first - around.start, max(last, first + 1) - around.start)
        return self.preview.shown(_part(self.preview.solved(self, around, fps), own))


class Preview:
    """A cast and a head, for one change of a speech after the other. A changed request is given with the change."""

    def __init__(self, cast: Cast, request: Request) -> None:
        self.cast, self.stage = cast, HeadStage.of(request)
        self._editor = editor_of(cast.mouth)
        self._beside: tuple[Hashable, Motion, NDArray[np.float64]] | None = None

    def change(self, speech: Speech, request: Request) -> Previewed:
        """The speech as it stands now; options of the mouth's own are in the request, as files or as what they hold."""
        draft = self._editor.change(self.cast.said(speech), seed=request.seed, **self.cast.options(request, speech.phones))
        if self.cast.expression is not None or self.cast.mapper is not None:
            draft = _Whole(draft, self.cast.finished(draft.motion(), speech, request))
        return Previewed(self, speech, request, draft)

    def shown(self, animation: FaceAnimation) -> FaceAnimation:
        """On the channels of one's own head, where that is shown."""
        return animation if self.stage.own is None else on_channels(animation, self.stage.own.map)

    def solved(self, now: Previewed, frames: range, fps: float) -> FaceAnimation:
        """Frames of the whole at a rate, on the built-in head."""
        mouth = now.draft.motion(frames.start / fps, frames.stop / fps)
        first = round(frames.start / fps * mouth.fps)
        places = np.minimum(
            np.round(np.arange(frames.start, frames.stop) / fps * mouth.fps).astype(np.int64) - first, len(mouth) - 1
        )
        head, eyes = self._head_and_eyes(now, mouth, fps)
        own = slice(frames.start, frames.stop)
        motion = Motion(
            mouth.frames[places],
            fps,
            mouth.layout,
            head=None if head.head is None else head.head[own],
            eyes=None if head.eyes is None else head.eyes[own],
        )
        asked = now.request
        return animate(
            self.stage.as_arkit(motion),
            self.stage.rig,
            eyes_gain=asked.eyes.factor,
            mouth_gain=asked.mouth,
            seed=asked.seed,
            phones=_cut(now.speech.phones, frames.start / fps, frames.stop / fps),
            eyes=lambda *_: eyes[own],
        )

    def _head_and_eyes(self, now: Previewed, mouth: Motion, fps: float) -> tuple[Motion, NDArray[np.float64]]:
        """Of the whole at a rate; made anew only where the sound, its length or what moves them changed."""
        speech, asked = now.speech, now.request
        key = (hash(speech.audio.tobytes()), speech.duration_s, fps, asked.seed, asked.head, asked.eyes)
        if self._beside is None or self._beside[0] != key:
            count = max(round(speech.duration_s * fps), 1)
            layout = self.stage.as_arkit(mouth).layout
            still = Motion(np.zeros((count, layout.channels), np.float32), fps, layout)
            if mouth.head is not None or mouth.eyes is not None:
                still = _at_rate(now.draft.motion(), fps, count)
            face = whole_face(self.cast, still, speech, asked)
            turned = np.zeros((count, 6), np.float32) if face.motion.head is None else face.motion.head
            eyes = face.eyes if face.motion.eyes is None else still_eyes
            self._beside = key, face.motion, eyes(turned, fps, speech.phones, asked.seed)
        return self._beside[1:]


@dataclass(frozen=True, eq=False)
class _Whole:
    """A draft whose motion was changed as a whole."""

    draft: Draft
    whole: Motion

    @property
    def changed_s(self) -> tuple[float, float] | None:
        return self.draft.changed_s

    def motion(self, start_s: float = 0.0, stop_s: float | None = None) -> Motion:
        end_s = self.whole.duration_s if stop_s is None else stop_s
        return _frames(
            self.whole, np.arange(round(start_s * self.whole.fps), min(round(end_s * self.whole.fps), len(self.whole)))
        )

    def choices(self) -> list[dict[str, object]]:
        return self.draft.choices()


def _frames(motion: Motion, places: NDArray[np.int64]) -> Motion:
    head, eyes = (None if part is None else part[places] for part in (motion.head, motion.eyes))
    return replace(motion, frames=motion.frames[places], head=head, eyes=eyes)


def _at_rate(motion: Motion, fps: float, count: int) -> Motion:
    """Head and eyes alone, at the nearest frames of another rate."""
    near = _frames(motion, np.minimum(np.round(np.arange(count) / fps * motion.fps).astype(np.int64), len(motion) - 1))
    return Motion(np.zeros((count, 1), np.float32), fps, STILL, near.head, near.eyes)


def _cut(phones: PhoneTrack, start_s: float, stop_s: float) -> PhoneTrack:
    """The phones of a window, which then begins at 0."""
    first = min(int(np.searchsorted(phones.ends_s, start_s, side="right")), len(phones) - 1)
    last = min(int(np.searchsorted(phones.ends_s, stop_s, side="left")), len(phones) - 1)
    ends_s = np.maximum(phones.ends_s[first : last + 1] - start_s, 1e-6)
    return PhoneTrack(phones.labels[first : last + 1], ends_s)


def _part(animation: FaceAnimation, own: slice) -> FaceAnimation:
    residual = None if animation.residual_mm is None else animation.residual_mm[own]
    tracks = {name: getattr(animation, name)[own] for name in ("weights", "head", "gaze", "tongue_up")}
    return replace(animation, residual_mm=residual, **tracks)
