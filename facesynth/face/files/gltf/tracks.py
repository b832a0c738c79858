"""Movement over time as glTF keeps it: a track of a node's weights, rotation or translation."""

from typing import Any, NamedTuple

import numpy as np
import pygltflib as gl
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf.buffer import Buffer
from facesynth.inference.quaternions import one_hemisphere


class Track(NamedTuple):
    """What one property of a node does."""

    node: int
    path: str
    """weights, rotation or translation."""
    values: NDArray[np.float32]
    """[T, …] as the format wants them."""


def weights_track(node: int, weights: NDArray[Any]) -> Track:
    """Weights [T, N] of the node's mesh."""
    return Track(node, "weights", weights.astype(np.float32).ravel())


def rotation_track(node: int, rotations: Rotation) -> Track:
    """[T, 4] x, y, z, w, each on the same side as the one before, so that players take the short way."""
    return Track(node, "rotation", one_hemisphere(rotations.as_quat(canonical=True)).astype(np.float32))


def translation_track(node: int, places: ArrayLike) -> Track:
    """Places [T, 3] in the file's unit."""
    return Track(node, "translation", np.asarray(places, np.float32))


def head_turns(animation: FaceAnimation) -> Rotation:
    """[T] turns of the head."""
    return Rotation.from_rotvec(animation.head[:, :3].astype(np.float64))


def eye_turns(animation: FaceAnimation) -> Rotation:
    """[T] turns of both eyes in the head."""
    gaze = animation.gaze.astype(np.float64)
    return Rotation.from_euler("YX", np.stack([gaze[:, 0], -gaze[:, 1]], axis=1))


def speech_animation(buffer: Buffer, animation: FaceAnimation, tracks: list[Track]) -> gl.Animation:
    """The tracks as one animation called `speech`, linear between its frames."""
    times = buffer.add(animation.times_s.astype(np.float32))
    samplers = [gl.AnimationSampler(input=times, output=buffer.add(track.values), interpolation="LINEAR") for track in tracks]
    channels = [
        gl.AnimationChannel(sampler=number, target=gl.AnimationChannelTarget(node=track.node, path=track.path))
        for number, track in enumerate(tracks)
    ]
    return gl.Animation(name="speech", channels=channels, samplers=samplers, extras={"fps": animation.fps})
