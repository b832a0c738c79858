"""The phone network as a folder that hears phones without torch."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.export.folder import Content, Subject, write_folder
from facesynth.export.graph import Arrays, Graph, Port
from facesynth.export.weights import Weights, stored_as
from facesynth.inference.ear import FRAMES_PER_S, RATE, STEP, WHOLE
from facesynth.speech.phone_archive import NOTICE, read_archive
from facesynth.speech.phone_graph import OUTPUTS, alphabet_of, hidden_graph, phone_graph
from facesynth.speech.phone_network import phone_network
from facesynth.speech.phone_weights import BLOCKS, WIDTH, network_weights


def export_phones(folder: str | Path, weights: Weights = "float32") -> dict[str, Any]:
    """Write the network that hears phones; returns the manifest."""
    latency = {"look_ahead_s": WHOLE.look_ahead_s, "about": "of whole sounds; a stream states its own"}
    alphabet = alphabet_of(read_archive().tokens)
    settings = {"tokens": list(alphabet.tokens), "phones_of_tokens": list(map(list, alphabet.phones)), "notice": NOTICE}
    content = Content((phone_network_graph(),), settings, latency, RATE)
    data = {"performer": "unknown", "licences": ["Apache-2.0 (weights)"], "consents": ["not stated by hama 1.7.0"]}
    return write_folder(folder, Subject("phones", data, None, None, ()), stored_as(content, weights))


def phone_net_graph(layer: int) -> Graph:
    """The network up to a layer, from 0, that others hear with."""
    network, weights = phone_network(), network_weights(read_archive())
    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", RATE)
    hidden = Port(OUTPUTS[1], "float32", ("batch", "frames", WIDTH), "none", FRAMES_PER_S)

    def reference(arrays: Arrays) -> list[NDArray[Any]]:
        return [network.part(**arrays)[1][:, :, layer]]

    about = f"what the Conformer block {layer + 1} of a network that hears phones makes of the sound"
    return Graph("phone_net", about, hidden_graph(weights, layer).model(), (sound,), (hidden,), _sound, reference)


def phone_network_graph() -> Graph:
    """The graph, which is compared with the module of torch."""
    network = phone_network()
    outputs = (
        Port(OUTPUTS[0], "float32", ("batch", "frames", len(network.tokens)), "natural logarithm", FRAMES_PER_S),
        Port(OUTPUTS[1], "float32", ("batch", "frames", BLOCKS, WIDTH), "none", FRAMES_PER_S),
    )
    sound = Port("audio", "float32", ("batch", "samples"), "full scale 1", RATE)
    about = "IPA tokens that are said (CTC), and what four Conformer blocks made of the sound"
    model = phone_graph(network_weights(read_archive())).model()
    return Graph("phones", about, model, (sound,), outputs, _sound, lambda arrays: network.part(**arrays))


def _sound(batch: int, length: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    return {"audio": (0.1 * rng.standard_normal((batch, STEP * length + 7))).astype(np.float32)}
