"""Patches of recorded eyes that begin and end where the gaze shifts, so that every rest lasts as long as it was recorded.

Patches that may be joined anywhere (`patches`) cut rests in two and put others together. Here the unit is a shift with the rest
that follows it. Units follow each other as recorded until a patch is long enough; then any unit may follow that began where the
gaze is now, in lids and gaze. What is left of the difference fades during its shift, where nobody sees it. Places where few have
looked lead to each other and would hold the gaze for ever: a unit that was taken lately is not taken again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Ints
from .gaze import gaze_shifts
from .patches import Growth

NEAR_RAD = np.radians(2.0)
"""Places that are nearer than this are one."""
LIDS_NEAR = 0.2
"""Openings of the lids that are nearer than this are one."""
AGAIN_S = 20.0
"""A unit is taken again after so long, or after half of all that fit."""
EITHER, SPEAKING, LISTENING = ROLES = (0, 1, 2)
"""Role of a recording, what its eyes did then, or of a moment: EITHER is that nobody knows."""


@dataclass(frozen=True, eq=False)
class Units:
    """Shifts with the rest after each, U in all."""

    first: Ints
    """[U] frame in which the shift begins."""
    stop: Ints
    """[U] frame in which the next one begins."""
    shift: Ints
    """[U] frames that the shift takes."""
    following: Ints
    """[U] the unit that was recorded next, -1 where none was."""
    roles: Ints
    """[U] of its recording."""


def units_of(frames: Floats, starts: Ints, roles: Ints, fps: float) -> Units:
    """Of eyes [F, 3] in recordings that begin at `starts` [R]; before the first and after the last shift of one is no unit."""
    rows: list[tuple[int, int, int, int, int]] = []
    for role, start, stop in zip(roles, starts, np.append(starts[1:], len(frames)), strict=True):
        shifts = gaze_shifts(frames[start:stop, 1:], fps)
        for k, (one, after) in enumerate(pairwise(shifts)):
            following = len(rows) + 1 if k + 2 < len(shifts) else -1
            rows.append((start + one.start, start + after.start, one.stop - one.start, following, int(role)))
    return Units(*np.array(rows, np.int64).reshape(-1, 5).T)


class ShiftTexture:
    """Recorded eyes [F, 3] ready to be grown from, unit by unit."""

    def __init__(self, frames: Floats, starts: Ints, roles: Ints, fps: float, patch: int) -> None:
        """`patch`: frames that are taken as recorded at least, before another unit may follow."""
        self.frames, self.patch, self._again = frames, patch, round(AGAIN_S * fps)
        self.units = units_of(frames, starts, roles, fps)
        self._fits = {role: self._that_fit(role) for role in (EITHER, SPEAKING, LISTENING)}

    @property
    def held(self) -> float:
        """Share of the recorded frames that units hold."""
        return float((self.units.stop - self.units.first).sum() / max(len(self.frames), 1))

    def grow(self, count: int, rng: np.random.Generator, roles: Sequence[int] | Ints | None = None) -> Growth:
        """Eyes of `count` frames; roles [count]: what the person does at each frame, None: anything."""
        wanted = np.full(count, EITHER) if roles is None else np.asarray(roles)
        taken = np.full(len(self.units.first), -self._again)
        unit = int(rng.choice(np.flatnonzero(self._fits[int(wanted[0]) if count else EITHER])))
        parts, places, stuck, continued = [self._joined(unit, None)], [int(self.units.first[unit])], 0, 0
        length, since = len(parts[0]), len(parts[0])
        while length < count:
            taken[unit] = length
            role, here = int(wanted[length]), self.units.stop[unit]
            after = int(self.units.following[unit])
            if after >= 0 and since < self.patch and self._fits[role][after]:
                unit = after
            else:
                unit, qualified = self._next(self.frames[here], self._rested(role, taken, length), rng)
                places.append(int(self.units.first[unit]))
                stuck, continued, since = stuck + (qualified == 0), continued + (qualified == 1 and unit == after), 0
            parts.append(self._joined(unit, self.frames[here]))
            length, since = length + len(parts[-1]), since + len(parts[-1])
        return Growth(np.concatenate(parts)[:count], np.array(places, np.int64), stuck, continued)

    def _rested(self, role: int, taken: Ints, now: int) -> Ints:
        """Units of a role that were not taken lately, at least the half that was not for the longest time."""
        fitting = np.flatnonzero(self._fits[role])
        rested = fitting[now - taken[fitting] >= self._again]
        half = (len(fitting) + 1) // 2
        return rested if len(rested) >= half else fitting[np.argsort(taken[fitting], kind="stable")[:half]]

    def _next(self, here: Floats, candidates: Ints, rng: np.random.Generator) -> tuple[int, int]:
        """A unit that may begin at eyes [3], and how many qualified."""
        away = np.abs(self.frames[self.units.first[candidates]] - here)
        far = np.hypot(away[:, 1], away[:, 2]) / NEAR_RAD
        near = np.flatnonzero((far < 1) & (away[:, 0] < LIDS_NEAR))
        if len(near):
            return int(candidates[rng.choice(near)]), len(near)
        return int(candidates[(far + away[:, 0] / LIDS_NEAR).argmin()]), 0

    def _joined(self, unit: int, here: Floats | None) -> Floats:
        """[n, 3] a unit that begins at eyes [3] in place of where it was recorded to begin."""
        part = self.frames[self.units.first[unit] : self.units.stop[unit]].copy()
        if here is not None:
            count = min(int(self.units.shift[unit]) + 1, len(part))
            part[:count] += np.linspace(1, 0, count + 1)[:-1, None] * (here - part[0])
        return part

    def _that_fit(self, role: int) -> NDArray[np.bool_]:
        """[U] units of a role, of nobody knows which where none is, else all."""
        for one in (role, EITHER):
            if (fits := self.units.roles == one).any():
                return np.asarray(fits)
        return np.ones(len(self.units.roles), np.bool_)
