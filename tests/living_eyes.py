"""Eyes whose blinks, shifts and way with the head are known, and models of them."""

import numpy as np
from corpora import tiny_layout

from facesynth.corpus import Corpus
from facesynth.inference.eyes import at_rest
from facesynth.inference.motion import Motion
from facesynth.methods.eyes.method import Eyes

FPS = 60.0


def recording(seconds=40.0, gain=0.7, shut=0.0, seed=0, fps=FPS, every_s=2.0):
    """Eyes that blink every 2 s, look elsewhere twice as often and undo a share of a quick sway of the head."""
    rng, count = np.random.default_rng(seed), round(seconds * fps)
    head = np.zeros((count, 6))
    head[:, 0], head[:, 1] = (0.05 * np.sin(2 * np.pi * hz * np.arange(count) / fps) for hz in (1.3, 0.9))
    hold = round(every_s / 2 * fps)
    gaze = np.repeat(rng.normal(0, 0.1, (count // hold + 1, 2)), hold, axis=0)[:count]
    since = np.arange(count) % round(every_s * fps)
    opening = np.where(since < 8, shut, 1.0)
    eyes = np.column_stack([opening, gaze + gain * np.column_stack([-head[:, 1], head[:, 0]])])
    return Motion(at_rest(tiny_layout(), count, fps).frames, fps, tiny_layout(), head, eyes)


def learnt(*motions, **config):
    model = Eyes(**config)
    model.layout, model.emotions = tiny_layout(), ("neutral",)
    model.learn(motions, "the test")
    return model.eval()


def with_eyes(corpus, opening=None):
    """The corpus with eyes in every recording."""
    for number, record in enumerate(corpus.records):
        path = corpus.files.motion(record.id)
        arrays = dict(np.load(path))
        own = recording(len(arrays["frames"]) / corpus.fps, seed=number, fps=corpus.fps, every_s=0.5)
        eyes = own.eyes[: len(arrays["frames"])].copy()
        eyes[:, 0] = eyes[:, 0] if opening is None else opening
        np.savez(path, **(arrays | {"eyes": eyes, "head": own.head[: len(eyes)]}))
    return Corpus.open(corpus.path)
