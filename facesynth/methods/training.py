"""From a corpus to a trained method: what to use is learned first, then the method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from facesynth.corpus import Corpus
from facesynth.methods.method import Method

M = TypeVar("M", bound=Method)


def train(method: type[M], corpus: Corpus, config: Mapping[str, Any], *, seed: int = 0) -> M:
    """A method trained on a corpus; FacesynthError for a config that it does not know, or recordings that teach nothing."""
    prepared = method.prepared(method.from_config(config).config, corpus, seed)
    model = method.from_config(prepared.config).fit(corpus, seed=seed)
    model.remember(prepared.account)
    return model
