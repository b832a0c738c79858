"""A talker whose head goes down when the voice is loud and to the left when it is high: head motion whose answer is known."""

from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from facesynth.corpus import Corpus
from facesynth.corpus.record import Record
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

RATE = 16000
LAYOUT = Layout("curves", ("jawOpen",))


def nodding(
    number: int, fps: float = 60.0, seconds: float = 2.0, *, head: bool = True, speed: bool = False
) -> tuple[Speech, Motion]:
    """Syllables of 0.25 s: a buzz whose loudness and pitch are drawn anew, and the head whose place goes with them.

    speed: its speed goes with them instead.
    """
    rng = np.random.default_rng(number)
    count = round(seconds / 0.25)
    loud, high = rng.uniform(0.2, 1.0, count), rng.uniform(0.0, 1.0, count)
    at = np.minimum((np.arange(round(seconds * RATE)) / RATE / 0.25).astype(int), count - 1)
    level, pitch = (gaussian_filter1d(track[at], 0.03 * RATE, mode="nearest") for track in (loud, high))
    phase = 2 * np.pi * np.cumsum(110 * 2**pitch) / RATE
    sound = 0.05 * level * sum(np.sin(k * phase) / k for k in range(1, 9)) + 1e-4 * rng.standard_normal(len(at))
    frames = np.round(np.arange(round(seconds * fps)) / fps * RATE).astype(int)
    pose = np.zeros((len(frames), 6), np.float32)
    pose[:, 0], pose[:, 1], pose[:, 4] = 0.15 * level[frames], 0.2 * pitch[frames], -4 * level[frames]
    if speed:
        pose = np.cumsum(pose - (0.15 * 0.6, 0.2 * 0.5, 0, 0, -4 * 0.6, 0), axis=0, dtype=np.float32) * np.float32(4 / fps)
    track = PhoneTrack(("pau", "aa"), np.array([0.1, seconds]))
    speech = Speech(sound.astype(np.float32), RATE, track, EmotionTrack.constant("neutral", seconds))
    opening = np.clip(level[frames], 0, 1)[:, None].astype(np.float32)
    return speech, Motion(opening, fps, LAYOUT, pose if head else None)


def nodding_corpus(
    path: str | Path, recordings: int = 8, fps: float = 60.0, *, heads: int | None = None, speed: bool = False
) -> Corpus:
    """Recordings of it; only the first `heads` have a head, where that is given."""
    corpus = Corpus.create(
        path,
        performer="Nod",
        layout=LAYOUT,
        fps=fps,
        emotions=("neutral",),
        synthetic=True,
        licence="CC0-1.0",
        consent="none needed",
    )
    for number in range(recordings):
        speech, motion = nodding(number, fps, head=heads is None or number < heads, speed=speed)
        corpus.add_utterance(Record(f"n{number:02d}", "", f"n{number:02d}", "neutral"), speech, motion)
    return corpus
