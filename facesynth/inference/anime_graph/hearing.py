"""Sound to the features of each phone, at once or as it comes in."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..checks import checked_piece
from ..errors import FacesynthError
from ..speech import PhoneTrack

RATE = 16000
HOP, WINDOW = 160, 400
"""Of a feature's frame, samples."""
SMALLEST_SWING = 1e-4
"""A sound whose samples differ by less (full scale is 2) is constant: there is nothing in it to match."""


def require_sound(audio: NDArray[Any], of_what: str) -> None:
    """FacesynthError where sound is constant."""
    if float(np.ptp(audio)) < SMALLEST_SWING:
        raise FacesynthError(f"the sound of {of_what} is constant (silence?); choose a recording in which somebody speaks")


def ranges(phones: PhoneTrack, fps: float, count: int) -> Ints:
    """[P, 2] first feature frame and one past the last of each phone, at least one each, within `count` frames."""
    bounds = phones.frame_bounds(fps)
    starts = np.minimum(bounds[:-1], count - 1)
    return np.stack([starts, np.maximum(np.minimum(bounds[1:], count), starts + 1)], axis=1)


class Ear:
    """`hear` sound at 16 kHz; `features` [G, P] grow, `finish` completes them with silence."""

    def __init__(self, plp: Callable[..., list[NDArray[Any]]], bands: int, parameters: int) -> None:
        """plp: windows [1, n, WINDOW] and the state so far to features [1, n, parameters] and the state after them."""
        self._plp = plp
        self._history, self._level = np.zeros((1, 4, bands)), np.zeros((1, bands))
        self._sound = np.zeros(WINDOW // 2, np.float32)
        """From the next frame's window on; before the sound there is silence."""
        self.samples = 0
        self._known: list[NDArray[np.float32]] = []
        self.count = 0
        self._empty = np.zeros((0, parameters), np.float32)

    @property
    def features(self) -> Floats:
        """[G, P] so far."""
        self._known = [np.concatenate([self._empty, *self._known])]
        return self._known[0].astype(np.float64)

    def hear(self, audio: ArrayLike) -> None:
        """More sound."""
        sound = checked_piece(audio)
        self._sound = np.concatenate([self._sound, sound])
        self.samples += len(sound)
        self._take((len(self._sound) - WINDOW) // HOP + 1)

    def finish(self) -> None:
        """After the end there is silence: frames up to the last that is centred within the sound."""
        self._sound = np.pad(self._sound, (0, WINDOW + HOP))
        self._take(1 + self.samples // HOP - self.count)

    def _take(self, count: int) -> None:
        if count <= 0:
            return
        windows = np.lib.stride_tricks.sliding_window_view(self._sound, WINDOW)[::HOP][:count]
        state = {"history": self._history, "level": self._level, "fresh": np.array(float(self.count == 0))}
        cepstra, self._history, self._level = self._plp(windows=windows[None], **state)
        self._known.append(cepstra[0])
        self._sound, self.count = self._sound[count * HOP :], self.count + count
