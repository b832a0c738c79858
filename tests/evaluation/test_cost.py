import time

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.evaluation.cost import peak_mb, peak_speaking_mb, stopwatch
from facesynth.methods.baselines.mean_face import MeanFace


def test_sleeping_takes_time_by_the_clock_and_none_of_the_processor():
    with stopwatch() as slept:
        time.sleep(0.2)
    with stopwatch() as worked:
        np.linalg.svd(np.ones((400, 400)))
    assert slept.clock_s >= 0.2 > 4 * slept.processor_s
    assert worked.processor_s > 0


def test_memory_is_that_of_a_process_of_its_own(tmp_path):
    if peak_mb() is None:
        pytest.skip("this system does not tell a process its peak memory")
    corpus = tiny_corpus(tmp_path / "corpus", utterances=2, fps=30)
    MeanFace().fit(corpus).save(tmp_path / "m.safetensors")
    ballast = np.ones(900_000_000 // 8)  # what other methods hold does not count
    alone = peak_speaking_mb(tmp_path / "m.safetensors", corpus.path, corpus.ids[0], 0, {})
    assert 50 < alone < peak_mb()
    assert ballast[0] == 1
    (tmp_path / "m.safetensors").write_bytes(b"")
    assert peak_speaking_mb(tmp_path / "m.safetensors", corpus.path, corpus.ids[0], 0, {}) is None
