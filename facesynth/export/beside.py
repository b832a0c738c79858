"""A model of phones alone in the folder of a network that hears: see `inference.beside`."""

from dataclasses import replace
from pathlib import Path

from facesynth.export.coarticulation import coarticulation_content
from facesynth.export.folder import Content
from facesynth.inference.beside import PREFIX
from facesynth.inference.errors import FacesynthError
from facesynth.methods.coarticulation.method import Coarticulation
from facesynth.methods.method import Method
from facesynth.methods.network.method import Network
from facesynth.methods.registry import load


def with_beside(content: Content, model: Method, other: Path, share: float) -> Content:
    """The content of a network with the co-articulation model of a file beside it, which counts `share` (0..1) of the mean.

    FacesynthError where either is another method's, or where they are of different faces.
    """
    mouth = load(other)
    if not isinstance(model, Network) or not isinstance(mouth, Coarticulation):
        raise FacesynthError(
            f"a model of phones alone stands beside a network: got {mouth.name} beside {model.name}, wanted coarticulation"
            " beside network"
        )
    if not 0 <= share <= 1:
        raise FacesynthError(f"the share of {other} is {share}; wanted 0 to 1")
    if mouth.fitted_layout != model.fitted_layout or mouth.fps != model.fps:
        raise FacesynthError(f"{other} moves another face, or at another rate, than the network; train both on one corpus")
    beside = coarticulation_content(mouth)
    return replace(
        content,
        graphs=(*content.graphs, *beside.graphs),
        settings={**content.settings, "beside": {**beside.settings, "share": share}},
        arrays={**content.arrays, **{PREFIX + name: array for name, array in beside.arrays.items()}},
        units={**content.units, **{PREFIX + name: unit for name, unit in beside.units.items()}},
    )
