"""What is seen of a face in a video: its points in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.square import Image
from facesynth.capture.tracker import POINTS, Seen, Tracker
from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError

LONGEST_S = 3600.0
FEWEST_FRAMES = 5
"""With a face in fewer frames there is nothing to learn from."""
DOUBTFUL = 0.5
"""A frame whose log odds of a face are under this share of the clip's median shows a damaged picture, or a hand.

In clips that begin with half-decoded pictures those lie at 0 to 9, whole pictures at 18 to 28."""


@dataclass(frozen=True, eq=False)
class Track:
    """A face in a video: frame i lies at i / fps on the clock of the sound."""

    points_px: NDArray[np.float32]
    """[T, 468, 3] right and down in the picture, and away from the camera on the same scale; NaN where no face is seen."""
    irises_px: NDArray[np.float32]
    """[T, 2, 2] middle of the performer's right and left iris in the picture."""
    fps: float
    damaged: int = 0
    """How many pictures the file holds damaged, so that parts of them are made up."""

    @property
    def present(self) -> NDArray[np.bool_]:
        """[T] where a face was seen."""
        return np.asarray(np.isfinite(self.points_px[:, 0, 0]))


def track_face(path: str | Path, face: int | None = None) -> Track:
    """Follow the one face of a video; `face` chooses among several, counted from the left of the picture.

    Pictures are laid on a steady clock: one that was dropped leaves a gap, as does one without the face.
    """
    path = Path(path)
    tracker = Tracker(face)
    seen: dict[int, Seen | None] = {}
    with open_video(path) as video:
        for time_s, image in video.images:
            slot = round(time_s * video.fps)
            if not -video.fps <= slot <= LONGEST_S * video.fps:
                raise FacesynthError(f"{path} has a picture at {time_s:.0f} s; cut it into clips of a sentence or two")
            if slot >= 0 and slot not in seen:
                seen[slot] = _followed(tracker, image, len(seen) % round(video.fps) == 0, path)
    return _track(seen, video.fps, len(video.damaged), path)


def _followed(tracker: Tracker, image: Image, is_check: bool, path: Path) -> Seen | None:
    """The next picture's face; once a second the whole picture is searched for others."""
    try:
        if is_check:
            tracker.check_alone(image)
        return tracker.follow(image)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def _track(seen: dict[int, Seen | None], fps: float, damaged: int, path: Path) -> Track:
    certain = np.median([face.logit for face in seen.values() if face is not None] or [0.0])
    count = max(seen, default=-1) + 1
    points, irises = np.full((count, POINTS, 3), np.nan, np.float32), np.full((count, 2, 2), np.nan, np.float32)
    for slot, face in seen.items():
        if face is not None and face.logit >= DOUBTFUL * certain:
            points[slot], irises[slot] = face.points, face.irises
    track = Track(points, irises, fps, damaged)
    if track.present.sum() < FEWEST_FRAMES:
        raise FacesynthError(
            f"{path} shows a face in {track.present.sum()} of {count} frames; the face should fill a sixth of the picture or more"
        )
    return track
