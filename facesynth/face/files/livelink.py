"""Live Link Face takes: a CSV of timecode, 52 weights and nine angles of head and eyes."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.face.animation import FaceAnimation
from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import row_blocks
from facesynth.inference.motion import Motion
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.livelink import ANGLES, TIMECODE, WEIGHTS, read_take
from facesynth.motion.livelink import COUNT as BLENDSHAPE_COUNT
from facesynth.motion.timecode import nominal_rate, timecode

HEADER = (TIMECODE, BLENDSHAPE_COUNT, *WEIGHTS, *ANGLES)
COUNT = len(HEADER) - 2
EYE_CURVES = tuple(name[0].lower() + name[1:] for name in ANGLES[3:])
"""What a motion calls the angles of each eye (rad, the app's signs), where it has them."""


@dataclass(frozen=True, eq=False)
class LiveLinkTake:
    """A take as it stands in the file."""

    timecodes: tuple[str, ...]
    """T times of day, `HH:MM:SS:FF.mmm`."""
    values: NDArray[np.float64]
    """[T, 61] weights in Apple's order (0..1), then yaw, pitch and roll of head, left and right eye (rad)."""
    fps: float
    """Frames per second, Hz."""

    def animation(self) -> FaceAnimation:
        """The take as an animation; the gaze is the mean of both eyes, the head has no translation."""
        angles = self.values[:, len(ARKIT_NAMES) :].reshape(-1, 3, 3)
        head = np.concatenate([_rotation_vectors(angles[:, 0]), np.zeros((len(angles), 3))], axis=1)
        gaze = -angles[:, 1:, :2].mean(axis=1)
        weights = np.clip(self.values[:, : len(ARKIT_NAMES)], 0, 1)
        return FaceAnimation(ARKIT_NAMES, weights, head, gaze, np.zeros(len(weights)), self.fps)


def take_of(animation: FaceAnimation, motion: Motion | None = None, rows: slice = slice(None)) -> LiveLinkTake:
    """An animation, or some of its frames, as a take that starts at midnight; translation and tongue tip have no column.

    motion: where it has the angles of each eye as curves of their own, those are what the eyes differ by.
    """
    rate, times_s = nominal_rate(animation.fps), animation.times_s[rows]
    gaze = -animation.gaze[rows].astype(np.float64)
    eyes = np.tile(np.concatenate([gaze, np.zeros((len(gaze), 1))], axis=1), (1, 2))
    if motion is not None and set(EYE_CURVES) <= set(motion.layout.names):
        eyes += _apart(motion, times_s)
    head = _angles(animation.head[rows, :3].astype(np.float64))
    values = np.concatenate([animation.weights_for(ARKIT_NAMES, rows), head, eyes], axis=1)
    return LiveLinkTake(tuple(timecode(t, rate) for t in times_s), values, animation.fps)


def _apart(motion: Motion, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, 6] by how much the angles of each eye differ from their common gaze, at other times."""
    own = motion.frames[:, [motion.layout.names.index(name) for name in EYE_CURVES]].astype(np.float64)
    both = own.reshape(-1, 2, 3)
    both[:, :, :2] -= both[:, :, :2].mean(axis=1, keepdims=True)
    return np.stack([np.interp(times_s, motion.times_s, column) for column in both.reshape(-1, 6).T], axis=1)


def write_livelink(path: str | Path, take: LiveLinkTake) -> None:
    """Write a take as the app does, ten decimals, Unix line ends."""
    _write(path, [take])


def write_as_livelink(path: str | Path, animation: FaceAnimation, motion: Motion | None = None) -> None:
    """Write an animation as such a take, some frames at a time; see `take_of`."""
    _write(path, (take_of(animation, motion, rows) for rows in row_blocks(animation.weights)))


def _write(path: str | Path, takes: Iterable[LiveLinkTake]) -> None:
    """Takes one after the other."""
    with atomic_path(path) as part, part.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(HEADER) + "\n")
        for take in takes:
            for time, values in zip(take.timecodes, take.values, strict=True):
                # + 0.0: no minus zeros
                file.write(f"{time},{COUNT}," + ",".join(f"{value + 0.0:.10f}" for value in values) + "\n")


def read_livelink(path: str | Path, fps: float | None = None) -> LiveLinkTake:
    """Read a take; writing it again gives the same bytes.

    The rate is read off the timecodes; a take of under a second does not show it and needs `fps`.
    """
    path = Path(path)
    take = read_take(path, fps)
    wanted = HEADER[2:]
    if not take.has(wanted):
        lacking = next(name for name in wanted if name not in take.names)
        raise FacesynthError(f"{path} has no column {lacking!r}; wanted the {COUNT} of the app")
    if np.isnan(take.values).any():
        raise FacesynthError(f"{path} holds rows without values (NaN); add it to a corpus, where they are gaps")
    return LiveLinkTake(take.timecodes, take.rows(wanted), take.fps)


# Signs: in takes of the app, EyeLookInLeft (the left eye looks to the performer's right) goes with positive
# LeftEyeYaw, EyeLookUp with negative pitch, in radians. The takes we have keep the head still, so for the head
# we take the same signs: yaw to the performer's right, pitch down, and roll, as the mirror image of ARKit's
# right-handed axes asks, to the performer's left shoulder; turned in the order yaw, pitch, roll.


def _angles(rotation_vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(rotation_vectors).as_euler("YXZ") * [-1.0, 1.0, -1.0]


def _rotation_vectors(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("YXZ", angles * [-1.0, 1.0, -1.0]).as_rotvec()
