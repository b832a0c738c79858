"""The face of a take, as `speak` would make it, for the page: the mouth's model, its cast and the head that is shown."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.behaviour.eyes import still_eyes
from facesynth.face.rig.markers import marker_layout
from facesynth.face.solve.animate import animate
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Browsing, Explaining
from facesynth.methods.method import Method
from facesynth.methods.registry import ask, require
from facesynth.motion.gaps import for_looking
from facesynth.motion.maps.phone_map import emotion_colours
from facesynth.speech.audio import load_audio
from facesynth.stage.cast import Cast, cast_for
from facesynth.stage.preview import Preview, Previewed
from facesynth.stage.request import Part, Request
from facesynth.studio.document import Line, Take
from facesynth.studio.speak_files import NODES, PINS, of_request, own_options

SOUNDS_KEPT = 4
REACH_S = 0.2
"""Around what changed, frames may look otherwise, too: weights are solved together with their neighbours."""


@dataclass(frozen=True, eq=False)
class Shown:
    """A stretch of a face in motion."""

    names: tuple[str, ...]
    """Of the head's N shapes or channels."""
    rows: NDArray[np.float32]
    """[T, N + 9] weights, head (3 rad, 3 mm), gaze (2 rad), lift of the tongue."""
    fps: float
    start: int
    """Frame of the whole that the first row is."""
    count: int
    """Frames of the whole."""


class Performing:
    """A model and a head, ready for take after take; one thread at a time."""

    def __init__(self, model: Method, request: Request) -> None:
        self.model, self.request = model, request
        self._preview = Preview(cast_for(model, request), request)
        self._sounds: dict[Path, tuple[NDArray[np.float32], int]] = {}
        self._shown: tuple[str, str] | None = None
        self._changes: list[tuple[int, float, float]] = []
        self.generation = 0
        """Rises with everything that is asked for."""

    @classmethod
    def of(cls, model: Method, rig: Path | None = None, mapping: Path | None = None) -> Self:
        """For a trained model, on the built-in head or on one's own."""
        return cls(model, Request(rig=rig, mapping=mapping))

    @property
    def head(self) -> Any:
        """What is shown: the built-in head, or one's own."""
        return self._preview.stage.own or self._preview.stage.rig

    def markers(self) -> list[tuple[str, float, float, float]]:
        """Name and place (mm) of the markers on the built-in head at rest; one's own head has none."""
        if self._preview.stage.own is not None:
            return []
        layout = marker_layout(self._preview.stage.rig)
        places = np.asarray(layout.neutral, np.float64).reshape(-1, 3).tolist()
        return [(name, x, y, z) for name, (x, y, z) in zip(layout.names, places, strict=True)]

    def speech(self, sound: Path, line: Line, take: Take) -> Speech:
        """What a take says."""
        if sound not in self._sounds:
            self._sounds[sound] = load_audio(sound)
            for old in list(self._sounds)[:-SOUNDS_KEPT]:
                del self._sounds[old]
        return Speech(*self._sounds[sound], take.phone_track(), take.emotion_track(), line.text)

    def change(self, sound: Path, edits: Path | None, line: Line, take: Take) -> Previewed:
        """A take as it stands; its parts are made when they are asked for. edits: a file of removed and drawn nodes."""
        now = self._preview.change(self.speech(sound, line, take), self._asked(edits, take))
        self.generation += 1
        if self._shown != (line.name, take.name):
            self._shown, self._changes = (line.name, take.name), [(self.generation, 0.0, inf)]
        elif now.draft.changed_s is not None:
            start_s, stop_s = now.draft.changed_s
            self._changes.append((self.generation, start_s - REACH_S, stop_s + REACH_S))
        return now

    def stale(self, generation: int, start_s: float, stop_s: float) -> bool:
        """Whether a stretch of what is shown now may look otherwise than it did at a generation."""
        return any(number > generation and start_s < b and a < stop_s for number, a, b in self._changes)

    def stretch(self, now: Previewed, start_s: float, stop_s: float) -> Shown:
        """Frames of a take."""
        animation = now.animation(start_s, stop_s)
        count = max(round(now.speech.duration_s * animation.fps), 1)
        return _rows(animation, min(round(start_s * animation.fps), count - 1), count)

    def whole(self, sound: Path, edits: Path | None, line: Line, take: Take) -> Shown:
        """The whole face of a take."""
        now = self.change(sound, edits, line, take)
        return self.stretch(now, 0.0, now.speech.duration_s)

    def explanation(self, sound: Path, edits: Path | None, line: Line, take: Take) -> list[dict[str, Any]]:
        """Why each phone got its motion, with what could stand there as well; FacesynthError where the model cannot tell."""
        speech, request = self.speech(sound, line, take), self._asked(edits, take)
        return require(self.model, Explaining).explain(speech, **self._preview.cast.options(request, speech.phones))

    def of_motion(self, motion: Motion, speech: Speech) -> Shown:
        """A recording on the head, gaps filled so that it can be looked at."""
        request = replace(self.request, head=Part("recorded"), eyes=Part("recorded"))
        stage = replace(self._preview.stage, request=request)
        animation = self._preview.shown(stage.perform(for_looking(motion), speech, Cast(self.model)).animation)
        return _rows(animation, 0, len(animation))

    def of_frames(self, frames: NDArray[np.float32], fps: float) -> Shown:
        """Frames [T, C] of the mouth's layout on a head that holds still."""
        stage = self._preview.stage
        motion = stage.as_arkit(Motion(frames, fps, self.model.fitted_layout))
        animation = self._preview.shown(animate(motion, stage.rig, head_gain=0.0, eyes=still_eyes))
        return _rows(animation, 0, len(animation))

    def _asked(self, edits: Path | None, take: Take) -> Request:
        """The same as for the files of the take, without the files."""
        own: dict[str, Any] = dict(own_options(take, self.model.capabilities))
        if take.pins and self.model.capabilities.option(PINS):
            own[PINS] = {pin.phone: pin.node for pin in take.pins}
        if edits is not None and self.model.capabilities.option(NODES):
            own[NODES] = edits
        return replace(self.request, own=own, **of_request(take))


def _rows(animation: FaceAnimation, start: int, count: int) -> Shown:
    parts = [animation.weights, animation.head, animation.gaze, animation.tongue_up[:, None]]
    return Shown(animation.names, np.concatenate(parts, axis=1).astype(np.float32), animation.fps, start, count)


def model_facts(model: Method, path: Path) -> Mapping[str, Any]:
    """What the page must know of a model: it shows what is stated, and asks for no name."""
    stated = model.capabilities
    options = [
        {"name": one.name, "type": one.type.__name__, "help": one.help, "least": one.least, "most": one.most}
        for one in stated.options
        if one.type is not Path
    ]
    return {
        "path": str(path),
        "method": stated.name,
        "summary": stated.summary,
        "emotions": list(model.emotions),
        "colours": emotion_colours(model.emotions),
        "options": options,
        "pins": stated.option(PINS) is not None,
        "edits": stated.option(NODES) is not None,
        "mapped": list(found.mapped_phones()) if (found := ask(model, Browsing)) else [],
        "explains": Explaining in stated.abilities,
    }
