"""Expressions apart from speech: recorded signals of what an emotion adds to a neutral face, grown anew and added to any motion.

Deng 2006, §5.2: the signals lie in an expression eigenspace of three dimensions. A new one is grown of pieces of those of an
emotion (`patches`), scaled by how strongly it is felt at each moment, and added; lips that were shut are shut after it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checks import checked_seed
from .closures import keep_shut
from .emotion_track import felt_over
from .errors import FacesynthError, reject_options, unknown
from .filters import at_rate
from .folder import Folder
from .graphs import Graph
from .layout import Layout
from .motion import Motion
from .patches import Growth, PatchSettings, PatchTexture
from .speech import NEUTRAL, Speech

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Parts:
    """What a trained model consists of."""

    layout: Layout
    fps: float
    """Of the signals, Hz."""
    emotions: tuple[str, ...]
    """Those that were recorded beside neutral."""
    rest: Floats
    """[C] a neutral pose."""
    signals: Floats
    """[F, D] recorded signals, one recording after the other."""
    starts: Ints
    """[R] first frame of each recording."""
    owners: Ints
    """[R] the emotion of each."""
    settings: PatchSettings
    decode: Callable[[NDArray[np.float32]], NDArray[np.float32]]
    """Signals [T, D] to what they add to frames [T, C]."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that the model came from, if it came from one."""


class Expression:
    """Patch-based sampling of expressive motion, trained."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.manifest = parts, parts.manifest
        self.layout, self.fps, self.emotions = parts.layout, parts.fps, (NEUTRAL, *parts.emotions)

    @cached_property
    def textures(self) -> Mapping[str, PatchTexture]:
        """What each emotion's signals are grown from."""
        return {emotion: self._texture(number) for number, emotion in enumerate(self.parts.emotions)}

    def grow(self, emotion: str, count: int, *, seed: int = 0) -> Growth:
        """A new signal [count, D] of an emotion, at the model's rate, and how it came about."""
        if emotion not in self.textures:
            raise unknown("emotion", emotion, self.parts.emotions)
        number = self.parts.emotions.index(emotion)
        return self.textures[emotion].grow(count, np.random.default_rng([checked_seed(seed), number]))

    def express(self, motion: Motion, speech: Speech, *, seed: int = 0) -> Motion:
        """A motion of the learned layout, of any method, with the emotions of speech as strong as their intensities say.

        Where the intensity is 0, or the emotion neutral, the motion stays as it is, to the byte.
        """
        self._require_layout(motion.layout)
        frames = motion.frames.astype(np.float64)
        added = np.zeros_like(frames)
        for emotion in sorted(set(speech.emotions.labels) - {NEUTRAL}):
            if emotion not in self.parts.emotions:
                raise unknown("emotion", emotion, self.emotions)
            amount = felt_over(speech.emotions, emotion, motion, speech.emotions.intensities)
            if amount.max(initial=0) > 0:
                added += amount[:, None] * self._signal(emotion, len(motion), motion.fps, seed)
        changed = frames + added
        if motion.layout.kind == "curves":
            changed = np.where(added == 0, frames, np.clip(changed, 0, 1))
        return replace(motion, frames=keep_shut(changed, frames, motion.layout).astype(np.float32))

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """A face that feels and says nothing."""
        reject_options("expression", options, ("seed",))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        still = Motion(np.tile(self.parts.rest.astype(np.float32), (count, 1)), self.fps, self.layout)
        return self.express(still, speech, seed=seed)

    def _signal(self, emotion: str, count: int, fps: float, seed: int) -> Floats:
        """[count, C] what a new signal adds, at another rate."""
        own = int(np.ceil(count * self.fps / fps)) + 1
        added = self.parts.decode(self.grow(emotion, own, seed=seed).frames.astype(np.float32)).astype(np.float64)
        return at_rate(added, self.fps, fps, np.arange(count, dtype=np.float64) * (self.fps / fps))

    def _texture(self, number: int) -> PatchTexture:
        stops = np.append(self.parts.starts[1:], len(self.parts.signals))
        mine = np.flatnonzero(self.parts.owners == number)
        pieces = [self.parts.signals[self.parts.starts[k] : stops[k]] for k in mine]
        starts = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
        return PatchTexture(np.concatenate(pieces), starts, self.parts.settings)

    def _require_layout(self, got: Layout) -> None:
        if (got.kind, got.names) != (self.layout.kind, self.layout.names):
            raise FacesynthError(
                f"this model adds expressions to motion of its own layout ({len(self.layout.names)} {self.layout.kind}); "
                f"got {len(got.names)} {got.kind} with other names: train both on one performer"
            )


def load_expression(folder: Folder, threads: int) -> Expression:
    """The model in a folder that `expression_content` filled."""
    manifest, arrays, decode = folder.manifest, folder.arrays(), Graph(folder, "decode", threads)
    return Expression(
        Parts(
            layout=folder.layout,
            fps=float(manifest["fps"]),
            emotions=tuple(folder.settings["expressions"]),
            rest=arrays["rest"].astype(np.float64),
            signals=arrays["signals"].astype(np.float64),
            starts=arrays["starts"].astype(np.int64),
            owners=arrays["owners"].astype(np.int64),
            settings=PatchSettings(**folder.settings["patches"]),
            decode=lambda signals: decode(coordinates=signals[None])[0][0],
            manifest=manifest,
        )
    )


def patch_settings(fps: float, patch_s: float, boundary_s: float, tolerance: float) -> PatchSettings:
    """Lengths in seconds as frames: a boundary of one at least, a patch of two more."""
    boundary = max(1, round(boundary_s * fps))
    return PatchSettings(max(boundary + 2, round(patch_s * fps)), boundary, tolerance)
