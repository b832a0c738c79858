"""Ordinary video as recordings: the face is captured, the corpus is made to fit its performer."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.capture.clock import clock_between, on_clock
from facesynth.capture.kept_tracks import kept_track
from facesynth.capture.landmarks import OUTER_CORNERS_MM, landmark_layout
from facesynth.capture.motion import motion_of
from facesynth.capture.shape import neutral_shape
from facesynth.capture.track import Track
from facesynth.corpus.add.recordings import MOTION, VIDEO, find_recordings
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.resample import resample
from facesynth.speech.audio import load_audio

CALIBRATION_CLIPS = 12
"""The face at rest is measured on so many clips, taken evenly from all."""
FEWEST_PRESENT = 0.5
"""Share of frames that must show the face."""
NOTES = (
    "Captured from video: 468 face landmarks, millimetres from the outer eye corners, taken as"
    f" {OUTER_CORNERS_MM:g} mm apart (people differ by about 5 %)."
)


def corpus_from_video(
    folder: Path, paths: Iterable[str | Path], header: Mapping[str, Any], *, face: int | None = None, workers: Workers = ALONE
) -> Corpus:
    """Make a corpus, still empty, for the performer of videos in files and folders: layout, rest pose and rate are theirs.

    header: performer, emotions, licence, … of `Corpus.create`.
    """
    recordings, refused = find_recordings(paths)
    videos = [recording.motion for recording in recordings if recording.motion.suffix.lower() in VIDEO]
    if not videos:
        reason = "; ".join(f"{name}: {why}" for name, why in list(refused.items())[:2])
        raise FacesynthError(
            f"{folder} is no corpus yet, and there is no recording to make one from{f' ({reason})' if reason else ''};"
            f" give videos, or motion ({', '.join(sorted(MOTION))}) with its sound under the same name"
        )
    tracks = _calibration(videos, face, workers)
    layout = landmark_layout(neutral_shape(tracks))
    return Corpus.create(folder, layout=layout, fps=tracks[0].fps, **{"notes": NOTES, **header})


def motion_from_video(
    video: Path, sound: Path, layout: Layout, fps: float, face: int | None = None
) -> tuple[Motion, tuple[str, ...]]:
    """The face of a video in the layout and at the rate of its corpus, and what was noticed."""
    track = kept_track(video, face)
    share = float(track.present.mean())
    if share < FEWEST_PRESENT:
        raise FacesynthError(f"{video} shows the face in only {share:.0%} of its frames; at least half are needed")
    remarks = []
    if share < 1:
        remarks.append(f"no face is seen in {np.count_nonzero(~track.present)} of {len(track.present)} frames")
    if track.damaged:
        remarks.append(
            f"{track.damaged} of {len(track.present)} pictures are damaged in the file, in part made up; is there a better copy?"
        )
    if any(track.steps_s):
        shortest_ms, longest_ms = (round(1000 * step_s) for step_s in track.steps_s)
        remarks.append(
            f"the video's rate varies (a picture every {shortest_ms} to {longest_ms} ms): motion was interpolated at the"
            f" pictures' true times, at {track.fps:g} fps"
        )
    motion = motion_of(track, layout)
    if sound != video:
        clock = clock_between(*load_audio(video), *load_audio(sound))
        motion = on_clock(motion, clock)
        remarks.append(str(clock))
    if not np.isclose(track.fps, fps, rtol=1e-6):
        remarks.append(f"resampled from {track.fps:g} to {fps:g} fps")
        motion = resample(motion, fps)
    return Motion(motion.frames, fps, layout, motion.head, motion.eyes), tuple(remarks)


def _calibration(videos: Sequence[Path], face: int | None, workers: Workers) -> list[Track]:
    """The tracks of some clips; those that cannot be used are passed over, unless all are."""
    places = np.unique(np.linspace(0, len(videos) - 1, CALIBRATION_CLIPS).round().astype(int))
    results = list(spread(partial(_attempt, face=face), [videos[place] for place in places], workers, "measuring the face"))
    tracks = [result for result in results if isinstance(result, Track)]
    if not tracks:
        raise next(result for result in results if isinstance(result, FacesynthError))
    return tracks


def _attempt(video: Path, face: int | None) -> Track | FacesynthError:
    try:
        return kept_track(video, face)
    except FacesynthError as error:
        return error
