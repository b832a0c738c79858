"""The anime graph of an exported folder."""

import numpy as np

from ..arrays import Floats
from ..errors import FacesynthError
from ..expectation import exported_bands, exported_expectation
from ..folder import Folder
from ..graphs import Graph as OnnxGraph
from ..layout import Layout
from ..phones import PHONES, VISEMES
from ..sound import resample
from ..speech import Speech
from .candidates import Chooser, Maps
from .emotions import EmotionMapper
from .graph import Graph
from .hearing import RATE, Ear
from .lowpass import LowPass
from .model import AnimeGraph
from .search import Weights


def load_anime_graph(folder: Folder, threads: int) -> AnimeGraph:
    """The model that a folder of an anime graph holds."""
    manifest, settings, arrays = folder.manifest, folder.settings, folder.arrays()
    if [tuple(pair) for pair in manifest["phones"]] != list(zip(PHONES, VISEMES, strict=True)):
        raise FacesynthError(f"{folder.path} knows other phones than this version; export the model again")
    plp, encode, decode = (OnnxGraph(folder, name, threads) for name in ("rasta_plp", "encode", "decode"))
    fps, layout, emotions = float(manifest["fps"]), Layout.from_dict(manifest["layout"]), tuple(manifest["emotions"])
    maps, weights = _maps(folder, threads), Weights(**settings["weights"])
    gap = settings["closed_gap"]

    def encoded(frames: Floats) -> Floats:
        return encode(frames=frames[None])[0][0]

    def ear() -> Ear:
        return Ear(plp, settings["bands"], settings["parameters"])

    def hear(speech: Speech) -> Floats:
        heard = ear()
        heard.hear(resample(speech.audio, speech.sample_rate, RATE))
        heard.finish()
        return heard.features

    dropped = arrays.get("dropped", np.zeros((0, layout.channels)))
    return AnimeGraph(
        layout,
        fps,
        emotions,
        Chooser(Graph.of(arrays), maps),
        weights,
        arrays["metric"],
        LowPass(arrays["cutoffs_hz"], fps),
        EmotionMapper(layout, emotions, maps, settings["no_map"], encoded, arrays["mixing"], dropped),
        decode=lambda components: decode(coordinates=components[None])[0][0],
        hear=hear,
        feature_fps=settings["feature_fps"],
        closed_gap=np.inf if gap is None else float(gap),
        utterances=tuple(settings["utterances"]),
        bands=exported_bands(folder, threads) if weights.pose > 0 else None,
        expectation=exported_expectation(folder, arrays, threads) if weights.pose > 0 else None,
        ear=ear,
        temperature=settings["temperature"],
        sharpening=settings["sharpening"],
        help_pairs=settings["help_pairs"],
        manifest=manifest,
    )


def _maps(folder: Folder, threads: int) -> Maps:
    pairs = [(int(source), int(target)) for source, target in folder.settings["maps"]]
    if not pairs:
        return Maps()
    graph = OnnxGraph(folder, "emotion_maps", threads)

    def apply(components: Floats, number: int) -> Floats:
        whole = np.ones((1, len(components)))
        return graph(components=components[None], map=np.array(number, np.int64), intensity=whole)[0][0]

    return Maps(pairs, apply)
