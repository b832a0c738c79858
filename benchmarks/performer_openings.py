"""The built-in performer's mouth beside people's, saying what they said: python benchmarks/performer_openings.py CORPUS …

CORPUS shows a talker's lips, such as GRID s1. Every recording's phones and sound drive the performer's articulation, and the
openings of both mouths are compared from the first to the last phone: deviation, speed (median and 99th percentile), deviation
of the width of the mouth, and the mean correlation. At most forty recordings of each.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.lips import lip_opening
from facesynth.face.rig.arkit_rig import Rig, load_head, pose_points
from facesynth.face.rig.markers import LipGap, marker_layout, marker_vertices
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.performer.performance import perform

MOST = 40
CORNERS = {"markers": ("mouth_corner_l", "mouth_corner_r"), "tracked": ("p291", "p061")}
Mouth = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Opening and width over time, mm."""


@dataclass(frozen=True)
class Moves:
    """What a mouth does while it speaks."""

    opening_mm: float
    width_mm: float
    speed: float
    fastest: float

    @classmethod
    def of(cls, opening: NDArray[np.float64], width: NDArray[np.float64], fps: float) -> "Moves":
        speed = np.abs(np.diff(opening)) * fps
        return cls(opening.std(), width.std(), *np.percentile(speed, [50, 99]))


def main(paths: list[Path]) -> None:
    rig = load_head()
    print("| talker | opening, mm | speed, mm/s | fastest 1 % | width, mm | correlation |\n|---|---:|---:|---:|---:|---:|")
    for path in paths:
        corpus = Corpus.open(path)
        said = [corpus[name] for name in corpus.ids[:: max(1, len(corpus.ids) // MOST)][:MOST]]
        whole = [u for u in said if np.isfinite(u.motion.frames).all()]
        print(row(corpus.performer, [compared(u, rig) for u in whole]), flush=True)


def row(name: str, pairs: list[tuple[Moves, Moves, float]]) -> str:
    """Recorded / the performer's, means over recordings."""
    cells = []
    for field in ("opening_mm", "speed", "fastest", "width_mm"):
        theirs, ours = (np.mean([getattr(pair[side], field) for pair in pairs]) for side in (0, 1))
        cells.append(f"{theirs:.1f} / {ours:.1f}")
    return f"| {name} | {' | '.join(cells)} | {np.mean([pair[2] for pair in pairs]):.2f} |"


def compared(utterance: Utterance, rig: Rig) -> tuple[Moves, Moves, float]:
    fps, bounds = utterance.motion.fps, utterance.speech.phones.frame_bounds(utterance.motion.fps)
    spoken = [k for k, label in enumerate(utterance.speech.phones.labels) if label != SILENCE]
    part = slice(bounds[spoken[0]], min(bounds[spoken[-1] + 1], len(utterance.motion)))
    theirs, ours = recorded(utterance), performed(utterance.speech, fps, rig)
    correlation = np.corrcoef(theirs[0][part], ours[0][part])[0, 1]
    return Moves.of(*(one[part] for one in theirs), fps), Moves.of(*(one[part] for one in ours), fps), float(correlation)


def recorded(utterance: Utterance) -> Mouth:
    names = list(utterance.motion.layout.names)
    left, right = next(pair for pair in CORNERS.values() if pair[0] in names)
    points = utterance.motion.points
    return lip_opening(utterance.motion), np.linalg.norm(points[:, names.index(left)] - points[:, names.index(right)], axis=1)


def performed(speech: Speech, fps: float, rig: Rig) -> Mouth:
    lips, layout = LipGap.of(rig), marker_layout(rig)
    calm = Speech(speech.audio, speech.sample_rate, speech.phones, EmotionTrack.constant("neutral", speech.duration_s))
    weights = perform(calm, lips, pitch_hz=np.zeros(1), fps=fps, seed=0).weights
    corners = marker_vertices(rig, layout)[[layout.names.index(name) for name in CORNERS["markers"]]]
    points = pose_points(rig, corners, weights, np.zeros((len(weights), 6)))
    return lips.opening_mm(weights), np.linalg.norm(points[:, 0] - points[:, 1], axis=1)


if __name__ == "__main__":
    main([Path(path) for path in sys.argv[1:]])
