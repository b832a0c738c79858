import numpy as np
import pytest

from facesynth.corpus import Corpus, Record
from facesynth.evaluation.papers.lds_crossvalidation import Errors, cross_validate, table
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

QUICK = {
    "hears": "periodogram",
    "features": 2,
    "components": 2,
    "rows": 4,
    "lead_ms": 0,
    "deterministic_order": 2,
    "stochastic_order": 2,
}


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """Curves that follow the loudness of their sound, with slow noise: 10 clips of 4 s."""
    rng = np.random.default_rng(0)
    layout = Layout("curves", ("jaw", "smile", "brow"))
    path = tmp_path_factory.mktemp("driven") / "corpus"
    corpus = Corpus.create(path, performer="Driven", layout=layout, fps=30, emotions=("neutral",), synthetic=True)
    for i in range(10):
        loudness = np.repeat(rng.uniform(0.0, 1.0, 40), 3)
        audio = rng.normal(size=120 * 533) * 0.1 * np.repeat(loudness, 533)
        jaw = np.convolve(loudness, 0.6 * 0.4 ** np.arange(10))[:120]
        slow = np.convolve(rng.laplace(size=140), 0.8 ** np.arange(20), mode="valid")[:120]
        frames = 0.3 + np.outer(jaw, [0.5, 0.2, 0]) + 0.02 * np.outer(slow, [0.2, 1, 0])
        track = EmotionTrack.constant("neutral", 4.0)
        speech = Speech(audio.astype(np.float32), 533 * 30, PhoneTrack(("pau",), np.array([4.0])), track)
        corpus.add_utterance(Record(f"c{i}", sentence=f"c{i}"), speech, Motion(frames.astype(np.float32), 30, layout))
    return corpus


@pytest.fixture(scope="module")
def errors(driven):
    return cross_validate(driven, {"LDS": {**QUICK, "context_ms": 0}}, folds=2)


def test_every_row_is_judged_on_every_utterance(driven, errors):
    wanted = {
        "mean shape",
        "ridge, log-mel",
        "LDS",
        "LDS, one sample",
        "LDS, mean of 10",
        "LDS, best of 10",
        "ridge, features of LDS",
    }
    assert set(errors.whole) == set(errors.centred) == wanted
    assert all(len(values) == len(driven) for values in [*errors.whole.values(), *errors.centred.values()])
    assert len(errors.chosen["LDS"]) == 2


def test_what_sound_drives_is_found_again(errors):
    rows = errors.rows()
    assert rows["LDS"][0] < 0.7 * rows["mean shape"][0]
    assert rows["LDS"][0] < rows["ridge, features of LDS"][0]
    assert errors.better("LDS", "mean shape") == 1
    assert rows["LDS, best of 10"][0] < rows["LDS, one sample"][0]
    assert rows["LDS, mean of 10"][0] < rows["LDS, one sample"][0]
    assert min(errors.diversity["LDS"]) > 0


def test_one_step_ahead_beats_no_change(errors):
    assert np.mean(errors.ahead["LDS"]) < 0.8 * np.mean(errors.still["LDS"])


def test_the_table_holds_every_figure(errors):
    text = table(errors, "weight")
    assert "| | RMS error, weight | clip means removed |" in text
    for row in errors.whole:
        assert f"| {row} | " in text
    for word in ("diversity", "one step ahead", "no change", "kurtosis", "lead 0 ms, states 2 + 2"):
        assert word in text


def test_errors_are_what_they_are_called():
    errors = Errors()
    truth = np.array([[0.0, 0.0], [2.0, np.nan]])
    errors.add("row", np.array([[1.0, 0.0], [3.0, 5.0]]), truth)
    whole, centred = errors.rows()["row"]
    assert whole == pytest.approx(np.sqrt(2 / 3))
    assert centred == pytest.approx(0)
