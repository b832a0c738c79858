"""What a head of somebody's own does over time: values of its channels, its pose and its gaze."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.arkit import ARKIT_NAMES
from facesynth.face.rig.channel_map import ChannelMap
from facesynth.inference.errors import FacesynthError


@dataclass(frozen=True, eq=False)
class OwnAnimation:
    """T frames of N channels that are nobody else's."""

    names: tuple[str, ...]
    values: NDArray[np.float64]
    """[T, N] in the channels' own ranges."""
    head: NDArray[np.float64]
    """[T, 6] rotation vector (rad) and translation (mm)."""
    gaze: NDArray[np.float64]
    """[T, 2] to the performer's left and up (rad)."""
    fps: float

    def __len__(self) -> int:
        return len(self.values)

    @property
    def times_s(self) -> NDArray[np.float64]:
        """[T] time of each frame, seconds; frame 0 is at 0."""
        return np.arange(len(self)) / self.fps


def on_channels(animation: FaceAnimation, channel_map: ChannelMap) -> OwnAnimation:
    """An animation in the channels of a map: by their own names where it has those, else from its ARKit weights."""
    if set(channel_map.names) <= set(animation.names):
        values = animation.weights_for(channel_map.names).astype(np.float64)
    elif set(animation.names) & set(ARKIT_NAMES):
        values = channel_map.own(animation.weights_for(ARKIT_NAMES))
    else:
        odd = ", ".join(animation.names[:3])
        raise FacesynthError(f"the curves {odd} … are neither this head's nor ARKit's; give a mapping file (--mapping)")
    return OwnAnimation(channel_map.names, values, animation.head.astype(float), animation.gaze.astype(float), animation.fps)
