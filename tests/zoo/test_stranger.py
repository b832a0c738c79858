"""The default model, driven by a talker it never heard: his lips as another program followed them in the video."""

import numpy as np

from facesynth.inference.lips import lip_gap
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.speech.audio import load_audio
from facesynth.speech.phone_sources import find_phones
from facesynth.zoo.shelf import load

CLIPS, FPS = 3, 25.0
LIPS = ((82, 87), (13, 14), (312, 317))
"""Landmarks of the inner lips, upper and lower."""


def recorded_opening(path):
    with np.load(path) as kept:
        height = kept["landmarks"][:, :, 1]
    return np.mean([height[:, below] - height[:, above] for above, below in LIPS], axis=0)


def test_its_lips_follow_a_strangers_with_nothing_known_and_shut_at_every_p_b_and_m(recordings):
    model, followed = load(), []
    shut = model.model.closed_gap
    for path in sorted(recordings("grid_s26").glob("*.mpg"))[:CLIPS]:
        sound, rate = load_audio(path)
        phones = find_phones(sound, rate).phones
        motion = model.synthesize(Speech(sound, rate, phones, EmotionTrack.constant("neutral", phones.duration_s)))
        own, made = recorded_opening(path.with_name(f"{path.stem}_mediapipe.npz")), lip_gap(motion)
        bounds = phones.frame_bounds(FPS)
        said = slice(bounds[1], min(bounds[-2], len(own), len(made)))
        followed.append(np.corrcoef(own[said], made[said])[0, 1])
        closed = [
            made[a:b].min()
            for label, a, b in zip(phones.labels, bounds[:-1], bounds[1:], strict=True)
            if label in ("p", "b", "m") and b > a
        ]
        assert max(closed, default=shut) <= shut + 0.01
    assert np.mean(followed) > 0.7
    assert (motion.fps, len(motion.layout.names)) == (FPS, 468)
