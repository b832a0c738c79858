import json
from dataclasses import replace

import numpy as np
import pytest
from corpora import EMOTIONS, tiny_corpus, tiny_layout, tiny_utterances

from facesynth.corpus import Corpus
from facesynth.corpus.stats import stats


def test_counts_are_those_of_the_utterances(tmp_path):
    corpus = tiny_corpus(tmp_path / "tiny")
    counted = stats(corpus)
    plan = tiny_utterances()
    assert (counted.utterances, counted.usable, counted.sentences, counted.second_takes) == (12, 12, 5, 2)
    assert counted.emotions == {name: sum(r.emotion == name for r, *_ in plan) for name in EMOTIONS}
    assert counted.minutes == pytest.approx(sum(s.duration_s for _, s, _ in plan) / 60, abs=1e-3)
    labels = [label for _, speech, _ in plan for label in speech.phones.labels]
    assert counted.phones["m"] == labels.count("m")
    assert "pau" not in counted.phones
    assert "zh" in counted.absent_phones
    pairs = {pair for _, s, _ in plan for pair in zip(s.phones.labels, s.phones.labels[1:], strict=False)}
    assert counted.diphones == len(pairs)
    assert (counted.filled_samples, counted.missing_samples, counted.long_gaps) == (0, 0, 0)
    assert json.loads(json.dumps(counted.to_dict()))["performer"] == "Tiny"
    assert "Tiny (synthetic): 12 usable of 12 utterances" in counted.text()


def test_gaps_and_unusable_utterances_are_counted(tmp_path):
    corpus = Corpus.create(tmp_path / "c", performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS)
    for record, speech, motion in tiny_utterances(2):
        frames = motion.frames.copy()
        frames[20:30, :3] = frames[50:80, 3:9] = np.nan
        corpus.add_utterance(replace(record, usable=record.emotion == "happy"), speech, replace(motion, frames=frames))
    counted = stats(corpus)
    assert (counted.utterances, counted.usable) == (2, 1)
    assert (counted.filled_samples, counted.missing_samples, counted.long_gaps) == (10, 60, 2)


def test_an_empty_corpus_counts_nothing(tmp_path):
    counted = stats(Corpus.create(tmp_path / "c", performer="A", layout=tiny_layout(), fps=120, emotions=EMOTIONS))
    assert (counted.minutes, counted.diphones_per_minute) == (0, 0)
    assert "0 usable of 0" in counted.text()
