"""Phones heard in a sound that nobody wrote down: at once, or as the sound comes in."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_rate, require_open
from .ear import RATE, WHOLE, Ear, EarState, Reach, stream_reach
from .folder import Folder
from .graphs import Graph, Part
from .sound import resample
from .speech import PhoneTrack
from .speech_or_music import SpeechOrMusic, log_odds_at
from .spikes import Alphabet, Placed, Placer, Spike, SpikeReader, placed_around


class PhoneHearing:
    """The phone network, whether it is a graph of a folder or a module of torch.

    Parameters
    ----------
    network
        Called as `network(audio=[1, S])`, see `Ear`.
    alphabet
        What its outputs stand for.
    """

    def __init__(self, network: Part, alphabet: Alphabet, manifest: Mapping[str, Any] = MappingProxyType({})) -> None:
        self.network, self.alphabet, self.manifest = network, alphabet, manifest
        self.rate = RATE

    def hear(self, audio: NDArray[Any], sample_rate: int) -> PhoneTrack:
        """Phones of a whole sound [S], -1..1, with confidences."""
        return _track(placed_around(self.spikes(audio, sample_rate), len(audio) / sample_rate))

    def spikes(self, audio: NDArray[Any], sample_rate: int) -> list[Spike]:
        """The phones of a whole sound [S] where the network tells them, in order of time."""
        reader = SpikeReader(self.alphabet)
        found = [
            spike for block in Ear(self.network, WHOLE).read(resample(audio, sample_rate, RATE)) for spike in reader.read(block)
        ]
        return [*found, *reader.end()]

    def judged_spikes(
        self, audio: NDArray[Any], sample_rate: int, judge: SpeechOrMusic
    ) -> tuple[list[Spike], NDArray[np.float32]]:
        """The same, and of each phone the log odds that it is speech and no music."""
        reader = SpikeReader(self.alphabet)
        found: list[Spike] = []
        log_odds: list[NDArray[np.float32]] = []
        for log_probabilities, hidden in Ear(self.network, WHOLE).read_with_layers(resample(audio, sample_rate, RATE)):
            found += reader.read(log_probabilities)
            log_odds.append(judge.log_odds(hidden))
        found += reader.end()
        return found, log_odds_at(found, np.concatenate(log_odds))

    def stream(self, *, look_ahead_s: float = 0.4, sample_rate: int | None = None) -> "PhoneStream":
        """Sound in pieces of any size; `sample_rate` must be RATE, and the look-ahead is that of the network's windows."""
        checked_rate(RATE if sample_rate is None else sample_rate, RATE)
        return PhoneStream(self, stream_reach(look_ahead_s))


class PhoneStream:
    """`push` sound, get phones. How the sound is cut does not change them."""

    def __init__(self, model: PhoneHearing, reach: Reach) -> None:
        self._ear, self._reader, self._placer = Ear(model.network, reach), SpikeReader(model.alphabet), Placer()
        self._state: EarState = self._ear.start()
        self._ended = False
        self.look_ahead_s = reach.look_ahead_s
        """A frame is heard when the sound up to this after it is known, or less, seconds."""

    def push(self, audio: ArrayLike) -> list[Placed]:
        """More sound [S] at RATE; the phones that became final, silence among them, each from the end of the one before."""
        require_open(self._ended)
        blocks, self._state = self._ear.advance(self._state, audio)
        placed: list[Placed] = []
        for block in blocks:
            found = self._reader.read(block.log_probabilities)
            placed += self._placer.place(found, self._reader.read_s)
        return placed

    def finish(self) -> list[Placed]:
        """What was held back: after the end there is silence."""
        require_open(self._ended)
        self._ended = True
        duration_s = self._state.samples / RATE
        blocks, self._state = self._ear.advance(self._state, np.zeros(0, np.float32), ended=True)
        found = [spike for block in blocks for spike in self._reader.read(block.log_probabilities)]
        return self._placer.end([*found, *self._reader.end()], duration_s)


def _track(placed: Sequence[Placed]) -> PhoneTrack:
    labels, ends_s, confidences = zip(*placed, strict=True)
    return PhoneTrack(labels, np.array(ends_s), np.array(confidences))


def load_phones(folder: Folder, threads: int) -> PhoneHearing:
    """The network that `facesynth export phones` wrote."""
    alphabet = Alphabet(tuple(folder.settings["tokens"]), tuple(map(tuple, folder.settings["phones_of_tokens"])))
    return PhoneHearing(Graph(folder, "phones", threads), alphabet, folder.manifest)
