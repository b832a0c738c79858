"""What is seen of a face in a video: its points in every frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.square import Image
from facesynth.capture.tracker import POINTS, Seen, Tracker
from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError
from facesynth.motion.gaps import LONGEST_S as LONGEST_GAP_S
from facesynth.motion.irregular import ROUNDING_S, read_at, steady_rate

LONGEST_S = 3600.0
LARGEST_STEP = 1.5
"""Of the median step between pictures: so far apart may they be for motion to be interpolated between them in a slow video."""
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
    steps_s: tuple[float, float] = (0.0, 0.0)
    """Shortest and longest time between pictures of a video whose rate varies; zeros where it does not."""

    @property
    def present(self) -> NDArray[np.bool_]:
        """[T] where a face was seen."""
        return np.asarray(np.isfinite(self.points_px[:, 0, 0]))


def track_face(path: str | Path, face: int | None = None) -> Track:
    """Follow the one face of a video; `face` chooses among several, counted from the left of the picture.

    Motion is interpolated at the pictures' true times; a picture that was dropped leaves a gap, as does one without the face.
    """
    path = Path(path)
    tracker = Tracker(face)
    seen: dict[float, Seen | None] = {}
    with open_video(path) as video:
        for time_s, image in video.images:
            if abs(time_s) > LONGEST_S:
                raise FacesynthError(f"{path} has a picture at {time_s:.0f} s; cut it into clips of a sentence or two")
            if time_s > max(seen, default=-ROUNDING_S):
                seen[time_s] = _followed(tracker, image, len(seen) % round(video.fps) == 0, path)
    return _track(seen, video.fps, len(video.damaged), path)


def _followed(tracker: Tracker, image: Image, is_check: bool, path: Path) -> Seen | None:
    """The next picture's face; once a second the whole picture is searched for others."""
    try:
        if is_check:
            tracker.check_alone(image)
        return tracker.follow(image)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def _track(seen: dict[float, Seen | None], stated_fps: float, damaged: int, path: Path) -> Track:
    certain = np.median([face.logit for face in seen.values() if face is not None] or [0.0])
    points, irises = np.full((len(seen), POINTS, 3), np.nan, np.float32), np.full((len(seen), 2, 2), np.nan, np.float32)
    for number, face in enumerate(seen.values()):
        if face is not None and face.logit >= DOUBTFUL * certain:
            points[number], irises[number] = face.points, face.irises
    if (shown := np.isfinite(points[:, 0, 0]).sum()) < FEWEST_FRAMES:
        raise FacesynthError(
            f"{path} shows a face in {shown} of {len(seen)} frames; the face should fill a sixth of the picture or more"
        )
    times_s = np.array(list(seen))
    fps, even = steady_rate(times_s, stated_fps)
    steps = np.diff(times_s)
    steps_s = (0.0, 0.0) if even else (float(steps.min()), float(steps.max()))
    return Track(at_regular_times(points, times_s, fps), at_regular_times(irises, times_s, fps), fps, damaged, steps_s)


def at_regular_times(signal: NDArray[np.float32], times_s: NDArray[np.float64], fps: float) -> NDArray[np.float32]:
    """A signal [T, …] of pictures taken at `times_s` [T], at i / fps: as it is where a picture was taken then, else on splines.

    NaN between pictures that are further apart than a gap may be that is filled.
    """
    regular_s = np.arange(int(np.floor((times_s[-1] + ROUNDING_S) * fps)) + 1) / fps
    flat = signal.reshape(len(signal), -1)
    slots = np.round(times_s * fps).astype(int)
    placed = np.full((len(regular_s), flat.shape[1]), np.nan, np.float32)
    on_time = np.abs(times_s - slots / fps) <= ROUNDING_S
    if not (on_time.all() and (np.diff(slots) == 1).all()):
        longest_s = max(LONGEST_GAP_S, LARGEST_STEP * float(np.median(np.diff(times_s))))
        placed = read_at(flat, times_s, regular_s, longest_s, ROUNDING_S)
        placed[: int(0 < times_s[0] <= 1 / fps)] = flat[0]  # nothing lies before the first picture, which is near
    placed[slots[on_time]] = flat[on_time]
    return placed.reshape(len(regular_s), *signal.shape[1:])
