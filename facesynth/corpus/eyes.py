"""How often and how long a performer blinks, and how far the eyes wander: also from recordings without sound."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.motion.gaps import runs

NO_SPEECH = "no speech: there is no sound; kept for eyes and blinks"
"""Why a recording is not usable for speech."""
SHUT = 0.5
"""Share of the usual opening under which an eye is shut."""
LONGEST_BLINK_S = 0.5
"""Eyes that stay shut for longer rest."""


@dataclass(frozen=True)
class EyeStats:
    """What the eyes of a performer do."""

    recordings: int
    silent: int
    """Those of them that have no sound."""
    minutes: float
    blinks: int
    blinks_per_minute: float
    blink_ms: float
    """Median time for which a blink shuts the eye."""
    gaze_deg: tuple[float, float]
    """Spread of the gaze to the sides and up and down (one deviation)."""

    def text(self) -> str:
        """A line for people."""
        return (
            f"eyes              {self.recordings} recordings ({self.silent} without sound), {self.minutes:.1f} minutes:"
            f" {self.blinks_per_minute:.1f} blinks per minute, {self.blink_ms:.0f} ms each; gaze wanders by"
            f" {self.gaze_deg[0]:.1f}° to the sides, {self.gaze_deg[1]:.1f}° up and down"
        )


def eye_stats(corpus: Corpus) -> EyeStats | None:
    """Count the blinks of every recording with eyes, speech or not; None where there is none."""
    tracks = [(motion.eyes, silent) for motion, silent in recorded_eyes(corpus) if motion.eyes is not None]
    if not tracks:
        return None
    blinks_s = [length_s for eyes, _ in tracks for length_s in blink_lengths_s(eyes[:, 0], corpus.fps)]
    minutes = sum(len(eyes) for eyes, _ in tracks) / corpus.fps / 60
    gaze = np.concatenate([eyes[:, 1:] - np.nanmedian(eyes[:, 1:], axis=0) for eyes, _ in tracks if np.isfinite(eyes).any()])
    spread = np.degrees(np.nanstd(gaze, axis=0))
    return EyeStats(
        recordings=len(tracks),
        silent=sum(silent for _, silent in tracks),
        minutes=round(minutes, 3),
        blinks=len(blinks_s),
        blinks_per_minute=round(len(blinks_s) / minutes, 2),
        blink_ms=round(1000 * float(np.median(blinks_s)), 1) if blinks_s else 0.0,
        gaze_deg=(round(float(spread[0]), 2), round(float(spread[1]), 2)),
    )


def blink_lengths_s(opening: NDArray[np.floating], fps: float) -> list[float]:
    """How long each blink in the opening [T] of the eyes lasts, seconds."""
    usual = float(np.nanquantile(opening, 0.9)) if np.isfinite(opening).any() else 0.0
    shut = runs(np.nan_to_num(opening, nan=np.inf) < SHUT * usual)
    return [len(run) / fps for run in shut if len(run) <= LONGEST_BLINK_S * fps and run.start > 0 and run.stop < len(opening)]


def recorded_eyes(corpus: Corpus) -> Iterator[tuple[Motion, bool]]:
    """The raw motion of each recording that has eyes, and whether it is without sound."""
    for record in corpus.records:
        if record.usable or record.reason == NO_SPEECH:
            with suppress(FacesynthError, OSError):
                motion = corpus.raw_motion(record.id)
                if motion.eyes is not None and len(motion) and np.isfinite(motion.eyes).any():
                    yield motion, not record.usable
