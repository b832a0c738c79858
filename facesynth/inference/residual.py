"""What moves beside the lips, whatever is said: recorded stretches of it, added to motion that a sound cannot tell it of.

The mean over all that a sound may go with hardly moves brows, lids and cheeks, and raising what little is left (`sharpen`) raises
the lips too far. So what the recorded face did that its own lips do not explain is kept, and stretches of it are added: those
whose loudness went as that of the speech does, for brows and voice rise together. Lip points are not touched.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .filters import cubic_at, gaussian
from .folder import Folder
from .long_arrays import BLOCK_ROWS, Growing, let_go, row_blocks
from .sound import resample
from .speech import Speech

Floats = NDArray[np.float64]

CHUNK_S = 2.5
"""Stretches are about so long, as far as recordings are."""
FADE_S = 0.2
"""How long one stretch fades into the next."""
MEETING = 4.0
"""How much a squared distance of two stretches where they meet counts beside that of their loudness, both standardised."""
RATE, FLOOR, SMOOTH_S = 16000, 1e-8, 0.04
"""Of the sound whose loudness is taken, Hz; energy that counts as nothing; its smoothing, seconds."""
ARRAYS = ("frames", "basis", "loudness", "bounds", "emotions")
"""Of a folder: residual_frames and so on."""


def loudness(speech: Speech, fps: float, count: int) -> Floats:
    """[count] logarithm of the sound's energy around each frame at `fps`, with mean 0 and deviation 1."""
    sound, hop = resample(speech.audio, speech.sample_rate, RATE), RATE / fps
    edges = np.clip(np.round((np.arange(count + 1) - 0.5) * hop).astype(np.int64), 0, len(sound))
    heard = np.maximum(np.diff(edges), 1)
    energy = _energies(sound, edges) / heard
    energy[heard < hop / 4] = energy[max(0, int((heard >= hop / 4).sum()) - 1)]  # after the end it stays as loud
    smooth = gaussian(np.log(energy + FLOOR), max(SMOOTH_S * fps, 1e-3)) if count else energy
    return np.asarray((smooth - smooth.mean()) / max(float(smooth.std()), 1e-6)) if count else smooth


def _energies(sound: NDArray[np.float32], edges: NDArray[np.int64]) -> Floats:
    """[n] sums of the squares of a sound between neighbouring edges [n + 1]."""
    parts = []
    for first in range(0, len(edges) - 1, BLOCK_ROWS):
        own = edges[first : first + BLOCK_ROWS + 1]
        sums = np.concatenate([[0.0], np.cumsum(sound[own[0] : own[-1]].astype(np.float64) ** 2)])
        parts.append(np.diff(sums[own - own[0]]))
        let_go(sound)
    return np.concatenate(parts) if parts else np.zeros(0)


@dataclass(frozen=True, eq=False)
class ResidualMotion:
    """Recorded movement that lips do not explain."""

    frames: NDArray[np.floating[Any]]
    """[F, R] components of all recordings, one after the other."""
    basis: NDArray[np.floating[Any]]
    """[R, C] to channels; 0 at the lips."""
    loudness: NDArray[np.floating[Any]]
    """[F]"""
    bounds: NDArray[np.int64]
    """[U + 1] where recordings begin, and the end of the last."""
    emotions: NDArray[np.int64]
    """[U] numbers of their emotions."""
    fps: float
    share: float = 1.0
    """How much of it is added; 1 as recorded."""

    def added(self, frames: NDArray[Any], speech: Speech, emotion: int, fps: float) -> NDArray[Any]:
        """Frames [T, C] at `fps` with what moves beside the lips in a speech and an emotion.

        Other recordings stand in where there are none in the emotion.
        """
        components, basis = self.components(speech, emotion, fps, len(frames)), self.basis.astype(np.float64)
        parts = Growing(frames.dtype)
        for rows in row_blocks(frames):
            parts.add(frames[rows] + (self.share * (components[rows] @ basis)).astype(frames.dtype))
        return parts.whole()

    def track(self, speech: Speech, emotion: int, fps: float, count: int) -> Floats:
        """[count, C] what `added` adds."""
        return self.added(np.zeros((count, self.basis.shape[1])), speech, emotion, fps)

    def components(self, speech: Speech, emotion: int, fps: float, count: int) -> Floats:
        """[count, R] at `fps`."""
        own = max(2, int(np.ceil(count / fps * self.fps)) + 2)
        chosen = self._chosen(loudness(speech, self.fps, own), emotion, own)
        return cubic_at(chosen, np.arange(count, dtype=np.float64) * (self.fps / fps))

    def _chosen(self, wanted: Floats, emotion: int, count: int) -> Floats:
        """[count, R] stretches whose loudness is like the wanted one [count], each faded into the next."""
        fade, out = max(2, round(FADE_S * self.fps)), np.zeros((0, self.frames.shape[1]))
        size = max(float(self.frames.std()), 1e-9)
        usable = self._usable(emotion)
        longest = max(b - a for a, b in usable)
        fade = min(fade, longest // 2)
        while len(out) < count:
            done = max(0, len(out) - fade)
            length = min(max(round(CHUNK_S * self.fps), 2 * fade), count - done, longest)
            begins = np.concatenate([np.arange(a, b - length + 1) for a, b in usable])
            cost = _distances(self.loudness, begins, wanted[done : done + length])
            if done:
                held = out[done:]
                cost += (
                    MEETING * np.mean((self.frames[begins[:, None] + np.arange(len(held))] - held) ** 2, axis=(1, 2)) / size**2
                )
            piece = self.frames[begins[int(cost.argmin())] :][:length].astype(np.float64)
            out = _faded(out[:done], out[done:], piece)
        return out[:count]

    def _usable(self, emotion: int) -> list[tuple[int, int]]:
        """First and last frames of recordings in an emotion that can be faded, of all where there are none; at least one."""
        spans = list(zip(self.bounds[:-1].tolist(), self.bounds[1:].tolist(), strict=True))
        fitting = [span for span, own in zip(spans, self.emotions.tolist(), strict=True) if own == emotion]
        least = 2 * max(2, round(FADE_S * self.fps)) + 1
        long = [[(a, b) for a, b in some if b - a >= least] for some in (fitting, spans)]
        return long[0] or long[1] or [max(spans, key=lambda span: span[1] - span[0])]


def _distances(loudness: NDArray[np.floating[Any]], begins: NDArray[np.int64], wanted: Floats) -> Floats:
    """[n] mean squared distance of stretches that begin at `begins` from what is wanted [L]."""
    return np.asarray(((loudness[begins[:, None] + np.arange(len(wanted))] - wanted) ** 2).mean(axis=1), np.float64)


def _faded(before: Floats, held: Floats, piece: Floats) -> Floats:
    """What came before, then the frames `held` fading into the first ones of a piece, then the rest of it."""
    count = min(len(held), len(piece))
    share = (np.arange(count) + 1)[:, None] / (count + 1)
    return np.concatenate([before, held[:count] * (1 - share) + piece[:count] * share, piece[count:]])


def main_emotion(speech: Speech, emotions: tuple[str, ...]) -> int:
    """Number of the emotion that lasts longest."""
    lasting = np.diff(speech.emotions.ends_s, prepend=0.0)
    totals = [sum(s for label, s in zip(speech.emotions.labels, lasting, strict=True) if label == one) for one in emotions]
    return int(np.argmax(totals))


def exported_residual(folder: Folder, arrays: Mapping[str, NDArray[Any]]) -> ResidualMotion | None:
    """Of a folder, whose settings state the share; None where that is 0."""
    share = float(folder.settings["residual"])
    if share == 0:
        return None
    frames, basis, level, bounds, emotions = (arrays[f"residual_{name}"] for name in ARRAYS)
    frames = frames.astype(np.float32, copy=False) * arrays.get("residual_frames_scale", np.float32(1))
    return ResidualMotion(frames, basis, level, bounds, emotions, float(folder.manifest["fps"]), share)
