"""The config that a method keeps, and what it may learn before it is trained."""

import copy

import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.methods.baselines.ridge import Ridge
from facesynth.methods.baselines.tcn import Tcn
from facesynth.methods.method import Method, Prepared
from facesynth.methods.training import train


class Guess(Method):
    """Learns its number before it is fitted."""

    name = "guess"

    def __init__(self, number: int = 1, sure: bool = False) -> None:
        super().__init__()

    @classmethod
    def prepared(cls, config, corpus, seed):
        return Prepared({**config, "number": len(corpus) + seed}, {"tried": 2})

    def fit(self, corpus, *, seed=0):
        self.fitted_with = dict(self.config)
        return self


def test_the_config_is_the_constructors_arguments_with_their_defaults():
    assert Guess().config == {"number": 1, "sure": False}
    assert Guess(3).config == {"number": 3, "sure": False}
    assert Tcn(steps=5).config == {"components": 25, "steps": 5, "features": "both"}
    assert copy.deepcopy(Ridge(components=4)).config == {"components": 4, "features": "both"}
    with pytest.raises(TypeError, match="numbr"):
        Guess(numbr=3)


def test_what_is_learned_before_is_what_it_is_fitted_with_and_is_remembered():
    model = train(Guess, [1, 2, 3], {"sure": True}, seed=4)
    assert model.fitted_with == model.config == {"number": 7, "sure": True}
    assert model.facts == {"learned": {"tried": 2}}


def test_a_config_is_refused_before_anything_is_learned(monkeypatch):
    monkeypatch.setattr(Guess, "prepared", lambda *_: pytest.fail("it was learned from"))
    with pytest.raises(FacesynthError, match="did you mean number"):
        train(Guess, [], {"numbr": 3})
    with pytest.raises(FacesynthError, match="must be a int"):
        train(Guess, [], {"number": "many"})


def test_the_config_says_where_it_is_trained_unless_the_caller_does(monkeypatch):
    asked = []
    monkeypatch.setattr("facesynth.methods.training.device_of", lambda name: asked.append(name) or torch.device("cpu"))
    train(Guess, [1], {"device": "auto"})
    train(Guess, [1], {"device": "auto"}, device="cuda")
    train(Guess, [1], {}, device=torch.device("cpu"))
    assert asked == ["auto", "cuda"]
    assert train(Guess, [1], {"device": "auto"}).config == {"number": 1, "sure": False}


def test_a_method_that_learns_nothing_before_remembers_nothing():
    assert Method.prepared({"a": 1}, [], 0) == Prepared({"a": 1})
    model = Guess()
    model.remember({})
    assert model.facts == {}
