"""From a corpus to a trained method: what to use is learned first, then the method."""

from collections.abc import Mapping
from typing import Any, TypeVar

import torch

from facesynth.corpus import Corpus
from facesynth.methods.method import Method

CPU = torch.device("cpu")
M = TypeVar("M", bound=Method)


def train(method: type[M], corpus: Corpus, config: Mapping[str, Any], *, seed: int = 0, device: torch.device = CPU) -> M:
    """A method trained on a corpus; FacesynthError for a config that it does not know, or recordings that teach nothing.

    Networks learn on `device`, where the method is left; what is linear algebra or search is learned on the processor.
    """
    prepared = method.prepared(method.from_config(config).config, corpus, seed)
    model = method.from_config(prepared.config).to(device).fit(corpus, seed=seed)
    model.remember(prepared.account)
    return model
