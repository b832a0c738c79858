"""The models that take part in a performance, found and checked before anything is heard."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.capabilities import Explaining, MappingEmotions
from facesynth.methods.method import Method
from facesynth.methods.registry import able, ask, load, read_option, require, require_option
from facesynth.stage.request import AUTO, Request

if TYPE_CHECKING:
    from facesynth.methods.emotion.detector import EmotionDetector

BESIDE = "emotion.safetensors"
"""Name of the detector that is looked for beside a model."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Who makes the motion of one performance after the other."""

    mouth: Method
    mapper: MappingEmotions | None = None
    """Maps the motion to another emotion."""
    detector: EmotionDetector | None = None
    """Hears the emotion."""

    def options(self, request: Request, phones: PhoneTrack) -> dict[str, Any]:
        """The mouth's own options, files of them read."""
        return {name: read_option(self.mouth, name, value, phones) for name, value in request.own.items()}

    def motion(self, speech: Speech, request: Request, options: dict[str, Any]) -> Motion:
        """Of the mouth, at its own rate, mapped to another emotion where that was asked for."""
        motion = self.mouth.synthesize(speech, seed=request.seed, **options)
        if self.mapper is None or request.to_emotion is None:
            return motion
        return self.mapper.map_along(motion, speech, request.to_emotion, intensity=request.to_intensity)


def cast_for(mouth: Method, request: Request) -> Cast:
    """The models that a request needs; FacesynthError for what none of them can do."""
    if request.emotion not in (None, AUTO, *mouth.emotions):
        raise unknown("emotion", str(request.emotion), mouth.emotions)
    for name in request.own:
        require_option(mouth, name)
    if request.explain is not None:
        require(mouth, Explaining)
    return Cast(mouth, _mapper(mouth, request), _detector(mouth, request.detector) if request.listens else None)


def _mapper(mouth: Method, request: Request) -> MappingEmotions | None:
    if request.to_emotion is None:
        return None
    model = load(request.maps) if request.maps else mouth
    if (mapper := ask(model, MappingEmotions)) is None:
        wanted = f"give a model of the same performer that does ({', '.join(able(MappingEmotions))}) with --maps"
        raise FacesynthError(f"{model.name} learns no emotion maps; {wanted}")
    return mapper


def _detector(mouth: Method, path: Path | None) -> EmotionDetector:
    from facesynth.methods.emotion.detector import EmotionDetector

    beside = mouth.path.with_name(BESIDE) if mouth.path else Path(BESIDE)
    if path is None and not beside.is_file():
        raise FacesynthError(
            f"hearing the emotion needs a detector: give --detector, or put {BESIDE} beside the model; "
            "`facesynth train emotion CORPUS` makes one"
        )
    return EmotionDetector.load(path or beside)
