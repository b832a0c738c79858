"""Whether sound and motion of recordings belong to the same moments: the mouth's opening against what is heard.

Twice, because neither alone sees everything. The loudness against the opening, over all recordings, shows a shift that all of
them share. A regression from sound to opening, learned from the corpus itself, is sharper, and shows single recordings that
are shifted against the others (or whose sound is another one's) but is blind to what they share.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.checks.problem import Problem
from facesynth.corpus.files import Files
from facesynth.corpus.header import Header
from facesynth.corpus.record import Record
from facesynth.corpus.signals import read_motion
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion
from facesynth.progress import track
from facesynth.speech.audio import load_audio
from facesynth.speech.audio import resample as resample_audio

RATE = 50
"""Everything is compared at so many values a second."""
LAGS = np.arange(-25, 26)
"""Shifts that are tried: half a second each way."""
BANDS = 12
CONTEXT = 10
"""Frames of sound before and after that the regression sees: 0.2 s."""
RIDGE = 0.1
"""Share of the features' variance."""
MOST_RECORDINGS = 400
"""Recordings that are looked at, evenly chosen."""
FEWEST_RECORDINGS = 8
"""With fewer recordings a regression says nothing."""
SHARED_S = 0.08
"""A shift that all share is told from here on."""
LONE_S = 0.1
CLEAR = 0.15
"""By so much must the correlation rise when the recording is shifted."""
CLEAR_ALONE = 0.35
"""By so much where there is one recording, half of it for two and so on. GRID talkers in their right place: 0.17 and 0.29 at the
95th percentile of single clips, 0.09 and 0.14 of two, 0.03 of five; shifted by 400 ms: 0.2 to 0.45 in the median."""
KNOWN = 0.5
"""A shifted recording must then be recognised so well (correlation)."""
SHORTEST_S = 1.0
JAWS = ("jawopen", "mouthopen", "jawdown", "mouthstretch")


@dataclass(frozen=True, eq=False)
class Pair:
    """A recording's sound and mouth on one clock of `RATE`."""

    id: str
    heard: Floats
    """[T, BANDS] logarithms of the energy in mel bands."""
    opening: Floats
    """[T] of the mouth, in any unit."""


def sync_problems(files: Files, header: Header, records: Iterable[Record]) -> Iterator[Problem]:
    """Recordings whose sound and motion do not belong together as they lie; those that cannot be read are passed over."""
    usable = [record for record in records if record.usable]
    count = min(len(usable), MOST_RECORDINGS)
    chosen = [usable[i * len(usable) // count] for i in range(count)]
    pairs = [pair for record in track(chosen, "comparing sound and motion") if (pair := _pair(files, header, record)) is not None]
    if not pairs:
        return
    curve = np.mean([correlations(np.log(np.exp(pair.heard).sum(axis=1)), pair.opening) for pair in pairs], axis=0)
    shift_s = float(LAGS[curve.argmax()]) / RATE
    clear = curve.max() - curve[len(LAGS) // 2] >= max(CLEAR / 3, CLEAR_ALONE / len(pairs))
    peaks = len(pairs) >= FEWEST_RECORDINGS or (_shows_opening(header.layout) and 0 < curve.argmax() < len(LAGS) - 1)
    shifted = abs(shift_s) >= SHARED_S and clear and peaks
    if shifted:
        whose = "in all recordings the mouth" if len(pairs) > 1 else "the mouth"
        yield Problem("audio", _shift_text(whose, shift_s), _remedy("every sound" if len(pairs) > 1 else "the sound", shift_s))
    if len(pairs) < FEWEST_RECORDINGS:
        unseen = "one whose sound is shifted" if shifted or abs(shift_s) < SHARED_S else "shifted sound"
        these = f"{len(pairs)} recordings are" if len(pairs) > 1 else "1 recording is"
        what = f"{these} too few to find {unseen}; at {FEWEST_RECORDINGS} it is looked for"
        yield Problem("audio", what, "record more, or look at the pictures of `facesynth corpus stats --pictures`", grave=False)
        return
    for pair, shift_s in lone_shifts(pairs):
        yield Problem(f"audio/{pair.id}.wav", _shift_text("the mouth", shift_s), _remedy("the sound", shift_s), grave=False)


def lone_shifts(pairs: list[Pair]) -> Iterator[tuple[Pair, float]]:
    """Recordings that are shifted against the others, and by how much the mouth is late (s)."""
    seen = [_context(pair.heard) for pair in pairs]
    openings = [pair.opening - pair.opening.mean() for pair in pairs]
    middle = np.mean([features.mean(axis=0) for features in seen], axis=0)
    gram = np.sum([(features - middle).T @ (features - middle) for features in seen], axis=0)
    moment = np.sum([(features - middle).T @ opening for features, opening in zip(seen, openings, strict=True)], axis=0)
    gram = gram + RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram))
    for pair, features, opening in zip(pairs, seen, openings, strict=True):
        own = features - middle
        left_out = np.linalg.solve(gram - own.T @ own, moment - own.T @ opening)
        curve = correlations(own @ left_out, opening)
        shift_s = float(LAGS[curve.argmax()]) / RATE
        if abs(shift_s) >= LONE_S and curve.max() >= KNOWN and curve.max() - curve[len(LAGS) // 2] >= CLEAR:
            yield pair, shift_s


def correlations(heard: Floats, opening: Floats) -> Floats:
    """Correlation of two signals [T] for each of `LAGS`: positive ones where the opening comes later."""
    count = len(heard)
    found = []
    for lag in LAGS.tolist():
        a, b = heard[max(-lag, 0) : count - max(lag, 0)], opening[max(lag, 0) : count - max(-lag, 0)]
        spread = a.std() * b.std()
        found.append(float(((a - a.mean()) * (b - b.mean())).mean() / spread) if spread > 1e-12 else 0.0)
    return np.array(found)


def mouth_opening(motion: Motion) -> Floats:
    """[T] how far the mouth is open, in any unit: by lip pairs, the lower lip, a curve of the jaw, or any movement."""
    layout = motion.layout
    if layout.lip_pairs and layout.dimension > 1:
        return lip_gap(motion).astype(np.float64)
    if layout.dimension > 1 and ("lower_lip" in layout.groups or "jaw" in layout.groups):
        group = layout.group("lower_lip" if "lower_lip" in layout.groups else "jaw")
        return -motion.points[:, group, 1].mean(axis=1).astype(np.float64)
    jaws = _jaws(layout)
    if jaws:
        return motion.frames[:, jaws].mean(axis=1).astype(np.float64)
    columns = layout.columns("mouth") if "mouth" in layout.groups else np.arange(layout.channels)
    return np.linalg.norm(motion.frames[:, columns] - np.nanmedian(motion.frames[:, columns], axis=0), axis=1).astype(np.float64)


def _shows_opening(layout: Layout) -> bool:
    """Whether `mouth_opening` is more than any movement, which rises when a mouth opens and when it shuts."""
    if layout.dimension == 1:
        return bool(_jaws(layout))
    return bool(layout.lip_pairs) or "lower_lip" in layout.groups or "jaw" in layout.groups


def _jaws(layout: Layout) -> list[int]:
    """Curves that tell how far the mouth is open."""
    if layout.dimension > 1:
        return []
    folded = ["".join(letter for letter in name.lower() if letter.isalnum()) for name in layout.names]
    return [column for column, name in enumerate(folded) if any(jaw in name for jaw in JAWS)]


def _pair(files: Files, header: Header, record: Record) -> Pair | None:
    try:
        motion = read_motion(files.motion(record.id), header)
        audio, rate = load_audio(files.audio(record.id))
    except FacesynthError:
        return None
    opening = mouth_opening(motion)
    known = np.flatnonzero(np.isfinite(opening))
    count = int(min(motion.duration_s, len(audio) / rate) * RATE)
    if len(known) < 2 or count < SHORTEST_S * RATE:
        return None
    heard = _heard(audio, rate)[:count]
    at = np.arange(len(heard)) / RATE * motion.fps
    return Pair(record.id, heard, np.interp(at, known, opening[known]))


def _heard(audio: NDArray[np.float32], rate: int) -> Floats:
    import torch

    from facesynth.speech.mel import LogMel

    sound = torch.from_numpy(resample_audio(audio, rate, 16000))
    with torch.no_grad():
        return LogMel(BANDS, 16000, 0.04, 1 / RATE)(sound).numpy().astype(np.float64)


def _context(heard: Floats) -> Floats:
    padded = np.pad(heard, ((CONTEXT, CONTEXT), (0, 0)), mode="edge")
    steps = range(0, 2 * CONTEXT + 1, 2)
    return np.concatenate([padded[step : step + len(heard)] for step in steps] + [np.ones((len(heard), 1))], axis=1)


def _shift_text(what: str, shift_s: float) -> str:
    return f"{what} moves {abs(shift_s) * 1000:.0f} ms {'after' if shift_s > 0 else 'before'} the sound"


def _remedy(what: str, shift_s: float) -> str:
    way = "delay" if shift_s > 0 else "cut the beginning of"
    return f"{way} {what} by {abs(shift_s) * 1000:.0f} ms and add it again; or is it the sound of another take?"
