"""Files of sound that a command is given, one by one or as folders."""

from collections.abc import Iterable
from pathlib import Path

from facesynth.inference.errors import FacesynthError


def recordings(paths: Iterable[Path]) -> list[Path]:
    """The files named, and those inside the folders named; FacesynthError where there is none."""
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.is_file() and is_recording(p) and not p.name.startswith("."))
            if not inside:
                raise FacesynthError(f"{path} holds no sound; wanted files such as clip.wav")
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise FacesynthError(f"{path}: no such file")
    return found


def is_recording(path: Path) -> bool:
    """Whether a name is that of a sound or a video, or a folder, where such are looked for."""
    from facesynth.corpus.add.recordings import AUDIO, VIDEO

    return path.is_dir() or path.suffix.lower() in AUDIO | VIDEO
