"""One recording made ready for a corpus: read, captured, heard and aligned, or only what of it has changed."""

from __future__ import annotations

import tempfile
import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.add.given import DIGITS, FOLDER, GRID, Given, changes, in_words, read_prints, write_prints
from facesynth.corpus.add.recordings import VIDEO, Recording
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.importers.unpack import read_into, unpacked, with_unpacked
from facesynth.corpus.limits import LARGEST_DIFFERENCE_S, LARGEST_MISSING_SHARE
from facesynth.corpus.record import Record
from facesynth.corpus.signals import PARTS, Part, hash_signals, lost_parts, read_speech
from facesynth.encoding import encoding_remark
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import by_blocks
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.motion.planar import is_tracked
from facesynth.speech.audio import as_saved, load_audio, read_sound
from facesynth.speech.emotions import read_emotions
from facesynth.speech.phone_sources import PLACED, UNSOUGHT
from facesynth.speech.segments import Segment
from facesynth.speech.textgrid import read_textgrid, write_textgrid

if TYPE_CHECKING:
    from facesynth.speech.hearing import Heard

SPOKEN = frozenset({"text", "phones", "transcriber"})
"""What of the given decides the phones."""
BETWEEN = "|"
"""Between the remarks on the motion and those on the speech."""
FAULT = "a fault of facesynth"
"""What a person is told where no error was foreseen."""

Task = tuple[Corpus, Given, bool]
"""Corpus, recording, and whether it may replace what was corrected by hand or came from elsewhere."""


@dataclass(frozen=True, eq=False)
class _Take:
    """Sound and motion of one recording."""

    audio: NDArray[np.float32]
    """[S]"""
    stored: NDArray[np.float32]
    """[S] as the corpus holds it."""
    sample_rate: int
    motion: Motion | None
    """None where only the sound was wanted."""
    remarks: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        return len(self.audio) / self.sample_rate


@dataclass(frozen=True, eq=False)
class Prepared:
    """What is to be written of a recording."""

    record: Record
    speech: Speech
    motion: Motion | None
    """None where it stays."""
    words: tuple[Segment, ...] = ()
    aligned: bool = False
    """Whether a program placed the phones, or nobody did: `align` may place them."""
    remarks: tuple[str, ...] = ()
    parts: frozenset[Part] = frozenset(PARTS)
    changed: tuple[str, ...] = ()
    """What was given otherwise than before; empty for a new recording."""
    kept: str = ""
    """What stays although something else was given, and how to replace it."""


def attempt(task: Task) -> Prepared | FacesynthError | None:
    """`prepare`, with the reason where it cannot be done: one recording must not end the import of the others."""
    try:
        return prepare(*task)
    except FacesynthError as error:
        return error
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        return FacesynthError(f"{type(error).__name__} in {where} ({error}): {FAULT}, please report it with this file")


def prepare(corpus: Corpus, given: Given, replacing: bool = False) -> Prepared | None:
    """Read, capture and align what the corpus lacks of a recording, writing nothing; None where it lacks nothing."""
    with unpacked(corpus, given.recording) as recording:
        return _prepared(corpus, with_unpacked(corpus, given, recording), replacing)


def _prepared(corpus: Corpus, given: Given, replacing: bool) -> Prepared | None:
    if given.id not in corpus:
        return _new(corpus, given)
    old = corpus.record(given.id)
    if not old.given:
        return _of_unknown_origin(corpus, old, given, replacing)
    prints = given.prints()
    changed = changes(given, prints, old)
    if not changed and not lost_parts(corpus.files, old.id):
        return None
    elsewhere = read_prints(old.given).get(FOLDER) != prints[FOLDER]
    if {"sound", "motion"} <= changed and elsewhere and not replacing:
        raise _another(corpus, old)
    return _again(corpus, old, given, changed, replacing)


def _new(corpus: Corpus, given: Given) -> Prepared:
    record = Record(**{**given.facts, "id": given.id})
    _require_emotion(corpus, record, given.recording)
    take = _captured(corpus, given.recording, given.face)
    heard = _heard(take, record, given.recording)
    emotions = _emotions(corpus, record, given.recording, take.duration_s)
    record = _accounted(record, given, "", take, heard)
    speech = Speech(take.audio, take.sample_rate, heard.speech.phones, emotions, record.text)
    return Prepared(record, speech, take.motion, heard.words, _is_aligned(heard), (*take.remarks, *heard.warnings))


def _of_unknown_origin(corpus: Corpus, old: Record, given: Given, replacing: bool) -> Prepared | None:
    """A recording that was added when corpora did not keep what was given: its signals must be the same."""
    motion, _ = read_motion(corpus, given.recording, given.face)
    same = hash_signals(*load_audio(given.recording.sound), motion) == old.source_hash
    if not same and not replacing:
        raise _another(corpus, old)
    changed = frozenset(part for part, value in given.facts.items() if value != getattr(old, part))
    if changed and not replacing:
        return _staying(corpus, old, f"{', '.join(in_words(changed))} of the corpus stay; --replace takes what is given now")
    if not changed and same and not lost_parts(corpus.files, old.id):
        return Prepared(_accounted(old, given, "", None, None), read_speech(corpus.files, old), None, parts=frozenset())
    return _again(corpus, old, given, changed | (frozenset() if same else {"sound", "motion"}), replacing)


def _again(corpus: Corpus, old: Record, given: Given, changed: frozenset[str], replacing: bool) -> Prepared:
    """What follows from what has changed, and from files that were lost; the rest stays as it is."""
    recording, lost = given.recording, lost_parts(corpus.files, old.id)
    record = replace(old, **{name: given.facts[name] for name in changed if name in given.facts})
    _require_emotion(corpus, record, recording)
    captures = bool({"sound", "motion", "face"} & changed or {"sound", "motion"} & lost)
    respoken = bool({"text", "transcriber"} & changed) and bool(old.aligned_hash) and recording.phones is None
    take = _captured(corpus, recording, given.face) if captures else _stored(corpus, old)
    heard = None
    if respoken or "sound" in changed or "phones" in changed | lost:
        heard = _heard(take, _to_hear(record, given), recording)
    kept = ""
    if heard is not None and not replacing and _is_by_hand(corpus, old, heard):
        if "sound" in changed:
            return _staying(corpus, old, "the phones were corrected by hand, so all of it stays; --replace takes the new sound")
        heard, changed, kept = None, changed - SPOKEN, "the phones were corrected by hand; --replace places them anew"
    phones = heard.speech.phones if heard else read_textgrid(corpus.files.phones(old.id))[0]
    emotions = _emotions(corpus, record, recording, take.duration_s)
    emotion_changed = {"emotion", "intensity", "emotions", "sound"} & changed
    written: dict[Part, bool] = {"sound": captures, "motion": captures}
    written |= {"phones": heard is not None, "emotions": bool(emotion_changed)}
    return Prepared(
        _accounted(record, given, kept, take if captures else None, heard),
        Speech(take.audio, take.sample_rate, phones, emotions, record.text),
        take.motion,
        heard.words if heard else (),
        _is_aligned(heard),
        (*take.remarks, *(heard.warnings if heard else ())),
        frozenset(part for part, anew in written.items() if anew),
        in_words(changed),
        kept,
    )


def _accounted(record: Record, given: Given, kept: str, take: _Take | None, heard: Heard | None) -> Record:
    """The record with the account of what was given and noticed; what was not taken counts as not given."""
    prints = {part: value for part, value in given.prints().items() if not (kept and part in SPOKEN)}
    if heard is not None:
        prints[GRID] = _grid_hash(heard)[:DIGITS]
        record = replace(record, text=heard.speech.text or record.text)
    of_motion, of_speech = (remarks.strip() for remarks in record.remarks.partition(BETWEEN)[::2])
    of_motion = "; ".join(take.remarks) if take else of_motion
    of_speech = "; ".join(heard.warnings) if heard else of_speech
    remarks = f"{of_motion} {BETWEEN} {of_speech}".strip() if of_speech else of_motion
    return replace(record, given=write_prints({**read_prints(record.given), **prints}), remarks=remarks)


def _staying(corpus: Corpus, old: Record, kept: str) -> Prepared:
    return Prepared(old, read_speech(corpus.files, old), None, parts=frozenset(), kept=kept)


def _captured(corpus: Corpus, recording: Recording, face: int | None) -> _Take:
    """Sound and motion from their files, or from a video; FacesynthError where they cannot be of one recording."""
    motion, remarks = read_motion(corpus, recording, face)
    sound = read_sound(recording.sound)
    audio, rate, remarks = sound.audio, sound.sample_rate, (*sound.remarks, *remarks)
    sound_s = len(audio) / rate
    missing = float(by_blocks(lambda some: np.isnan(some).mean(axis=1), motion.frames, np.float64).mean())
    if missing > LARGEST_MISSING_SHARE:
        raise FacesynthError(f"{missing:.0%} of the motion's samples are missing, at most half may be")
    lengths = f"the motion lasts {motion.duration_s:.2f} s, the sound {sound_s:.2f} s"
    if not 1 - LARGEST_MISSING_SHARE <= motion.duration_s / max(sound_s, 1e-9) <= 1 / (1 - LARGEST_MISSING_SHARE):
        raise FacesynthError(f"{lengths}: are they of one recording, and is the motion's rate right?")
    if abs(motion.duration_s - sound_s) > LARGEST_DIFFERENCE_S:
        remarks = (*remarks, f"{lengths}: do they begin together?")
    return _Take(audio, as_saved(audio, rate), rate, motion, remarks)


def _stored(corpus: Corpus, old: Record) -> _Take:
    audio, rate = load_audio(corpus.files.audio(old.id))
    return _Take(audio, audio, rate, None, ())


def _to_hear(record: Record, given: Given) -> Record:
    """The record without a text that comes from a file of phones itself, so that the words of a new one are taken."""
    said = "text" in given.facts or "text" in read_prints(record.given)
    return record if said or given.recording.phones is None else replace(record, text="")


def _heard(take: _Take, record: Record, recording: Recording) -> Heard:
    """The phones of what the corpus will hold, so that aligning it later gives the same."""
    from facesynth.speech.hearing import hear_sound

    heard = hear_sound(
        take.stored,
        take.sample_rate,
        text=record.text or None if recording.placed else None,
        language=recording.language,
        transcriber=recording.transcriber,
        phones_path=recording.phones,
        speaker=recording.speaker,
        sought="placed" if recording.placed else "none",
    )
    guessed = encoding_remark(recording.text) if recording.text is not None and record.text else ()
    return replace(heard, warnings=(*guessed, *heard.warnings))


def _is_aligned(heard: Heard | None) -> bool:
    return heard is not None and heard.source in (*PLACED, UNSOUGHT)


def _emotions(corpus: Corpus, record: Record, recording: Recording, duration_s: float) -> EmotionTrack:
    """From the file that is given, else the one that the corpus has, else the record's one emotion throughout."""
    own = corpus.files.emotions(record.id)
    path = recording.emotions or (own if own.exists() else None)
    if path is not None:
        return read_emotions(path, duration_s)
    return EmotionTrack.constant(record.emotion, duration_s, record.intensity)


def _is_by_hand(corpus: Corpus, old: Record, heard: Heard) -> bool:
    """Whether a person changed the TextGrid of the corpus since it was written.

    One that is already as it would be written now was left by a run that was interrupted.
    """
    path = corpus.files.phones(old.id)
    if not path.is_file():
        return False
    found = hash_file(path)
    return found not in (old.aligned_hash, _grid_hash(heard)) and found[:DIGITS] != read_prints(old.given).get(GRID)


def _grid_hash(heard: Heard) -> str:
    """sha256 of the TextGrid that will be written."""
    with tempfile.TemporaryDirectory(prefix="facesynth-") as folder:
        path = Path(folder) / "phones.TextGrid"
        write_textgrid(path, heard.speech.phones, heard.words)
        return hash_file(path)


def _another(corpus: Corpus, old: Record) -> FacesynthError:
    return FacesynthError(
        f"{corpus.path} has another recording called {old.id!r}; give this one another id, or --replace the old one"
    )


def _require_emotion(corpus: Corpus, record: Record, recording: Recording) -> None:
    if record.emotion not in corpus.emotions and recording.emotions is None:
        raise FacesynthError(f"emotion {record.emotion!r} is none of the corpus' {', '.join(corpus.emotions)}")


def read_motion(corpus: Corpus, recording: Recording, face: int | None) -> tuple[Motion, tuple[str, ...]]:
    """The motion of a recording in its corpus' layout and at its rate, and what was noticed."""
    if recording.motion.suffix.lower() not in VIDEO:
        return read_into(corpus, recording)
    if is_tracked(corpus.layout):
        from facesynth.corpus.importers.points import motion_from_points

        return motion_from_points(corpus.path, recording.motion, recording.sound, corpus.fps)
    from facesynth.corpus.importers.video import motion_from_video

    return motion_from_video(recording.motion, recording.sound, corpus.layout, corpus.fps, face)
