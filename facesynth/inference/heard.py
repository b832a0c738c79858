"""What the network of poses hears: log-mel bands, the phone network's hidden layer, which depends less on who speaks, or both."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .ear import STEP, Ear
from .folder import Folder
from .graphs import Graph, Part

HOP = STEP // 2
"""Samples between frames of either."""
Single = NDArray[np.float32]
Hear = Callable[[Single], Single]
"""From sound [S] at 16 kHz to features [1 + S // HOP, W], a frame every 10 ms."""


def hidden_layer(network: Part, audio: ArrayLike, layer: int) -> Single:
    """[1 + S // HOP, W] what a block of the phone network makes of a sound [S]: linear between its frames of 20 ms."""
    sound = np.asarray(audio, np.float32)
    _, hidden = Ear(network).hear(sound)
    own = hidden[:, layer]
    between = np.vstack([(own[:-1] + own[1:]) / 2, own[-1:]])
    doubled = np.stack([own, between], axis=1).reshape(-1, own.shape[1])
    return np.asarray(doubled[np.minimum(np.arange(1 + len(sound) // HOP), len(doubled) - 1)], np.float32)


def exported_hear(folder: Folder, threads: int) -> Hear:
    """What the graphs of a folder hear: `log_mel`, `phone_net`, or one beside the other."""
    known: dict[str, Callable[[], Hear]] = {
        "log_mel": lambda: _log_mel(Graph(folder, "log_mel", threads)),
        "phone_net": lambda: _phone_net(Graph(folder, "phone_net", threads)),
    }
    hears = [make() for name, make in known.items() if name in folder.manifest["graphs"]]
    return hears[0] if len(hears) == 1 else lambda sound: np.hstack([hear(sound) for hear in hears])


def _log_mel(graph: Graph) -> Hear:
    return lambda sound: np.asarray(graph(audio=sound[None])[0][0], np.float32)


def _phone_net(graph: Graph) -> Hear:
    def network(*, audio: Single) -> list[Single]:
        (hidden,) = graph(audio=audio)
        return [hidden, hidden[:, :, None]]  # the graph ends at its one layer; nobody asks for phones

    return lambda sound: hidden_layer(network, sound, layer=0)
