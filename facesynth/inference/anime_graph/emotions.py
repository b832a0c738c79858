"""Emotion maps put to use: any motion of a layout from one emotion to another, fully or by a share (Cao 2005, §5)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats
from ..checks import require_layout
from ..closures import keep_shut
from ..emotion_track import felt_over
from ..errors import FacesynthError, unknown
from ..layout import Layout
from ..motion import Motion
from ..speech import NEUTRAL, Speech
from .candidates import Maps


@dataclass(frozen=True, eq=False)
class EmotionMapper:
    """The maps between a performer's emotions, on frames."""

    layout: Layout
    emotions: tuple[str, ...]
    maps: Maps
    no_map: Mapping[str, str]
    """Why there is none, by `FROM TO`."""
    encode: Callable[[Floats], Floats]
    """Frames [T, C] to components [T, D]."""
    mixing: Floats
    """[C, D] what each component does."""
    dropped: Floats
    """[M, C] what each map adds to every frame outside the components."""

    def map_emotion(self, motion: Motion, source: str, target: str, *, intensity: Floats | float = 1.0) -> Motion:
        """Any motion of the learned layout, recorded or synthesised by any method, from one emotion to another.

        intensity: 0 leaves the motion, 1 maps it fully; a number or one per frame [T]. What the components do not
        hold stays, lips that were shut stay shut, and frames with missing samples stay missing.
        """
        number = self.number(source, target)
        require_layout(motion.layout, self.layout, "maps")
        if number is None:
            return motion
        frames = motion.frames.astype(np.float64)
        before = self.encode(np.nan_to_num(frames))
        change = (self.maps.through(before, number) - before) @ self.mixing.T
        amount = np.broadcast_to(np.asarray(intensity, np.float64), len(frames))[:, None]
        changed = frames + amount * (change + self.dropped[number])
        return replace(motion, frames=keep_shut(changed, frames, motion.layout, motion.fps).astype(np.float32))

    def map_along(self, motion: Motion, speech: Speech, target: str, *, intensity: float = 1.0) -> Motion:
        """Any motion of the learned layout that goes with speech, from the speech's emotions to another one."""
        if not 0 <= intensity <= 1:
            raise FacesynthError(f"the intensity is {intensity:g}; wanted 0 (unchanged) to 1 for a mapped emotion")
        self.number(target, target)
        for source in sorted(set(speech.emotions.labels) - {target}):
            motion = self.map_emotion(motion, source, target, intensity=intensity * felt_over(speech.emotions, source, motion))
        return motion

    def with_intensity(self, motion: Motion, speech: Speech) -> Motion:
        """An emotion of intensity I is mapped towards neutral by 1 - I; where no map leads there, it stays whole."""
        track = speech.emotions
        for source in sorted(set(track.labels) & set(self.emotions) - {NEUTRAL}):
            weak = felt_over(track, source, motion, 1 - track.intensities)
            mapped = NEUTRAL in self.emotions and f"{source} {NEUTRAL}" not in self.no_map
            if mapped and weak.max() > 0:
                motion = self.map_emotion(motion, source, NEUTRAL, intensity=weak)
        return motion

    def number(self, source: str, target: str) -> int | None:
        """Number of a map, None from an emotion to itself; FacesynthError where there is none."""
        for name in (source, target):
            if name not in self.emotions:
                raise unknown("emotion", name, self.emotions)
        if source == target:
            return None
        pair = self.emotions.index(source), self.emotions.index(target)
        if pair not in self.maps.pairs:
            raise FacesynthError(self.no_map.get(f"{source} {target}", f"no map leads from {source} to {target}"))
        return self.maps.pairs.index(pair)
