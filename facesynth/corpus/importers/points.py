"""Ordinary video as recordings of followed points: a shape of the lower face in every picture, and the pictures kept.

Such a corpus holds, beside what every corpus holds, `points.npz` (the reference picture and the points on it) and for
each utterance `video/ID.SUFFIX`, a copy of its video, and `video/ID.npz`, where the points and the head are in it.
"""

import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.capture.clock import clock_between, on_clock
from facesynth.capture.points.finding import Box, face_region
from facesynth.capture.points.footage import Footage, read_footage
from facesynth.capture.points.kept_shapes import kept_shapes, load_shapes, save_shapes
from facesynth.capture.points.reference import Reference
from facesynth.capture.points.shapes import Shapes
from facesynth.corpus.add.recordings import VIDEO, Recording, find_recordings
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.files import check_id
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.motion.resample import resample
from facesynth.progress import track
from facesynth.speech.audio import load_audio

POINTS = "points.npz"
FOLDER = "video"
FIRST_CLIPS = 6
"""The points are chosen on so many clips, taken evenly from all."""
NOTES = "Followed from video: {} Shi-Tomasi points of the lower face, pixels of the first picture, the head's motion taken out."
OF_THE_MOUTH = " Lips and chin by the face mesh."


@dataclass(frozen=True, eq=False)
class Where:
    """What a person says of where the face is; nothing: it is found."""

    box: Box | None = None
    """Left, top, right, bottom px in the first picture, forehead to chin."""
    mask: NDArray[np.bool_] | None = None
    """[H, W] the lower face in the first picture."""
    face: int | None = None
    """Which one, counted from the left, where several are seen."""

    @property
    def is_found(self) -> bool:
        """Whether the networks look for the face, and find its lips too: nobody said where it is."""
        return self.box is None and self.mask is None


def corpus_from_points(folder: Path, paths: Iterable[str | Path], header: Mapping[str, Any], where: Where) -> Corpus:
    """Make a corpus, still empty, for the speaker of videos in files and folders: points and rate are chosen on them.

    header: performer, emotions, licence, … of `Corpus.create`. Nothing is written where no points can be chosen.
    """
    recordings, refused = find_recordings(paths)
    videos = [recording for recording in recordings if recording.motion.suffix.lower() in VIDEO]
    if not videos:
        reason = "; ".join(f"{name}: {why}" for name, why in list(refused.items())[:2])
        raise FacesynthError(
            f"there is no video to follow points in{f' ({reason})' if reason else ''}; give clips of the speaker"
        )
    clips = _first_clips(videos)
    region = face_region(clips[0].frames[0], box=where.box, mask=where.mask, face=where.face)
    reference = Reference.choose(clips, region, mouth=where.is_found, face=where.face)
    reference.save(folder / POINTS)
    notes = {"notes": NOTES.format(reference.lower) + (OF_THE_MOUTH if reference.mouth else "")}
    return Corpus.create(folder, layout=reference.layout, fps=clips[0].fps, **{**notes, **header})


def motion_from_points(folder: Path, video: Path, sound: Path, fps: float) -> tuple[Motion, tuple[str, ...]]:
    """The points of a video, at the rate of the corpus in `folder`, and what was noticed."""
    reference = Reference.load(folder / POINTS)
    shapes, following, resampled = kept_shapes(video, reference)
    drift = following.drift
    remarks = [
        f"{following.lost_share:.1%} of the points' samples lost and filled in; there and back they drift by"
        f" {drift.median_px:.2f} px (median), {drift.worst_tenth_px:.2f} px (worst tenth), {drift.lost_share:.0%} get lost"
    ]
    if resampled:
        remarks.append(f"the video's rate varies: motion was interpolated at the pictures' true times, at {shapes.fps:g} fps")
    motion = shapes.to_motion(reference.layout)
    if sound != video:
        clock = clock_between(*load_audio(video), *load_audio(sound))
        motion = on_clock(motion, clock)
        remarks.append(str(clock))
    if not np.isclose(motion.fps, fps, rtol=1e-6):
        remarks.append(f"resampled from {motion.fps:g} to {fps:g} fps")
        motion = resample(motion, fps)
    return Motion(motion.frames, fps, motion.layout), tuple(remarks)


def keep_videos(corpus: Corpus, videos: Mapping[str, Path]) -> None:
    """Copy the video of each utterance id into the corpus, with where the points are in it; what is there stays."""
    reference = Reference.load(corpus.path / POINTS)
    for utterance_id, video in track(videos.items(), "keeping pictures", len(videos)):
        target = _video_path(corpus.path, utterance_id, video.suffix.lower())
        if not target.with_suffix(".npz").is_file():
            with atomic_path(target) as part:
                shutil.copyfile(video, part)
            save_shapes(target.with_suffix(".npz"), *kept_shapes(video, reference))


def forget_videos(corpus: Corpus, ids: Iterable[str]) -> None:
    """Delete the kept videos of utterances that were recorded anew."""
    for utterance_id in ids:
        for suffix in sorted(VIDEO):
            path = _video_path(corpus.path, utterance_id, suffix)
            path.with_suffix(".npz").unlink(missing_ok=True)
            path.unlink(missing_ok=True)


def kept_videos(corpus: Corpus) -> dict[str, Path]:
    """The video of each usable utterance that has one kept."""
    found = {}
    for utterance_id in corpus.ids:
        for suffix in sorted(VIDEO):
            path = _video_path(corpus.path, utterance_id, suffix)
            if path.is_file() and path.with_suffix(".npz").is_file():
                found[utterance_id] = path
                break
    return found


def shapes_beside(video: Path) -> Shapes:
    """Where the points are in a kept video."""
    return load_shapes(video.with_suffix(".npz"))


def _video_path(folder: Path, utterance_id: str, suffix: str) -> Path:
    return folder / FOLDER / (check_id(utterance_id) + suffix)


def _first_clips(recordings: Sequence[Recording]) -> list[Footage]:
    """Some clips of one size; those that cannot be used are passed over, unless all are."""
    places = np.unique(np.linspace(0, len(recordings) - 1, FIRST_CLIPS).round().astype(int))
    results = [_attempt(recordings[place]) for place in places]
    clips = [result for result in results if isinstance(result, Footage)]
    if not clips:
        raise next(result for result in results if isinstance(result, FacesynthError))
    return [clip for clip in clips if clip.frames.shape[1:] == clips[0].frames.shape[1:]]


def _attempt(recording: Recording) -> Footage | FacesynthError:
    try:
        load_audio(recording.sound)
        return read_footage(recording.motion)
    except FacesynthError as error:
        return error
