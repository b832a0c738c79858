"""Expressions apart from speech: recorded signals of what an emotion adds to a neutral face, grown anew and added to any motion.

Deng 2006, §5.2: the signals lie in an expression eigenspace. A new one is grown of pieces of those of an emotion (`patches`),
scaled by how strongly it is felt at each moment, and added; lips that were shut are shut after it.

Unlike in the dissertation, what phones tell of a signal is not left to chance. A signal is s = E(s | phones) + r, the
expectation linear in the phones around a moment and in the nearness of the beginning and the end (`phone_context`); only the
remainder r is grown from pieces of recorded remainders. With expectations of zero the signals are grown whole.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats, Ints
from .checks import checked_seed, require_layout
from .closures import keep_shut
from .emotion_track import felt_over
from .errors import reject_options, unknown
from .filters import at_rate
from .folder import Folder
from .graphs import Graph
from .layout import Layout
from .motion import Motion
from .patches import Growth, PatchSettings, PatchTexture
from .phone_context import context_of
from .speech import NEUTRAL, PhoneTrack, Speech


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
    weights: Floats
    """[E, CONTEXT, D] of what is expected of each emotion's signals by the phones; zeros where nothing is."""
    constants: Floats
    """[E, D] the same, whatever is said."""
    signals: Floats
    """[F, D] what recorded signals have beyond that, one recording after the other."""
    starts: Ints
    """[R] first frame of each recording."""
    owners: Ints
    """[R] the emotion of each."""
    settings: PatchSettings
    variety: float
    """Share of what is grown that is added to what is expected."""
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
        """What a new signal [count, D] of an emotion has beyond its expectation, at the model's rate, and how it came about."""
        number = self._number(emotion)
        return self.textures[emotion].grow(count, np.random.default_rng([checked_seed(seed), number]))

    def signal(self, emotion: str, phones: PhoneTrack, count: int, *, seed: int = 0) -> Floats:
        """[count, D] a new signal of an emotion while phones are said, at the model's rate."""
        number = self._number(emotion)
        context = context_of(phones.told("expression"), count, self.fps)
        expected = context @ self.parts.weights[number] + self.parts.constants[number]
        return expected + self.parts.variety * self.grow(emotion, count, seed=seed).frames

    def express(self, motion: Motion, speech: Speech, *, seed: int = 0) -> Motion:
        """A motion of the learned layout, of any method, with the emotions of speech as strong as their intensities say.

        Where the intensity is 0, or the emotion neutral, the motion stays as it is, to the byte.
        """
        require_layout(motion.layout, self.layout, "adds expressions to")
        frames = motion.frames.astype(np.float64)
        added = np.zeros_like(frames)
        for emotion in sorted(set(speech.emotions.labels) - {NEUTRAL}):
            self._number(emotion)
            amount = felt_over(speech.emotions, emotion, motion, speech.emotions.intensities)
            if amount.max(initial=0) > 0:
                added += amount[:, None] * self._added(emotion, motion, speech.phones, seed)
        changed = frames + added
        if motion.layout.kind == "curves":
            changed = np.where(added == 0, frames, np.clip(changed, 0, 1))
        return replace(motion, frames=keep_shut(changed, frames, motion.layout, motion.fps).astype(np.float32))

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """A face that feels and says nothing."""
        reject_options("expression", options, ("seed",))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        still = Motion(np.tile(self.parts.rest.astype(np.float32), (count, 1)), self.fps, self.layout)
        return self.express(still, speech, seed=seed)

    def _added(self, emotion: str, motion: Motion, phones: PhoneTrack, seed: int) -> Floats:
        """[T, C] what a new signal adds, at the motion's rate."""
        share = self.fps / motion.fps
        signal = self.signal(emotion, phones, int(np.ceil(len(motion) * share)) + 1, seed=seed)
        added = self.parts.decode(signal.astype(np.float32)).astype(np.float64)
        return at_rate(added, self.fps, motion.fps, np.arange(len(motion), dtype=np.float64) * share)

    def _number(self, emotion: str) -> int:
        if emotion not in self.parts.emotions:
            raise unknown("emotion", emotion, self.emotions)
        return self.parts.emotions.index(emotion)

    def _texture(self, number: int) -> PatchTexture:
        stops = np.append(self.parts.starts[1:], len(self.parts.signals))
        mine = np.flatnonzero(self.parts.owners == number)
        pieces = [self.parts.signals[self.parts.starts[k] : stops[k]] for k in mine]
        starts = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
        return PatchTexture(np.concatenate(pieces), starts, self.parts.settings)


def load_expression(folder: Folder, threads: int) -> Expression:
    """The model in a folder that `expression_content` filled."""
    manifest, arrays, decode = folder.manifest, folder.arrays(), Graph(folder, "decode", threads)
    return Expression(
        Parts(
            layout=folder.layout,
            fps=float(manifest["fps"]),
            emotions=tuple(folder.settings["expressions"]),
            rest=arrays["rest"].astype(np.float64),
            weights=arrays["weights"].astype(np.float64),
            constants=arrays["constants"].astype(np.float64),
            signals=arrays["signals"].astype(np.float64),
            starts=arrays["starts"].astype(np.int64),
            owners=arrays["owners"].astype(np.int64),
            settings=PatchSettings(**folder.settings["patches"]),
            variety=float(folder.settings["variety"]),
            decode=lambda signals: decode(coordinates=signals[None])[0][0],
            manifest=manifest,
        )
    )


def patch_settings(fps: float, patch_s: float, boundary_s: float, tolerance: float) -> PatchSettings:
    """Lengths in seconds as frames: a boundary of one at least, a patch of two more."""
    boundary = max(1, round(boundary_s * fps))
    return PatchSettings(max(boundary + 2, round(patch_s * fps)), boundary, tolerance)
