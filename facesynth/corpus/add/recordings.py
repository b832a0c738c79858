"""Which files make a recording: what lies in a folder under one name."""

import unicodedata
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from facesynth.corpus.add.transcripts import is_table
from facesynth.corpus.importers.formats import FORMATS
from facesynth.encoding import text_of
from facesynth.inference.errors import FacesynthError
from facesynth.speech.textgrid import is_silence_mark

AUDIO = frozenset(
    {".wav", ".bwf", ".rf64", ".w64", ".caf", ".aif", ".aiff", ".aifc", ".au", ".flac", ".ogg", ".oga", ".opus", ".mp3", ".mp2"}
    | {".m4a", ".aac", ".ac3", ".mka", ".wma", ".amr"}
)
VIDEO = frozenset(
    {".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".flv", ".3gp", ".wmv", ".ogv"}
    | {".mxf", ".asf", ".vob", ".f4v", ".3g2"}
)
MOTION = FORMATS.keys()
PHONES = frozenset({".textgrid", ".lab", ".phn"})
WORDS = frozenset({".align", ".wrd"})
"""Lines of `start end word`, as GRID and TIMIT come with; the times are not used."""
EMOTIONS = ".emotions.csv"
KINDS: dict[str, Collection[str]] = {
    "sound": AUDIO | VIDEO,
    "motion": MOTION,
    "phones": PHONES,
    "text": WORDS | {".txt"},
    "emotions": frozenset({EMOTIONS}),
}
SINGLE = ("sound", "motion")
BESIDE = frozenset({"layout.yaml", "channels.txt", "LICENSE", "README.md"})
"""What lies in folders of recordings and is none."""


@dataclass(frozen=True)
class Recording:
    """The files of one recording."""

    name: str
    """The name that they share, without suffix."""
    sound: Path
    """That of the motion, where the sound lies in it or there is none."""
    motion: Path
    """A motion file, or the video of which the face is captured."""
    phones: Path | None = None
    text: Path | None = None
    emotions: Path | None = None
    speaker: str | None = None
    """Whose phones are taken, where their file holds those of several."""
    language: str | None = None
    """Of the text (ISO 639-1); found out otherwise."""
    transcriber: Path | None = None
    """Folder of a model that writes down what is said, where no words are given."""
    placed: bool = True
    """Whether phones are placed where none are given; otherwise they stay unknown."""


def find_recordings(paths: Iterable[str | Path]) -> tuple[list[Recording], dict[str, str]]:
    """Recordings among files and in folders, by name, and why others are none.

    Files of one recording share their name: `a.wav`, `a.npz` (or `a.csv`) and, if there are any, `a.TextGrid` (or `a.lab`),
    `a.txt` (its words; or `a.align`, `a.wrd`: lines of `start end word`) and `a.emotions.csv`. A video without a motion
    file is both, or the motion where a sound that was recorded separately lies beside it. One sound and one motion file
    alone belong together whatever they are called.
    """
    files = [file for path in paths for file in _listed(Path(path)) if not is_table(file)]
    groups: dict[str, dict[str, list[Path]]] = {}
    refused: dict[str, str] = {}
    for file in files:
        name, kind = _name_and_kind(file)
        if kind is None:
            what = file.suffix or "a file without suffix"
            refused[file.name] = f"{what} is neither sound, motion ({', '.join(sorted(MOTION))}), phones nor text"
        else:
            groups.setdefault(name, {}).setdefault(kind, []).append(file)
    groups = _joined_if_one_pair(groups)
    recordings = []
    for name, found in sorted(groups.items()):
        group = _with_own_sound(_with_video(found))
        fault = _fault(group)
        if fault:
            refused[name] = fault
        else:
            first = {kind: files[0] for kind, files in group.items()}
            phones, text, emotions = (first.get(kind) for kind in ("phones", "text", "emotions"))
            recordings.append(Recording(name, first["sound"], first["motion"], phones, text, emotions))
    return recordings, refused


def find_tables(paths: Iterable[str | Path]) -> list[Path]:
    """Tables among files and in folders that say what is said in recordings, or list them."""
    return [file for path in paths for file in _listed(Path(path)) if is_table(file)]


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
            if name.lower().endswith(suffix) and (kind != "motion" or FORMATS[suffix].knows(file)):
                return name[: -len(suffix)], kind
    return name, None


def _joined_if_one_pair(groups: dict[str, dict[str, list[Path]]]) -> dict[str, dict[str, list[Path]]]:
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


def _with_own_sound(group: dict[str, list[Path]]) -> dict[str, list[Path]]:
    """What holds the sound as well as the motion, or is of use without, stands for both where no sound lies beside it."""
    motions = group.get("motion", [])
    if "sound" in group or len(motions) != 1:
        return group
    alone = FORMATS[motions[0].suffix.lower()].stands_alone(motions[0])
    return {**group, "sound": motions} if alone else group


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


def words_of(path: Path) -> str:
    """What is said, from a file beside a recording: plain words, or lines of `start end word`."""
    try:
        text = text_of(path)
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is no text in an encoding that is known; save it as UTF-8") from None
    if path.suffix.lower() in WORDS:
        text = " ".join(_timed_word(path, line) for line in text.splitlines() if line.strip())
    return " ".join(text.split())


def _timed_word(path: Path, line: str) -> str:
    """The word of a line `start end word`; nothing for a mark of silence."""
    columns = line.split()
    if len(columns) != 3 or not all(column.replace(".", "", 1).isdecimal() for column in columns[:2]):
        raise FacesynthError(f"{path}: {line.strip()!r} is not `start end word`")
    return "" if is_silence_mark(columns[2]) else columns[2]
