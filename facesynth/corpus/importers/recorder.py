"""One long sound for many clips: each clip's part of it, found by the clip's own sound."""

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from facesynth.capture.clock import Recorder
from facesynth.corpus.add.recordings import VIDEO, find_recordings
from facesynth.inference.errors import FacesynthError
from facesynth.progress import track
from facesynth.speech.audio import load_audio, read_sound, save_wav


@dataclass(frozen=True)
class Cuts:
    """Parts of a recorder's sound, a file each, called as the clips."""

    sounds: tuple[Path, ...] = ()
    remarks: tuple[str, ...] = ()
    """Clips that keep the camera's own sound, and why."""


@contextmanager
def cut_for(recorder: Path | None, paths: Iterable[Path]) -> Iterator[Cuts]:
    """The part of a recorder's sound for each video among files and folders that has no sound beside it, until the block ends."""
    if recorder is None:
        yield Cuts()
        return
    recorded = read_sound(recorder)
    searched = Recorder.of(recorded.audio, recorded.sample_rate)
    videos = [
        found for found in find_recordings(paths)[0] if found.motion.suffix.lower() in VIDEO and found.sound == found.motion
    ]
    with tempfile.TemporaryDirectory(prefix="facesynth-") as name:
        folder = Path(name) / recorder.stem
        sounds, remarks = [], [f"{recorder.name}: {remark}" for remark in recorded.remarks]
        for found in track(videos, "finding the clips in the recorder's sound"):
            try:
                part = searched.part_of(*load_audio(found.motion))
            except FacesynthError as error:
                remarks.append(f"{found.name} keeps the camera's own sound: {error}")
                continue
            sounds.append(folder / f"{found.name}.wav")
            save_wav(sounds[-1], part, searched.sample_rate)
        yield Cuts(tuple(sounds), tuple(remarks))
