"""The face of a take, as `speak` would make it, for the page: the mouth's model, its cast and the head that is shown."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.channel_map import on_channels
from facesynth.face.rig.own_head import OwnHead
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Explaining
from facesynth.methods.method import Method
from facesynth.methods.registry import ask, require
from facesynth.speech.audio import load_audio
from facesynth.stage.cast import Cast, cast_for
from facesynth.stage.performance import HeadStage, Performance
from facesynth.stage.request import Request
from facesynth.studio.document import Document, Line, Take
from facesynth.studio.speak_files import NODES, PINS, of_request, own_options

SOUNDS_KEPT = 4


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
    """A model and a head, ready for take after take."""

    def __init__(self, model: Method, stage: HeadStage) -> None:
        self.model, self._stage = model, stage
        self._sounds: dict[Path, tuple[NDArray[np.float32], int]] = {}

    @classmethod
    def of(cls, model: Method, rig: Path | None = None, mapping: Path | None = None) -> Self:
        """For a trained model, on the built-in head or on one's own."""
        return cls(model, HeadStage.of(Request(rig=rig, mapping=mapping)))

    @property
    def head(self) -> Any:
        """What is shown: the built-in head, or one's own."""
        return self._stage.own or self._stage.rig

    def speech(self, sound: Path, line: Line, take: Take) -> Speech:
        """What a take says."""
        if sound not in self._sounds:
            self._sounds[sound] = load_audio(sound)
            for old in list(self._sounds)[:-SOUNDS_KEPT]:
                del self._sounds[old]
        return Speech(*self._sounds[sound], take.phone_track(), take.emotion_track(), line.text)

    def whole(self, sound: Path, document: Document, line: Line, take: Take) -> Shown:
        """The whole face of a take."""
        return self._shown(self._performance(sound, document, line, take).animation)

    def explanation(self, sound: Path, document: Document, line: Line, take: Take) -> list[dict[str, Any]]:
        """Why each phone got its motion; nothing where the model does not tell."""
        if ask(self.model, Explaining) is None:
            return []
        speech = self.speech(sound, line, take)
        cast, request = self._asked(document, take)
        return require(self.model, Explaining).explain(speech, **cast.options(request, speech.phones))

    def of_motion(self, motion: Motion, speech: Speech) -> Shown:
        """A recording on the head."""
        stage = replace(self._stage, request=replace(self._stage.request, **of_request(_RECORDED)))
        return self._shown(stage.perform(motion, speech, Cast(self.model)).animation)

    def _performance(self, sound: Path, document: Document, line: Line, take: Take) -> Performance:
        speech = self.speech(sound, line, take)
        cast, request = self._asked(document, take)
        motion = cast.motion(speech, request, cast.options(request, speech.phones))
        return replace(self._stage, request=request).perform(motion, speech, cast)

    def _asked(self, document: Document, take: Take) -> tuple[Cast, Request]:
        """The same as for the files of the take, without the files."""
        own: dict[str, Any] = dict(own_options(take, self.model.capabilities))
        if take.pins and self.model.capabilities.option(PINS):
            own[PINS] = {pin.phone: pin.node for pin in take.pins}
        request = replace(self._stage.request, own=own, **of_request(take))
        return cast_for(self.model, request), request

    def _shown(self, animation: FaceAnimation) -> Shown:
        head = self._stage.own
        shown = on_channels(animation, head.map) if isinstance(head, OwnHead) else animation
        parts = [shown.weights, shown.head, shown.gaze, shown.tongue_up[:, None]]
        return Shown(shown.names, np.concatenate(parts, axis=1).astype(np.float32), shown.fps, 0, len(shown))


_RECORDED = Take("", (), (), (), options=(("eyes", "recorded"), ("head", "recorded")))


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
        "options": options,
        "pins": stated.option(PINS) is not None,
        "edits": stated.option(NODES) is not None,
        "explains": Explaining in stated.abilities,
    }
