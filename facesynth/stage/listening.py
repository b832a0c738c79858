"""From a recording to the speech that is to be said: what was given, what lies beside it, what is heard in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from facesynth.atomic import write_text
from facesynth.encoding import encoding_remark, text_of
from facesynth.inference.emotion_track import track_of
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.speech.hearing import Heard, hear
from facesynth.speech.intensity import read_intensity
from facesynth.speech.textgrid import write_textgrid
from facesynth.stage.cast import Cast
from facesynth.stage.request import AUTO, Request

if TYPE_CHECKING:
    from facesynth.methods.emotion.detector import EmotionDetector

Tell = Callable[[str], None]
"""Takes a line for a person, as soon as there is one."""


def listen(recording: Path, cast: Cast, request: Request, tell: Tell) -> Heard:
    """Read a recording; NAME.TextGrid or NAME.txt beside it serve where no words and no phones were given."""
    try:
        heard = _heard(recording, cast, request, tell)
    except FacesynthError as error:
        raise error if recording.name in str(error) else FacesynthError(f"{recording}: {error}") from None
    for warning in heard.warnings:
        tell(f"warning: {recording.name}: {warning}")
    return heard


def read_text(path: Path) -> str:
    """A transcript; FacesynthError where it cannot be read."""
    try:
        return text_of(path)
    except (OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path}: cannot read the transcript ({error})") from None


def keep_phones(path: Path, heard: Heard, tell: Tell) -> bool:
    """Write what was heard as a TextGrid; one that is there and differs may have been corrected by hand and stays."""
    if path.exists():
        with TemporaryDirectory() as folder:
            write_textgrid(Path(folder) / "new.TextGrid", heard.speech.phones, heard.words)
            if (Path(folder) / "new.TextGrid").read_bytes() == path.read_bytes():
                return True
        tell(f"warning: {path} was there and differs: it stays as it is; give it with --phones, or remove it for a new one")
        return False
    write_textgrid(path, heard.speech.phones, heard.words)
    return True


def keep_text(path: Path, heard: Heard, tell: Tell) -> bool:
    """Write what was transcribed, to be corrected; a text that is there and differs stays."""
    if path.exists() and path.read_bytes() != heard.speech.text.encode():
        tell(f"warning: {path} was there and differs from what was transcribed: it stays as it is")
        return False
    write_text(path, heard.speech.text)
    return True


def _heard(recording: Path, cast: Cast, request: Request, tell: Tell) -> Heard:
    text, phones = request.text, request.phones
    if text is None and phones is None:
        grid, words = recording.with_suffix(".TextGrid"), recording.with_suffix(".txt")
        phones = grid if grid.exists() else None
        text = read_text(words) if phones is None and words.exists() else None
        for remark in encoding_remark(words) if text is not None else ():
            tell(f"warning: {remark}")
    if cast.detector is not None:
        heard = hear(recording, text=text, phones_path=phones, **_as_asked(cast, request))
        return replace(heard, speech=_with_emotions(heard.speech, cast.detector, cast, request, tell))
    emotion = request.emotion or (None if request.emotions else cast.emotions[0])
    heard = hear(
        recording,
        text=text,
        phones_path=phones,
        **_as_asked(cast, request),
        emotion=emotion,
        emotions_path=request.emotions,
        intensity=1.0 if isinstance(request.intensity, Path) else request.intensity,
    )
    return replace(heard, speech=_with_intensity(heard.speech, request))


def _as_asked(cast: Cast, request: Request) -> dict[str, Any]:
    """Of the phones."""
    sought = "placed" if cast.needs_phones else "heard"
    return {"speaker": request.speaker, "language": request.language, "transcriber": request.transcriber, "sought": sought}


def _with_emotions(speech: Speech, detector: EmotionDetector, cast: Cast, request: Request, tell: Tell) -> Speech:
    """Speech with the emotions heard in it: one for everything (`emotion`), or along time (`emotions`)."""
    known = [e for e in detector.emotions if e in cast.emotions]
    if not known:
        raise FacesynthError(
            f"the detector hears {', '.join(detector.emotions)}; this model knows {', '.join(cast.emotions)}: "
            "train a detector on this performer, or name the --emotion"
        )
    track = _emotions(speech, detector, known, along=request.emotion != AUTO)
    strength = 1.0 if isinstance(request.intensity, Path) else request.intensity
    felt = replace(track, intensities=np.full(len(track.labels), strength))
    said = ", ".join(f"{label} to {end:.2f} s" for label, end in zip(felt.labels, felt.ends_s, strict=True))
    missing = sorted(set(detector.emotions) - set(known))
    tell(f"heard: {said}" + (f" (the model does not know {', '.join(missing)})" if missing else ""))
    return _with_intensity(replace(speech, emotions=felt), request)


def _with_intensity(speech: Speech, request: Request) -> Speech:
    """Speech whose emotions are as strong over time as a curve says, where one was given."""
    if not isinstance(request.intensity, Path):
        return speech
    return replace(speech, emotions=read_intensity(request.intensity).over(speech.emotions))


def _emotions(speech: Speech, detector: EmotionDetector, known: list[str], *, along: bool) -> EmotionTrack:
    """Emotions that both detector and model know; of the others, the most probable known one stands in."""
    if along:
        ends_s, probabilities = detector.along(speech.audio, speech.sample_rate)
        return track_of(ends_s, probabilities[:, [detector.emotions.index(e) for e in known]], known)
    reading = detector.detect(speech.audio, speech.sample_rate)
    best = max(known, key=lambda e: reading.probabilities[e])
    return EmotionTrack.constant(reading.emotion if reading.emotion in known else best, speech.duration_s)
