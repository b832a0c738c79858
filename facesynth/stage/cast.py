"""The models that take part in a performance, found and checked before anything is heard."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import NEUTRAL, EmotionTrack, PhoneTrack, Speech
from facesynth.methods.capabilities import Explaining, MappingEmotions
from facesynth.methods.registry import able, ask, load_trained, read_option, require, require_option
from facesynth.methods.trained import TrainedModel
from facesynth.stage.expressed import expressed
from facesynth.stage.request import AUTO, Part, Request
from facesynth.stage.silent_pauses import SilentPauses
from facesynth.zoo.shelf import load

if TYPE_CHECKING:
    from facesynth.methods.emotion.detector import EmotionDetector

BESIDE = "emotion.safetensors"
"""Name of the detector that is looked for beside a model."""


@dataclass(frozen=True, eq=False)
class Cast:
    """Who makes the motion of one performance after the other."""

    mouth: TrainedModel
    head: TrainedModel | None = None
    """Moves the head, where a model of its own was asked for."""
    eyes: TrainedModel | None = None
    """The same of the eyes."""
    expression: TrainedModel | None = None
    """Adds the emotions, so that the mouth speaks neutrally, where such a model was asked for."""
    mapper: MappingEmotions | None = None
    """Maps the motion to another emotion."""
    detector: EmotionDetector | None = None
    """Hears the emotion."""
    _pauses: SilentPauses = field(default_factory=SilentPauses)

    @property
    def members(self) -> tuple[TrainedModel, ...]:
        """Who moves something."""
        return tuple(one for one in (self.mouth, self.head, self.eyes) if one is not None)

    @property
    def needs_phones(self) -> bool:
        """Whether any of them must be told what is said."""
        everybody = (*self.members, self.expression)
        return any(one is not None and one.needs_phones for one in everybody)

    @property
    def emotions(self) -> tuple[str, ...]:
        """Those that can be felt."""
        return (self.expression or self.mouth).emotions

    def options(self, request: Request, phones: PhoneTrack, mover: TrainedModel | None = None) -> dict[str, Any]:
        """The own options of one of them, of the mouth where none is named; files of them are read."""
        mover = mover or self.mouth
        asked = {name: value for name, value in request.own.items() if mover.capabilities.option(name)}
        return {name: read_option(mover, name, value, phones) for name, value in asked.items()}

    def motion(self, speech: Speech, request: Request, options: dict[str, Any]) -> Motion:
        """Of the mouth, at its own rate: with emotions added, or mapped to another, where that was asked for."""
        return self.finished(self.mouth.synthesize(self.said(speech), seed=request.seed, **options), speech, request)

    def finished(self, motion: Motion, speech: Speech, request: Request) -> Motion:
        """The mouth's motion with emotions added, or mapped to another, where that was asked for."""
        if self.expression is not None:
            motion = expressed(self.expression, motion, speech, seed=request.seed)
        if self.mapper is not None and request.to_emotion is not None:
            motion = self.mapper.map_along(motion, speech, request.to_emotion, intensity=request.to_intensity)
        return motion

    def said(self, speech: Speech) -> Speech:
        """What the mouth is to say: nothing in long pauses, neutrally where somebody else adds the emotions."""
        speech = self._pauses.of(speech)
        if self.expression is None:
            return speech
        plain = NEUTRAL if NEUTRAL in self.mouth.emotions else self.mouth.emotions[0]
        return replace(speech, emotions=EmotionTrack.constant(plain, speech.duration_s))


def cast_for(mouth: TrainedModel, request: Request) -> Cast:
    """The models that a request needs; FacesynthError for what none of them can do."""
    if mouth.capabilities.part != "mouth":
        part = mouth.capabilities.part
        raise FacesynthError(f"{mouth.name} moves the {part} alone: give its file with --{part}, beside a model of the mouth")
    cast = Cast(
        mouth,
        _mover("head", request.head),
        _mover("eyes", request.eyes),
        _mover("expression", Part("model", model=request.expression)) if request.expression else None,
        _mapper(mouth, request),
        _detector(mouth, request.detector) if request.listens else None,
    )
    if request.emotion not in (None, AUTO, *cast.emotions):
        raise unknown("emotion", str(request.emotion), cast.emotions)
    for name in request.own:
        if not any(one.capabilities.option(name) for one in cast.members):
            require_option(mouth, name)
    if request.explain is not None:
        require(mouth, Explaining)
    return cast


def _mover(part: str, asked: Part) -> TrainedModel | None:
    """The model that moves a part, where one was asked for."""
    if asked.model is None:
        return None
    mover = load(asked.model)
    if mover.capabilities.part != part:
        raise FacesynthError(f"{asked.model} moves the {mover.capabilities.part}; --{part} wants a model of the {part}")
    if asked.method not in ("", mover.name, mover.name.removeprefix(f"{part}_")):
        raise FacesynthError(f"{asked.model} holds a model of {mover.name}, not of {asked.method}")
    return mover


def _mapper(mouth: TrainedModel, request: Request) -> MappingEmotions | None:
    if request.to_emotion is None:
        return None
    model = load_trained(request.maps) if request.maps else mouth
    if (mapper := ask(model, MappingEmotions)) is None:
        wanted = f"give a model of the same performer that does ({', '.join(able(MappingEmotions))}) with --maps"
        raise FacesynthError(f"{model.name} learns no emotion maps; {wanted}")
    return mapper


def _detector(mouth: TrainedModel, path: Path | None) -> EmotionDetector:
    from facesynth.methods.emotion.detector import EmotionDetector

    beside = mouth.path.with_name(BESIDE) if mouth.path else Path(BESIDE)
    if path is None and not beside.is_file():
        raise FacesynthError(
            f"hearing the emotion needs a detector: give --detector, or put {BESIDE} beside the model; "
            "`facesynth train emotion CORPUS` makes one"
        )
    return EmotionDetector.load(path or beside)
