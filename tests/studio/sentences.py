"""A line to work on, and a project with it."""

import numpy as np

from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.studio.document import first_take, take_facts
from facesynth.studio.project import Project

RATE = 16000
LABELS = ("pau", "hh", "ah", "l", "ow", "pau")
ENDS_S = (0.2, 0.28, 0.4, 0.47, 0.7, 1.0)
CONFIDENCES = (1.0, 0.9, 0.4, 0.99, 0.55, 1.0)


def sound():
    return (0.1 * np.sin(2 * np.pi * 140 * np.arange(RATE) / RATE)).astype(np.float32)


def facts():
    phones = PhoneTrack(LABELS, np.array(ENDS_S), np.array(CONFIDENCES))
    take = first_take(phones, [("hello", 0.2, 0.7)], EmotionTrack.constant("neutral", 1.0))
    return {"name": "hello", "text": "hello", "take": take_facts(take), "utterance": ""}


def project_with_line(folder):
    project = Project.open(folder)
    project.keep_sound("hello", sound(), RATE)
    project.change("add_line", facts())
    return project
