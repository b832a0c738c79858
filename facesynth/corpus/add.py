"""Adding recordings to a corpus: a sound and a motion file each, with whatever lies beside them."""

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
from facesynth.errors import FacesynthError
from facesynth.progress import track
from facesynth.speech.audio import load_audio

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


@dataclass(frozen=True)
class Recording:
    """The files of one recording."""

    name: str
    """The name that they share, without suffix."""
    sound: Path
    motion: Path
    phones: Path | None = None
    text: Path | None = None
    emotions: Path | None = None


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
    phones: Path | None = None,
    emotions: Path | None = None,
) -> AddReport:
    """Add every recording in files and folders; those that cannot be used are named with the reason, the others added.

    about: fields of `Record` that hold for every recording; listed: records that hold instead for the recordings of
    these names. phones, emotions: files of the one recording that is added. Recordings that are there already are
    passed over, so an interrupted run can be repeated.
    """
    recordings, refused = find_recordings(paths)
    about = about or {}
    if len(recordings) > 1 and ("id" in about or about.get("text") or phones or emotions):
        raise FacesynthError(f"id, text, phones and emotions fit one recording, but there are {len(recordings)}; use a list")
    added: list[str] = []
    unchanged: list[str] = []
    remarks: dict[str, tuple[str, ...]] = {}
    for found in track(recordings, "adding"):
        recording = replace(found, phones=phones or found.phones, emotions=emotions or found.emotions)
        try:
            record = _with_text((listed or {}).get(found.name) or Record(**{"id": found.name, **about}), found.text)
            is_new, said = add_recording(corpus, record, recording)
        except FacesynthError as error:
            refused[found.name] = str(error)
            continue
        (added if is_new else unchanged).append(record.id)
        remarks.update({record.id: said} if said else {})
    return AddReport(tuple(added), tuple(unchanged), refused, remarks)


def add_recording(corpus: Corpus, record: Record, recording: Recording) -> tuple[bool, tuple[str, ...]]:
    """Add one recording; returns whether it is new, and what was noticed or done to it."""
    motion, remarks = load_motion(recording.motion, corpus.layout, corpus.fps)
    source_hash = hash_signals(*load_audio(recording.sound), motion)
    if record.id in corpus and corpus.record(record.id).source_hash == source_hash:
        return False, ()
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
    corpus.add_utterance(record, heard.speech, motion, heard.words, aligned=heard.source in ("transcript", "recognition"))
    return True, (*remarks, *heard.warnings)


def find_recordings(paths: Iterable[str | Path]) -> tuple[list[Recording], dict[str, str]]:
    """Recordings among files and in folders, by name, and why others are none.

    Files of one recording share their name: `a.wav`, `a.npz` (or `a.csv`) and, if there are any, `a.TextGrid` (or `a.lab`),
    `a.txt` (its words) and `a.emotions.csv`. One sound and one motion file alone belong together whatever they are called.
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
    for name, group in sorted(groups.items()):
        fault = _fault(group)
        if fault:
            refused[name] = fault
        else:
            recordings.append(Recording(name, **{kind: found[0] for kind, found in group.items()}))
    return recordings, refused


def _listed(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.is_file() and not file.name.startswith("."))
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file or folder")
    return [path]


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


def _fault(group: Mapping[str, list[Path]]) -> str:
    for kind in SINGLE:
        if kind not in group:
            have = " and ".join(file.name for files in group.values() for file in files)
            return f"there is no {kind} file of this name beside {have}"
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
