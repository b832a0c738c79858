"""Adding recordings to a corpus: a video each, or a sound and a motion file, with whatever lies beside them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.motion_files import load_motion
from facesynth.corpus.record import Record
from facesynth.corpus.recordings import VIDEO, Recording, find_recordings, words_of
from facesynth.corpus.signals import hash_signals
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.errors import FacesynthError
from facesynth.motion.motion import Motion
from facesynth.motion.planar import is_tracked
from facesynth.speech.audio import load_audio
from facesynth.speech.segments import Segment
from facesynth.speech.speech import Speech

Task = tuple[Corpus, Record, "Recording", int | None]
"""Arguments of `prepare`."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A recording ready to be written into a corpus."""

    record: Record
    speech: Speech
    motion: Motion
    words: tuple[Segment, ...]
    aligned: bool
    """Whether a program placed the phones."""
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class AddReport:
    """What became of each recording."""

    added: tuple[str, ...] = ()
    """Ids that are new."""
    unchanged: tuple[str, ...] = ()
    """Ids that were there already."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Why a recording was not added, by name."""
    remarks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """What was noticed or done to a recording, by id."""


def add(
    corpus: Corpus,
    paths: Iterable[str | Path],
    about: Mapping[str, Any] | None = None,
    *,
    listed: Mapping[str, Record] | None = None,
    texts: Mapping[str, str] | None = None,
    phones: Path | None = None,
    emotions: Path | None = None,
    face: int | None = None,
    workers: Workers = ALONE,
) -> AddReport:
    """Add every recording in files and folders; those that cannot be used are named with the reason, the others added.

    about: fields of `Record` that hold for every recording; listed: records that hold instead for the recordings of
    these names; texts: what is said, by name. phones, emotions: files of the one recording that is added. face: which
    one is captured from video with several, counted from the left. workers: who reads, captures and aligns; the corpus is
    the same whoever does. Recordings that are there already are passed over, so an interrupted run can be repeated.
    """
    recordings, refused = find_recordings(paths)
    about = about or {}
    if len(recordings) > 1 and ("id" in about or about.get("text") or phones or emotions):
        raise FacesynthError(f"id, text, phones and emotions fit one recording, but there are {len(recordings)}; use a list")
    recordings = [replace(found, phones=phones or found.phones, emotions=emotions or found.emotions) for found in recordings]
    tasks = []
    for recording in recordings:
        try:
            record = (listed or {}).get(recording.name) or Record(**{"id": recording.name, **about})
            record = replace(record, text=record.text or (texts or {}).get(recording.name, ""))
            tasks.append((recording.name, (corpus, _with_text(record, recording.text), recording, face)))
        except FacesynthError as error:
            refused[recording.name] = str(error)
    return _kept(corpus, tasks, refused, workers)


def add_recording(corpus: Corpus, record: Record, recording: Recording, face: int | None = None) -> tuple[bool, tuple[str, ...]]:
    """Add one recording; returns whether it is new, and what was noticed or done to it."""
    prepared = prepare(corpus, record, recording, face)
    return (False, ()) if prepared is None else (True, _keep(corpus, prepared))


def prepare(corpus: Corpus, record: Record, recording: Recording, face: int | None = None) -> Prepared | None:
    """Read, capture and align one recording, writing nothing; None where the corpus has it already."""
    motion, remarks = _motion(corpus, recording, face)
    source_hash = hash_signals(*load_audio(recording.sound), motion)
    if record.id in corpus and corpus.record(record.id).source_hash == source_hash:
        return None
    if record.emotion not in corpus.emotions and recording.emotions is None:
        raise FacesynthError(f"emotion {record.emotion!r} is none of the corpus' {', '.join(corpus.emotions)}")
    from facesynth.speech.hearing import hear

    heard = hear(
        recording.sound,
        text=record.text or None,
        phones_path=recording.phones,
        emotion=record.emotion,
        emotions_path=recording.emotions,
        intensity=record.intensity,
    )
    record = replace(record, text=record.text or heard.speech.text)
    aligned = heard.source in ("transcript", "recognition")
    return Prepared(record, heard.speech, motion, heard.words, aligned, (*remarks, *heard.warnings))


def _motion(corpus: Corpus, recording: Recording, face: int | None) -> tuple[Motion, tuple[str, ...]]:
    if recording.motion.suffix.lower() not in VIDEO:
        return load_motion(recording.motion, corpus.layout, corpus.fps)
    if is_tracked(corpus.layout):
        from facesynth.corpus.importers.points import motion_from_points

        return motion_from_points(corpus.path, recording.motion, recording.sound, corpus.fps)
    from facesynth.corpus.importers.video import motion_from_video

    return motion_from_video(recording.motion, recording.sound, corpus.layout, corpus.fps, face)


def _kept(corpus: Corpus, tasks: list[tuple[str, Task]], refused: dict[str, str], workers: Workers) -> AddReport:
    """Prepare recordings by the workers; write them one after the other, in order, in this one."""
    added: list[str] = []
    unchanged: list[str] = []
    remarks: dict[str, tuple[str, ...]] = {}
    results = spread(_attempt, [task for _, task in tasks], workers, "adding")
    for (name, (_, record, _, _)), result in zip(tasks, results, strict=True):
        try:
            if isinstance(result, FacesynthError):
                raise result
            said = () if result is None else _keep(corpus, result)
        except FacesynthError as error:
            refused[name] = str(error)
            continue
        (unchanged if result is None else added).append(record.id)
        remarks.update({record.id: said} if said else {})
    return AddReport(tuple(added), tuple(unchanged), refused, remarks)


def _attempt(task: Task) -> Prepared | FacesynthError | None:
    try:
        return prepare(*task)
    except FacesynthError as error:
        return error


def _keep(corpus: Corpus, prepared: Prepared) -> tuple[str, ...]:
    corpus.add_utterance(prepared.record, prepared.speech, prepared.motion, prepared.words, aligned=prepared.aligned)
    return prepared.remarks


def _with_text(record: Record, path: Path | None) -> Record:
    """The record with the words of the file beside the recording, where it has none of its own."""
    return replace(record, text=words_of(path)) if path is not None and not record.text else record
