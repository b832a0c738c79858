"""Patch-based sampling of recorded signals: new ones that are made of pieces of the old (Liang et al. 2001; Deng 2006, ch. 3).

A signal grows by one patch at a time. The first frames of a patch, its boundary zone, lie over the last ones that are there; a
patch qualifies when the two differ by less than a tolerance,

    d(a, b) = sqrt(mean over the zone of sum_c (a_c - b_c)² / V_c)  <  epsilon · d(end of the signal, 0)      (eq. 3.2 to 3.4)

with the variance V_c of each channel. One of those that qualify is drawn, and faded in over the zone.
"""

from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Ints
from .errors import FacesynthError

SMALLEST = 1e-9
"""Variance of a channel that does not move."""


@dataclass(frozen=True)
class PatchSettings:
    """Sizes in frames."""

    patch: int
    boundary: int
    tolerance: float
    """epsilon of eq. 3.4."""


@dataclass(frozen=True, eq=False)
class Growth:
    """A synthesised signal and how it came about."""

    frames: Floats
    """[T, C]"""
    places: Ints
    """Where each patch begins in the recorded frames."""
    stuck: int
    """Steps at which nothing qualified, so that the nearest patch was taken."""
    continued: int
    """Steps at which only what was recorded next qualified."""


class PatchTexture:
    """Recorded frames [F, C] of one or more recordings, ready to be grown from."""

    def __init__(self, frames: Floats, starts: Ints, settings: PatchSettings) -> None:
        """`starts`: first frame of each recording, rising from 0. FacesynthError where no recording holds a whole patch."""
        self.frames, self.settings = np.asarray(frames, np.float64), settings
        if not 0 < settings.boundary < settings.patch or settings.tolerance < 0:
            raise FacesynthError(
                f"a patch of {settings.patch} frames with a boundary of {settings.boundary} and a tolerance of "
                f"{settings.tolerance:g} cannot grow; wanted 0 < boundary < patch and a tolerance that is not negative"
            )
        stops = np.append(starts[1:], len(self.frames))
        whole = [np.arange(a, b - settings.patch + 1) for a, b in zip(starts, stops, strict=True)]
        self.candidates = np.concatenate([np.zeros(0, np.int64), *whole]).astype(np.int64)
        if not len(self.candidates):
            longest = int((stops - starts).max(initial=0))
            raise FacesynthError(
                f"no recording is as long as a patch of {settings.patch} frames; the longest has {longest}: record more"
            )
        variance = self.frames.var(axis=0, ddof=1) if len(self.frames) > 1 else np.zeros(self.frames.shape[1])
        self._scaled = self.frames / np.sqrt(np.where(variance > SMALLEST, variance, np.inf))
        squares = np.square(self._scaled).sum(axis=1)
        zone = np.lib.stride_tricks.sliding_window_view(squares, settings.boundary).sum(axis=1)
        self._zone_squares = zone[self.candidates]

    def grow(self, count: int, rng: np.random.Generator) -> Growth:
        """A signal of `count` frames, begun with a patch that is drawn from all."""
        patch, zone = self.settings.patch, self.settings.boundary
        place = int(rng.choice(self.candidates))
        out, places, stuck, continued = np.empty((count + patch, self.frames.shape[1])), [place], 0, 0
        out[:patch] = self.frames[place : place + patch]
        scaled_end, length = self._scaled[place + patch - zone : place + patch], patch
        rise = (np.arange(1, zone + 1) / (zone + 1))[:, None]
        while length < count:
            chosen, qualified = self._next(scaled_end, rng)
            stuck += qualified == 0
            continued += qualified == 1 and chosen == place + patch - zone
            place = chosen
            places.append(place)
            out[length - zone : length] += rise * (self.frames[place : place + zone] - out[length - zone : length])
            out[length : length + patch - zone] = self.frames[place + zone : place + patch]
            length += patch - zone
            scaled_end = self._scaled[place + patch - zone : place + patch]
        return Growth(out[:count], np.array(places, np.int64), stuck, continued)

    def _next(self, end: Floats, rng: np.random.Generator) -> tuple[int, int]:
        """A patch that may follow, and how many qualified."""
        zone = self.settings.boundary
        crossed = sum(self._scaled[self.candidates + k] @ end[k] for k in range(zone))
        own = float(np.square(end).sum())
        squared = np.maximum(self._zone_squares - 2 * crossed + own, 0.0)
        qualified = np.flatnonzero(squared < self.settings.tolerance**2 * own)
        if len(qualified):
            return int(self.candidates[rng.choice(qualified)]), len(qualified)
        return int(self.candidates[squared.argmin()]), 0
