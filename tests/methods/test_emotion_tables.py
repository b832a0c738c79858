import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.detector import Clip, DetectorSettings
from facesynth.methods.emotion.tables import COEFFICIENTS, Recognition, recognise, table_one

SETTINGS = DetectorSettings(features="paper")


def clips_of(count=24):
    rng = np.random.default_rng(0)
    return [
        Clip(rng.normal(size=2100).astype(np.float32) * (0.1 + 0.2 * (k % 2)), 16000, "ab"[k % 2], f"p{k % 3}", f"s{k % 4}")
        for k in range(count)
    ]


def features_of(clips):
    rng = np.random.default_rng(1)
    return np.array([[c.emotion == "a", 0] for c in clips], float) + 0.2 * rng.normal(size=(len(clips), 2))


@pytest.mark.parametrize("split", ["train = test", "random halves", "by sentence", "by speaker"])
def test_every_split_tests_what_it_says(split):
    clips = clips_of()
    result = recognise(clips, SETTINGS, split, x=features_of(clips))
    assert result.confusion.sum() == (12 if split == "random halves" else 24)
    assert result.accuracy > 0.8


def test_what_is_learned_by_heart_shows_only_when_sentences_are_split():
    clips = [Clip(np.zeros(1, np.float32), 16000, "ab"[k // 2 % 2], "p", f"s{k // 2}") for k in range(24)]
    x = np.eye(12)[np.arange(24) // 2] + 0.01 * np.random.default_rng(0).normal(size=(24, 12))
    assert recognise(clips, SETTINGS, "train = test", x=x).accuracy == 1
    assert recognise(clips, SETTINGS, "by sentence", x=x).accuracy < 0.8


def test_unweighted_recall_counts_every_emotion_once():
    result = Recognition("by speaker", SETTINGS, ("a", "b", "c"), np.array([[90, 10, 0], [5, 5, 0], [0, 0, 0]]))
    assert result.unweighted_recall == pytest.approx(0.7)
    assert result.accuracy == pytest.approx(95 / 110)


def test_table_one_has_the_papers_form():
    rows = table_one(clips_of(), ("train = test", "by sentence"))
    assert [(r.split, r.settings.kernel, r.settings.coefficients) for r in rows[:4]] == [
        ("train = test", "linear", count) for count in COEFFICIENTS
    ]
    assert len(rows) == 16
    assert rows[3].accuracy == 1


def test_one_speaker_cannot_be_left_out():
    clips = [c for c in clips_of() if c.speaker == "p0"]
    with pytest.raises(FacesynthError, match="by speaker needs at least two"):
        recognise(clips, SETTINGS, "by speaker", x=features_of(clips))
