"""What the runtime says to sound, numbers and names that it cannot take."""

import numpy as np
import pytest

from facesynth.inference import FacesynthError, Speech, load

HEARS = {
    "lds": lambda models, audio: models["lds"].stream().push(audio),
    "lds state": lambda models, audio: models["lds"].advance(models["lds"].start(), audio),
    "emotion": lambda models, audio: models["emotion"].stream().push(audio),
    "anime_graph": lambda models, audio: models["anime_graph"].stream(look_ahead=2).hear(audio),
    "detect": lambda models, audio: models["emotion"].detect(audio, 16000),
    "detect_track": lambda models, audio: models["emotion"].detect_track(audio, 16000),
    "speech": lambda _, audio: Speech(audio, 16000, None, None),
}


@pytest.fixture(scope="module")
def models(lds_file, emotion_file, anime_file, exported):
    return {path.stem: load(exported(path)) for path in (lds_file, emotion_file, anime_file)}


@pytest.mark.parametrize("where", HEARS)
@pytest.mark.parametrize(
    ("audio", "message"),
    [
        (np.zeros((16000, 2), np.float32), r"shape \[16000, 2\]; wanted mono"),
        (np.full(40000, np.nan, np.float32), "NaN or infinite"),
        (np.full(40000, np.inf), "NaN or infinite"),
        (np.ones(40000, np.int16), "audio is int16; wanted floats in -1..1"),
        ("sound.wav", "wanted mono"),
    ],
)
def test_no_wrong_sound_is_heard(models, where, audio, message):
    with pytest.raises(FacesynthError, match=message):
        HEARS[where](models, audio)


@pytest.mark.parametrize("name", ["lds", "emotion"])
def test_an_empty_piece_is_none(models, name):
    assert len(models[name].stream().push(np.zeros(0, np.float32))) == 0


@pytest.mark.parametrize("name", ["lds", "emotion"])
def test_nothing_comes_after_the_end(models, name, speeches):
    stream = models[name].stream()
    stream.push(speeches[0].audio)
    stream.finish()
    for call in (lambda: stream.push(speeches[0].audio), stream.finish):
        with pytest.raises(FacesynthError, match="the stream was finished"):
            call()


@pytest.mark.parametrize("rate", [0, -1, 16000.5, float("nan"), float("inf"), None, "16000"])
def test_no_wrong_rate_is_taken(models, speeches, rate):
    for call in (models["emotion"].detect, models["emotion"].detect_track):
        with pytest.raises(FacesynthError, match="wanted a whole, positive number"):
            call(speeches[0].audio, rate)


@pytest.mark.parametrize("seed", [-1, 0.5, "one"])
def test_no_wrong_seed_is_taken(models, speeches, seed):
    with pytest.raises(FacesynthError, match="seed is .*; wanted a whole number"):
        models["lds"].synthesize(speeches[0], seed=seed)
    with pytest.raises(FacesynthError, match="seed is .*; wanted a whole number"):
        models["lds"].stream(seed=seed)


def test_no_surplus_input_is_taken(models):
    with pytest.raises(FacesynthError, match="the graph innovations knows the options uniform; got bogus"):
        models["lds"].innovations(uniform=np.zeros((1, 2, 4), np.float32), bogus=np.zeros(3))
