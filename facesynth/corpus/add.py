"""Adding recordings to a corpus: a video each, or a sound and a motion file, with whatever lies beside them."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.motion_files import load_motion
from facesynth.corpus.record import Record
from facesynth.corpus.signals import hash_signals
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.errors import FacesynthError
from facesynth.motion.motion import Motion
from facesynth.motion.planar import is_tracked
from facesynth.speech.audio import load_audio
from facesynth.speech.segments import Segment
from facesynth.speech.speech import Speech

AUDIO = frozenset({".wav", ".flac", ".ogg", ".opus", ".mp3", ".m4a", ".aac", ".aif", ".aiff", ".wma"})
VIDEO = frozenset({".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg"})
MOTION = frozenset({".npz", ".csv"})
PHONES = frozenset({".textgrid", ".lab", ".phn"})
EMOTIONS = ".emotions.csv"
KINDS = {
    "sound": AUDIO | VIDEO,
    "motion": MOTION,
    "phones": PHONES,
    "text": frozenset({".txt"}),
    "emotions": frozenset({EMOTIONS}),
}
SINGLE = ("sound", "motion")
BESIDE = frozenset({"layout.yaml", "channels.txt", "LICENSE", "README.md"})
"""What lies in folders of recordings and is none."""

Task = tuple[Corpus, Record, "Recording", int | None]
"""Arguments of `prepare`."""


@dataclass(frozen=True)
class Recording:
    """The files of one recording."""

    name: str
    """The name that they share, without suffix."""
    sound: Path
    motion: Path
    """A motion file, or the video of which the face is captured."""
    phones: Path | None = None
    text: Path | None = None
    emotions: Path | None = None


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


def find_recordings(paths: Iterable[str | Path]) -> tuple[list[Recording], dict[str, str]]:
    """Recordings among files and in folders, by name, and why others are none.

    Files of one recording share their name: `a.wav`, `a.npz` (or `a.csv`) and, if there are any, `a.TextGrid` (or `a.lab`),
    `a.txt` (its words) and `a.emotions.csv`. A video without a motion file is both, or the motion where a sound that was
    recorded separately lies beside it. One sound and one motion file alone belong together whatever they are called.
    """
    files = [file for path in paths for file in _listed(Path(path))]
    groups: dict[str, dict[str, list[Path]]] = {}
    refused: dict[str, str] = {}
    for file in files:
        name, kind = _name_and_kind(file)
        if kind is None:
            refused[file.name] = f"{file.suffix or 'a file without suffix'} is neither sound, motion, phones nor text"
        else:
            groups.setdefault(name, {}).setdefault(kind, []).append(file)
    groups = _married(groups)
    recordings = []
    for name, found in sorted(groups.items()):
        group = _with_video(found)
        fault = _fault(group)
        if fault:
            refused[name] = fault
        else:
            recordings.append(Recording(name, **{kind: files[0] for kind, files in group.items()}))
    return recordings, refused


def _listed(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.is_file() and not _is_no_recording(file))
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file or folder")
    return [path]


def _is_no_recording(file: Path) -> bool:
    return file.name.startswith(".") or file.name in BESIDE


def _name_and_kind(file: Path) -> tuple[str, str | None]:
    name = unicodedata.normalize("NFC", file.name)
    for kind, suffixes in reversed(KINDS.items()):
        for suffix in suffixes:
            if name.lower().endswith(suffix):
                return name[: -len(suffix)], kind
    return name, None


def _married(groups: dict[str, dict[str, list[Path]]]) -> dict[str, dict[str, list[Path]]]:
    """One sound and one motion file alone are one recording, called as the sound."""
    sounds = [name for name, group in groups.items() if "sound" in group]
    motions = [name for name, group in groups.items() if "motion" in group]
    if len(sounds) != 1 or len(motions) != 1:
        return groups
    one: dict[str, list[Path]] = {}
    for group in groups.values():
        for kind, files in group.items():
            one.setdefault(kind, []).extend(files)
    return {sounds[0]: one}


def _with_video(group: dict[str, list[Path]]) -> dict[str, list[Path]]:
    """A video shows the motion where no motion file does."""
    videos = [file for file in group.get("sound", ()) if file.suffix.lower() in VIDEO]
    if "motion" in group or len(videos) != 1:
        return group
    sounds = [file for file in group["sound"] if file not in videos]
    return {**group, "sound": sounds or videos, "motion": videos}


def _fault(group: Mapping[str, list[Path]]) -> str:
    for kind in SINGLE:
        if kind not in group:
            have = " and ".join(file.name for files in group.values() for file in files)
            why = "; motion without sound teaches no speech" if kind == "sound" else ""
            return f"there is no {kind} file of this name beside {have}{why}"
    for kind, files in group.items():
        if len(files) > 1:
            return f"there are {len(files)} files of {kind}: {', '.join(file.name for file in files)}; leave one"
    return ""


def _with_text(record: Record, path: Path | None) -> Record:
    """The record with the words of the file beside the recording, where it has none of its own."""
    return replace(record, text=_words(path)) if path is not None and not record.text else record


def _words(path: Path) -> str:
    try:
        return " ".join(path.read_text(encoding="utf-8-sig").split())
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is not text in UTF-8; save it again") from None
