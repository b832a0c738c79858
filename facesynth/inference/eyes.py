"""Eyes from recorded ones: lids and gaze grow together from patches of recordings (Deng 2006, ch. 3), and go with the head.

Patches are joined where the gaze shifts (`shift_patches`) or, as in the dissertation, anywhere (`patches`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .errors import reject_options
from .folder import Folder
from .gaze import head_turns, quick_turns, within_reach
from .layout import Layout
from .motion import Motion
from .patches import Growth, PatchSettings, PatchTexture
from .phones import SILENCE
from .shift_patches import EITHER, LISTENING, ROLES, SPEAKING, ShiftTexture
from .speech import PhoneTrack, Speech

SHIFTS, ANYWHERE = "shifts", "anywhere"
"""Where patches are joined."""
LISTENING_S = 2.0
"""Whoever is silent for so long listens."""


@dataclass(frozen=True, eq=False)
class Parts:
    """What a trained model consists of."""

    layout: Layout
    fps: float
    """Of the recorded eyes, Hz."""
    emotions: tuple[str, ...]
    frames: NDArray[np.floating]
    """[F, 3] recorded opening of the lids and gaze (rad), held against the head's quick turns."""
    starts: NDArray[np.integer]
    """[R] first frame of each recording."""
    roles: NDArray[np.integer]
    """[R] what the person did in each recording: EITHER, SPEAKING or LISTENING."""
    joins: str
    """Where patches are joined: "shifts" or "anywhere"."""
    settings: PatchSettings
    compensation: NDArray[np.floating]
    """[3] share of the head's quick turns that the eyes undo in each of `ROLES`."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that the model came from, if it came from one."""


class Eyes:
    """Lids and gaze, grown together."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.manifest = parts, parts.manifest
        self.layout, self.fps, self.emotions = parts.layout, parts.fps, parts.emotions
        frames, starts = parts.frames.astype(np.float64), parts.starts.astype(np.int64)
        self._anywhere = PatchTexture(frames, starts, parts.settings) if parts.joins == ANYWHERE else None
        self._at_shifts = ShiftTexture(frames, starts, parts.roles.astype(np.int64), self.fps, parts.settings.patch)

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Eyes for a head that is still; of what is said it counts only whether anything is."""
        reject_options("eyes", options, ("seed",))
        still = at_rest(self.layout, int(speech.phones.frame_bounds(self.fps)[-1]), self.fps)
        return self.look(still, seed=seed, phones=speech.phones)

    def look(self, motion: Motion, *, seed: int = 0, phones: PhoneTrack | None = None, turning: float = 1.0) -> Motion:
        """The motion with these eyes, at its own rate, and with a head that follows their wide shifts.

        The eyes undo a share of the head's quick turns and all of the turns that follow them. A motion without a head gets
        one where there are wide shifts; a head of zeros turns as well. With phones, eyes listen where nobody speaks for long.
        turning: factor on the turns that follow; 0: the head stays as it is and the eyes alone make the whole shift.
        """
        frames = self.grow(len(motion) / motion.fps, seed, phones).frames
        wide = turning * head_turns(frames[:, 1:], self.fps)
        grown, turns = self._at_times(frames, motion), self._at_times(wide, motion)
        head = np.zeros((len(motion), 6), np.float32) if motion.head is None else motion.head
        undone = self.parts.compensation[roles_of(phones, len(motion), motion.fps)]
        gaze = grown[:, 1:] - undone[:, None] * quick_turns(head, motion.fps) - turns
        eyes = np.concatenate([np.clip(grown[:, :1], 0, 1), within_reach(gaze)], axis=1)
        if not turning:
            return replace(motion, eyes=eyes.astype(np.float32))
        head = head + np.pad(np.stack([-turns[:, 1], turns[:, 0]], axis=1), ((0, 0), (0, 4)))
        return replace(motion, eyes=eyes.astype(np.float32), head=head.astype(np.float32))

    def grow(self, duration_s: float, seed: int, phones: PhoneTrack | None = None) -> Growth:
        """Lids and gaze [T, 3] at the recordings' rate, and how they came about; the same at whatever rate they are shown."""
        count, rng = int(np.ceil(duration_s * self.fps)) + 1, np.random.default_rng([seed, 3])
        if self._anywhere is not None:
            return self._anywhere.grow(count, rng)
        return self._at_shifts.grow(count, rng, roles_of(phones, count, self.fps))

    def _at_times(self, frames: Floats, motion: Motion) -> Floats:
        times_s = np.arange(len(frames)) / self.fps
        return np.stack([np.interp(motion.times_s, times_s, column) for column in frames.T], axis=1)


def roles_of(phones: PhoneTrack | None, count: int, fps: float) -> NDArray[np.int64]:
    """[count] SPEAKING, or LISTENING in silences of LISTENING_S and more; EITHER throughout where no phone is known."""
    roles = np.full(count, EITHER)
    if phones is None or set(phones.labels) == {SILENCE}:
        return roles
    roles[:] = SPEAKING
    bounds = phones.frame_bounds(fps)
    silent = np.array([label == SILENCE for label in phones.labels]) & (phones.ends_s - phones.starts_s >= LISTENING_S)
    for start, stop in zip(bounds[:-1][silent], bounds[1:][silent], strict=True):
        roles[start:stop] = LISTENING
    return roles


def at_rest(layout: Layout, count: int, fps: float) -> Motion:
    """A face that does not move."""
    rest = np.zeros(layout.channels) if layout.neutral is None else np.asarray(layout.neutral)
    return Motion(np.tile(rest.astype(np.float32), (count, 1)), fps, layout)


def load_eyes(folder: Folder, threads: int) -> Eyes:
    """The model in a folder that `eyes_content` filled; there is no graph in it, so nothing that runs on threads."""
    arrays, settings, manifest = folder.arrays(), folder.settings, folder.manifest
    return Eyes(
        Parts(
            layout=folder.layout,
            fps=float(manifest["fps"]),
            emotions=tuple(manifest["emotions"]),
            frames=arrays["frames"],
            starts=arrays["starts"],
            roles=arrays["roles"],
            joins=str(settings["joins"]),
            settings=PatchSettings(int(settings["patch"]), int(settings["boundary"]), float(settings["tolerance"])),
            compensation=np.broadcast_to(np.asarray(settings["compensation"], np.float64), len(ROLES)),
            manifest=manifest,
        )
    )
