"""From a corpus to a trained method: what to use is learned first, then the method."""

from collections.abc import Mapping
from typing import Any, TypeVar

import torch

from facesynth.corpus import Corpus
from facesynth.device import device_of
from facesynth.methods.method import Method

M = TypeVar("M", bound=Method)


def train(
    method: type[M], corpus: Corpus, config: Mapping[str, Any], *, seed: int = 0, device: torch.device | str | None = None
) -> M:
    """A method trained on a corpus; FacesynthError for a config that it does not know, or recordings that teach nothing.

    Networks learn on `device`, where the method is left; what is linear algebra or search is learned on the processor.
    Where none is given, the config's `device` says it (see `device_of`), the processor otherwise.
    """
    place = device if isinstance(device, torch.device) else device_of(device or str(config.get("device", "cpu")))
    prepared = method.prepared(method.from_config(config).config, corpus, seed)
    model = method.from_config(prepared.config).to(place).fit(corpus, seed=seed)
    model.remember(prepared.account)
    return model
