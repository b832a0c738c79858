"""What methods of the head learn from: sound with the poses that were recorded with it."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.voice import pitch_windows
from facesynth.inference.pitch import RATE
from facesynth.inference.quaternions import from_rotvec, one_hemisphere, to_angles
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.methods.learn.frames import mean_pose

LEAST = 2
"""Recordings to learn from."""


def with_head(corpus: Corpus) -> list[Utterance]:
    """Utterances in which the head's pose is known all along; FacesynthError where there are fewer than LEAST."""
    usable = list(corpus)
    heads = [u for u in usable if u.motion.head is not None and len(u.motion) > 1]
    if not heads:
        raise FacesynthError(
            f"no recording of {corpus.path} has a head pose; give motion with the head in it, or its rigid points"
        )
    complete = [u for u in heads if u.motion.head is not None and np.isfinite(u.motion.head).all()]
    if len(complete) < LEAST:
        raise FacesynthError(
            f"{len(complete)} of {len(usable)} recordings of {corpus.path} have a head pose in every frame; "
            f"at least {LEAST} are needed to learn from: record more, or cut long ones"
        )
    return complete


def still_face(corpus: Corpus) -> NDArray[np.float32]:
    """[C] the face of a model that moves the head alone."""
    rest = np.array(corpus.layout.neutral) if corpus.layout.neutral is not None else mean_pose(corpus)
    return rest.astype(np.float32)


def poses_of(utterance: Utterance) -> Floats:
    """[T, 6] rotation vector (rad) and translation (mm)."""
    return np.asarray(utterance.motion.head, np.float64)


def mean_head(recordings: Iterable[Utterance]) -> Floats:
    """[6] over all frames."""
    return np.asarray(np.concatenate([poses_of(u) for u in recordings]).mean(axis=0))


def about_mean(poses: Iterable[Floats]) -> list[Floats]:
    """Tracks [T, D], each moved so that its mean is that of all frames: the posture of a recording is told by no sound."""
    tracks = list(poses)
    middle = np.concatenate(tracks).mean(axis=0)
    return [track - track.mean(axis=0) + middle for track in tracks]


def sound_windows(utterance: Utterance, fps: float, count: int) -> Floats:
    """[T, L] sound around each of `count` frames at `fps`."""
    return prosody_windows(utterance.speech, fps, count)


def prosody_windows(speech: Speech, fps: float, count: int) -> Floats:
    """[T, L] the same of speech without a recording."""
    audio = resample(speech.audio, speech.sample_rate, RATE)
    return pitch_windows(fps).cut(audio, 0, 0, count).astype(np.float64)


def angles_at(utterance: Utterance, fps: float) -> Floats:
    """[T', 3] pitch, yaw and roll (rad) at another rate, straight between frames."""
    angles = to_angles(one_hemisphere(from_rotvec(poses_of(utterance)[:, :3])))
    count = max(1, round(len(angles) / utterance.motion.fps * fps))
    at, known = np.arange(count) / fps, np.arange(len(angles)) / utterance.motion.fps
    return np.stack([np.interp(at, known, column) for column in angles.T], axis=1)
