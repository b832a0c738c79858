"""What the network of poses hears: log-mel bands, the phone network's hidden layer, which depends less on who speaks, or both.

Of a whole sound, or of sound in pieces of any size: how it is cut changes nothing. Log-mel bands are the same either way. The
phone network looks at windows (see `ear`), those of a stream reach less far ahead than those of a whole sound.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_piece
from .ear import RATE, STEP, Ear, Reach, stream_reach
from .folder import Folder
from .graphs import Graph, Part
from .long_arrays import Growing, let_go

HOP = STEP // 2
"""Samples between frames of either."""
HALF_WINDOW = 256
"""Samples on either side of its centre that a frame of bands depends on."""
PIECE = 3000
"""Frames of bands that are heard at once."""
AROUND = 3
"""Frames of bands that are heard once more beside new ones: the first of a piece lack what came before it."""
Single = NDArray[np.float32]
Hear = Callable[[Single], Single]
"""From sound [S] at 16 kHz to features [1 + S // HOP, W], a frame every 10 ms."""


class Pieces(Protocol):
    """Sound that comes in pieces."""

    def push(self, audio: ArrayLike, *, ended: bool = False) -> Single:
        """More sound [S] at RATE: the features [t, W] that became final; after what `ended` there is silence."""


@dataclass(frozen=True, eq=False)
class Listening:
    """What a model hears with; of the two at least one. A `Hear` of whole sounds."""

    bands: Hear | None = None
    """Log-mel bands."""
    network: Part | None = None
    """The phone network …"""
    layer: int = 0
    """… and which of its layers is heard."""

    def __call__(self, sound: Single) -> Single:
        """[1 + S // HOP, W] of a whole sound."""
        parts = [] if self.bands is None else [bands_of(self.bands, sound)]
        parts += [] if self.network is None else [hidden_layer(self.network, sound, self.layer)]
        return parts[0] if len(parts) == 1 else np.hstack(parts)

    def pieces(self, ahead_s: float) -> Pieces:
        """The same of sound in pieces; ahead_s: how far the windows of the phone network reach ahead, seconds."""
        parts: list[Pieces] = [] if self.bands is None else [BandPieces(self.bands)]
        parts += [] if self.network is None else [HiddenPieces(self.network, self.layer, stream_reach(ahead_s))]
        return parts[0] if len(parts) == 1 else PiecesBeside(parts)

    def look_ahead_s(self, ahead_s: float) -> float:
        """A frame at t is final in a stream when the sound up to t + this is known, or earlier."""
        return HALF_WINDOW / RATE if self.network is None else stream_reach(ahead_s).look_ahead_s + HOP / RATE


def bands_of(hear: Hear, sound: Single) -> Single:
    """[F, B] bands of a sound [S] at RATE, heard piece by piece: those of a frame depend on little around it."""
    count, parts = 1 + len(sound) // HOP, Growing()
    for first in range(0, count, PIECE):
        begin, stop = max(0, first - AROUND), min(first + PIECE, count)
        end = len(sound) if stop == count else (stop + AROUND) * HOP
        parts.add(hear(sound[begin * HOP : end])[first - begin : stop - begin])
        let_go(sound)
    return parts.whole()


def hidden_layer(network: Part, audio: ArrayLike, layer: int) -> Single:
    """[1 + S // HOP, W] what a block of the phone network makes of a sound [S]: linear between its frames of 20 ms."""
    sound = np.asarray(audio, np.float32)
    _, hidden = Ear(network).hear(sound)
    own = hidden[:, layer]
    return np.vstack([_doubled(own), own[-1:], own[-1:]])[: 1 + len(sound) // HOP]


def _doubled(own: Single) -> Single:
    """[2 T - 2, W] frames [T, W] and what lies half way to the next, without the last."""
    pairs = np.stack([own[:-1], (own[:-1] + own[1:]) / 2], axis=1)
    return np.asarray(pairs.reshape(-1, own.shape[1]), np.float32)


class BandPieces:
    """Log-mel bands of sound in pieces."""

    def __init__(self, hear: Hear) -> None:
        self._hear = hear
        self._sound, self._first, self._given = np.zeros(0, np.float32), 0, 0

    def push(self, audio: ArrayLike, *, ended: bool = False) -> Single:
        """See `Pieces`; sound that no later frame needs is forgotten."""
        self._sound = np.concatenate([self._sound, checked_piece(audio)])
        samples = self._first + len(self._sound)
        stop = max(self._given, 1 + (samples if ended else samples - HALF_WINDOW) // HOP)
        begin = max(0, self._given - AROUND)
        heard = self._hear(self._sound[begin * HOP - self._first :])[self._given - begin : stop - begin]
        kept = max(0, stop - AROUND) * HOP
        self._sound, self._first, self._given = self._sound[kept - self._first :], kept, stop
        return heard


class HiddenPieces:
    """A layer of the phone network of sound in pieces."""

    def __init__(self, network: Part, layer: int, reach: Reach) -> None:
        self._ear, self._layer = Ear(network, reach), layer
        self._state = self._ear.start()
        self._last: list[Single] = []
        """The last frame of the network [1, W]: what follows it waits for the next."""
        self._given = 0

    def push(self, audio: ArrayLike, *, ended: bool = False) -> Single:
        """See `Pieces`."""
        samples = self._state.samples + len(checked_piece(audio))
        blocks, self._state = self._ear.advance(self._state, audio, ended=ended)
        own = [*self._last, *(block.hidden[:, self._layer] for block in blocks)]
        if not own:
            return np.zeros((0, 0), np.float32)
        frames = np.concatenate(own)
        self._last, found = [frames[-1:]], _doubled(frames)
        if ended:
            found = np.vstack([found, frames[-1:], frames[-1:]])[: 1 + samples // HOP - self._given]
        self._given += len(found)
        return found


class PiecesBeside:
    """Several of them, one beside the other: a frame is final where it is in all."""

    def __init__(self, parts: Sequence[Pieces]) -> None:
        self._parts = parts
        self._waiting: list[Single | None] = [None] * len(parts)

    def push(self, audio: ArrayLike, *, ended: bool = False) -> Single:
        """See `Pieces`."""
        new = [part.push(audio, ended=ended) for part in self._parts]
        known = [_after(old, more) for old, more in zip(self._waiting, new, strict=True)]
        count = min(map(len, known))
        self._waiting = [rows[count:] if len(rows) else None for rows in known]
        return np.hstack([rows[:count] for rows in known]) if count else np.zeros((0, 0), np.float32)


def _after(old: Single | None, more: Single) -> Single:
    """Rows after rows; where there are none their width need not be known."""
    return more if old is None else old if not len(more) else np.vstack([old, more])


def exported_listening(folder: Folder, threads: int) -> Listening:
    """What the graphs of a folder hear: `log_mel`, `phone_net`, or one beside the other."""
    known = folder.manifest["graphs"]
    bands = _log_mel(Graph(folder, "log_mel", threads)) if "log_mel" in known else None
    return Listening(bands, _phone_net(Graph(folder, "phone_net", threads)) if "phone_net" in known else None)


def _log_mel(graph: Graph) -> Hear:
    return lambda sound: np.asarray(graph(audio=sound[None])[0][0], np.float32)


def _phone_net(graph: Graph) -> Part:
    def network(*, audio: Single) -> list[Single]:
        (hidden,) = graph(audio=audio)
        return [hidden, hidden[:, :, None]]  # the graph ends at its one layer; nobody asks for phones

    return network
