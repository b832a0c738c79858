"""Eyes from recorded ones: lids and gaze grow together from patches of recordings (Deng 2006, ch. 3), and go with the head."""

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
from .speech import Speech


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
    settings: PatchSettings
    compensation: float
    """Share of the head's quick turns that the eyes undo."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that the model came from, if it came from one."""


class Eyes:
    """Lids and gaze, grown together."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.manifest = parts, parts.manifest
        self.layout, self.fps, self.emotions = parts.layout, parts.fps, parts.emotions
        self.texture = PatchTexture(parts.frames.astype(np.float64), parts.starts.astype(np.int64), parts.settings)

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Eyes for a head that is still; what is said is not heard."""
        reject_options("eyes", options, ("seed",))
        return self.look(at_rest(self.layout, int(speech.phones.frame_bounds(self.fps)[-1]), self.fps), seed=seed)

    def look(self, motion: Motion, *, seed: int = 0) -> Motion:
        """The motion with these eyes, at its own rate, and with a head that follows their wide shifts.

        The eyes undo a share of the head's quick turns and all of the turns that follow them. A motion without a head gets
        one where there are wide shifts; a head of zeros turns as well.
        """
        frames = self.grow(len(motion) / motion.fps, seed).frames
        grown, turns = self._at_times(frames, motion), self._at_times(head_turns(frames[:, 1:], self.fps), motion)
        head = np.zeros((len(motion), 6), np.float32) if motion.head is None else motion.head
        gaze = grown[:, 1:] - self.parts.compensation * quick_turns(head, motion.fps) - turns
        eyes = np.concatenate([np.clip(grown[:, :1], 0, 1), within_reach(gaze)], axis=1)
        head = head + np.pad(np.stack([-turns[:, 1], turns[:, 0]], axis=1), ((0, 0), (0, 4)))
        return replace(motion, eyes=eyes.astype(np.float32), head=head.astype(np.float32))

    def grow(self, duration_s: float, seed: int) -> Growth:
        """Lids and gaze [T, 3] at the recordings' rate, and how they came about; the same at whatever rate they are shown."""
        return self.texture.grow(int(np.ceil(duration_s * self.fps)) + 1, np.random.default_rng([seed, 3]))

    def _at_times(self, frames: Floats, motion: Motion) -> Floats:
        times_s = np.arange(len(frames)) / self.fps
        return np.stack([np.interp(motion.times_s, times_s, column) for column in frames.T], axis=1)


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
            settings=PatchSettings(int(settings["patch"]), int(settings["boundary"]), float(settings["tolerance"])),
            compensation=float(settings["compensation"]),
            manifest=manifest,
        )
    )
