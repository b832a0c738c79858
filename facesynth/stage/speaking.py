"""The one way from speech to a face: a mouth's motion, on a head or on the speaker's real face."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol

from facesynth.atomic import write_text
from facesynth.inference.errors import unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Accounting, Explaining
from facesynth.methods.registry import ask, own_options, require
from facesynth.methods.trained import TrainedModel
from facesynth.motion.planar import is_tracked
from facesynth.speech.hearing import Heard
from facesynth.speech.phone_sources import PLACED
from facesynth.stage.cast import Cast, cast_for
from facesynth.stage.listening import Tell, keep_phones, keep_text, listen
from facesynth.stage.performance import HeadStage, Written, check_output
from facesynth.stage.request import Request
from facesynth.zoo.shelf import load


class Shown(Protocol):
    """An utterance on a face."""

    @property
    def sources(self) -> Mapping[str, str]:
        """Who moves each part of the face."""
        ...

    def write(self, path: Path) -> Written:
        """Write one output; the suffix says which."""
        ...


class Stage(Protocol):
    """A face, ready for motion after motion."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was asked for in vain."""
        ...

    def perform(self, motion: Motion, speech: Speech, cast: Cast) -> Shown:
        """Put a mouth's motion on the face, with what moves beside it."""
        ...


@dataclass(frozen=True, eq=False)
class Spoken:
    """What came of one recording."""

    speech: Speech
    motion: Motion
    """Of the mouth, at its own rate."""
    written: tuple[Path, ...]
    facts: Mapping[str, Any]
    """As JSON can hold it."""
    remarks: tuple[str, ...]
    """Lines for a person, warnings among them."""


@dataclass(frozen=True, eq=False)
class Production:
    """Models and a face, ready for recording after recording."""

    cast: Cast
    stage: Stage
    request: Request

    def say(self, recording: Path, targets: Sequence[Path], tell: Tell) -> Spoken:
        """Let the face say a recording, and write it to the targets; lines for a person are told as they come."""
        remarks: list[str] = []

        def remark(line: str) -> None:
            remarks.append(line)
            tell(line)

        for warning in (*self.stage.warnings, *self.request.remarks):
            remark(f"warning: {warning}")
        heard = listen(recording, self.cast, self.request, remark)
        options = self.cast.options(self.request, heard.speech.phones)
        motion = self.cast.motion(heard.speech, self.request, options)
        shown = self.stage.perform(motion, heard.speech, self.cast)
        said = self.cast.said(heard.speech)
        facts = self._account(said, options, remark) | {"parts": dict(shown.sources)}
        remark("; ".join(f"{part}: {source}" for part, source in shown.sources.items()))
        written = [*self._explain(said, options)]
        for target in targets:
            done = shown.write(target)
            remark(done.line)
            facts |= done.facts
            written.append(target)
        written += _phones_beside(targets, heard, remark)
        facts |= {"speech": str(recording), "duration_s": heard.speech.duration_s, "phones": heard.source}
        facts["written"] = [str(path) for path in written]
        facts["remarks"] = list(remarks)
        return Spoken(heard.speech, motion, tuple(written), facts, tuple(remarks))

    def _account(self, speech: Speech, options: Mapping[str, Any], remark: Tell) -> dict[str, Any]:
        if (accounting := ask(self.cast.mouth, Accounting)) is None:
            return {}
        account = accounting.account(speech, **options)
        for line in (*(f"warning: {warning}" for warning in account.warnings), *account.remarks):
            remark(line)
        return {"search": dict(account.facts)}

    def _explain(self, speech: Speech, options: Mapping[str, Any]) -> list[Path]:
        if self.request.explain is None:
            return []
        found = require(self.cast.mouth, Explaining).explain(speech, **options)
        write_text(self.request.explain, json.dumps(found, indent=1))
        return [self.request.explain]


def _phones_beside(targets: Sequence[Path], heard: Heard, remark: Tell) -> list[Path]:
    """The TextGrid beside the first target, of phones that nobody gave, and the text that was transcribed."""
    if not targets:
        return []
    grid, text = (targets[0].with_suffix(suffix) for suffix in (".TextGrid", ".txt"))
    written = [grid] if heard.source in PLACED and keep_phones(grid, heard, remark) else []
    return [*written, text] if heard.source == "transcription" and keep_text(text, heard, remark) else written


def produce(mouth: TrainedModel, targets: Sequence[Path], request: Request) -> Production:
    """Models and the face that goes with them; FacesynthError, before anything is heard, for what cannot be done."""
    return Production(cast_for(mouth, request), stage_for(mouth, targets, request), request)


def stage_for(mouth: TrainedModel, targets: Sequence[Path], request: Request) -> Stage:
    """The real face for a model of points followed in video, a head for every other; it must have the files asked for."""
    if is_tracked(mouth.fitted_layout):
        from facesynth.stage.likeness import PictureStage, check_picture_output

        for target in targets:
            check_picture_output(target)
        return PictureStage.of(mouth, request)
    for target in targets:
        check_output(target)
    return HeadStage.of(request)


def speak(model: str | Path, recording: str | Path, *outputs: str | Path, **asked: Any) -> Spoken:
    """Let a trained model say a recording, and write it to files such as out.mp4, out.csv or out.glb.

    asked: the fields of `Request`, such as text, emotion, fps or seed, and the model's own options of `speak`.
    FacesynthError says in one line what is wrong with what was given.
    """
    known = {field.name for field in fields(Request)} - {"own"}
    own = {name: value for name, value in asked.items() if name not in known}
    options, _ = own_options(known)
    for name in own:
        if name not in options:
            raise unknown("option of speak", name, known | options.keys())
    request = Request(own=own, **{name: value for name, value in asked.items() if name in known})
    targets = [check_output(path) for path in outputs]
    return produce(load(model), targets, request).say(Path(recording), targets, lambda _: None)
