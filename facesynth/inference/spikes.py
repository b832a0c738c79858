"""From the network's probabilities to phones: it was trained for CTC and tells each by a spike of a frame or two."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .ear import FRAMES_PER_S
from .errors import FacesynthError
from .phones import SILENCE, viseme_of

WORD_BOUNDARY, BLANK = "<wb>", "<blank>"
BLANK_BIAS = -0.1
"""Added to the blank's logarithm: the network was made to be read so."""
LAG_S = 0.02
"""How much later than the middle of a phone its spike comes: median of 1,047 phones of 79 aligned clips of seven speakers."""
REACH_S = 0.06
"""How far a phone reaches to either side of its spike where no other phone is nearer, seconds."""
INSIDE_S = 0.02
"""Between the phones of a token that stands for two."""
SHORTEST_S = 0.005
"""Of a phone, where spikes crowd at the beginning of a sound."""
TOUCHING_S = 1e-6

Single = NDArray[np.float32]


@dataclass(frozen=True)
class Spike:
    """One phone that was heard."""

    phone: str
    first_s: float
    """Middle of the first frame that tells it, the lag taken off, seconds."""
    last_s: float
    confidence: float
    """0 to 1: how probable the network found this phone among all phones."""
    begins_word: bool


@dataclass(frozen=True, eq=False)
class Alphabet:
    """What the network's outputs stand for."""

    tokens: tuple[str, ...]
    phones: tuple[tuple[str, ...], ...]
    """Of each token; none for marks and for what has no place on a face."""

    def __post_init__(self) -> None:
        for mark in (WORD_BOUNDARY, BLANK):
            if mark not in self.tokens:
                raise FacesynthError(f"the network's tokens lack {mark}; export it again")
        for phone in {phone for phones in self.phones for phone in phones}:
            viseme_of(phone)
        if len(self.phones) != len(self.tokens):
            raise FacesynthError(
                f"there are phones for {len(self.phones)} tokens of {len(self.tokens)}; export the network again"
            )

    @property
    def blank(self) -> int:
        """Number of the token that stands for nothing."""
        return self.tokens.index(BLANK)

    def alike(self) -> NDArray[np.int64]:
        """[V] tokens with the same phones have the same number; -1 where there is none."""
        kinds = sorted({phones for phones in self.phones if phones})
        return np.array([kinds.index(phones) if phones else -1 for phones in self.phones])


class Placed(NamedTuple):
    """A phone of a track."""

    label: str
    end_s: float
    confidence: float
    """0 to 1; 1 for silence."""


class SpikeReader:
    """Reads log-probabilities as they come: the same spikes for the whole and for pieces of any size."""

    def __init__(self, alphabet: Alphabet) -> None:
        self._alphabet, self._alike = alphabet, alphabet.alike()
        self._open = np.zeros((0, len(alphabet.tokens)), np.float32)
        """Rows of a token that may go on."""
        self._frames = 0
        """Of the rows before those."""
        self._fresh = True

    @property
    def read_s(self) -> float:
        """No later phone begins before this, seconds."""
        return self._frames / FRAMES_PER_S - LAG_S

    def read(self, log_probabilities: Single) -> list[Spike]:
        """More rows [t, V]: the phones whose last frame is known, in order of time."""
        return self._read(log_probabilities, ended=False)

    def end(self) -> list[Spike]:
        """The phone that was still going on."""
        return self._read(self._open[:0], ended=True)

    def _read(self, log_probabilities: Single, *, ended: bool) -> list[Spike]:
        rows = np.concatenate([self._open, log_probabilities])
        biased = rows.copy()
        biased[:, self._alphabet.blank] += BLANK_BIAS
        best = biased.argmax(axis=1)
        edges = [*np.flatnonzero(np.diff(best, prepend=-1)), len(best)]
        goes_on = not ended and len(best) and best[-1] != self._alphabet.blank
        runs = list(pairwise(edges))[: -1 if goes_on else None]
        found = [spike for start, stop in runs for spike in self._spikes(rows[start:stop], int(best[start]), start)]
        done = runs[-1][1] if runs else 0
        self._open, self._frames = rows[done:], self._frames + done
        return found

    def _spikes(self, rows: Single, token: int, start: int) -> list[Spike]:
        self._fresh |= self._alphabet.tokens[token] == WORD_BOUNDARY
        phones = self._alphabet.phones[token]
        if not phones:
            return []
        sure = _confidence(rows, self._alike, self._alike[token])
        first_s = (self._frames + start) / FRAMES_PER_S - LAG_S
        last_s = first_s + (len(rows) - 1) / FRAMES_PER_S
        fresh, self._fresh = self._fresh, False
        return [
            Spike(phone, first_s + place * INSIDE_S, last_s + place * INSIDE_S, sure, fresh and not place)
            for place, phone in enumerate(phones)
        ]


def spikes(log_probabilities: Single, alphabet: Alphabet) -> list[Spike]:
    """Phones of log-probabilities [T, V] of a whole sound, in order of time."""
    reader = SpikeReader(alphabet)
    return [*reader.read(log_probabilities), *reader.end()]


class Placer:
    """Gives each phone its stretch: half way to its neighbours, at most REACH_S beyond its spike; between them is silence."""

    def __init__(self) -> None:
        self._waiting: Spike | None = None
        self._before_s = -np.inf
        """Last frame of the phone before the one that waits."""
        self._now_s = 0.0
        """What was placed ends here."""

    def place(self, found: Sequence[Spike], heard_s: float) -> list[Placed]:
        """More spikes, in order of time; no later call brings one that begins before `heard_s`. What became final."""
        done: list[Placed] = []
        for spike in found:
            done += self._finish(spike.first_s)
            self._waiting = spike
        if self._waiting is not None and heard_s > self._waiting.last_s + 2 * REACH_S:
            done += self._finish(np.inf)
        return done

    def end(self, found: Sequence[Spike], duration_s: float) -> list[Placed]:
        """The last spikes of a sound that lasts so long, and what was left; nothing reaches beyond its end."""
        before_s = self._now_s
        done: list[Placed] = []
        for one in [*self.place(found, np.inf), Placed(SILENCE, np.inf, 1.0)]:
            end_s = min(one.end_s, duration_s)
            if end_s > before_s + TOUCHING_S:
                done.append(one._replace(end_s=end_s))
                before_s = end_s
        return done

    def _finish(self, next_s: float) -> list[Placed]:
        """The phone that waits, and the silence before it; the next one begins at `next_s`."""
        spike = self._waiting
        if spike is None:
            return []
        start_s = max(spike.first_s - REACH_S, (self._before_s + spike.first_s) / 2, self._now_s)
        end_s = max(min(spike.last_s + REACH_S, (spike.last_s + next_s) / 2), start_s + SHORTEST_S)
        silence = [Placed(SILENCE, start_s, 1.0)] if start_s > self._now_s + TOUCHING_S else []
        self._waiting, self._before_s, self._now_s = None, spike.last_s, end_s
        return [*silence, Placed(spike.phone, end_s, spike.confidence)]


def _confidence(rows: Single, alike: NDArray[np.int64], kind: int) -> float:
    """Probability of the tokens that mean this phone among all tokens that mean one, in the frame where it is largest."""
    probabilities = np.exp(rows.astype(np.float64))
    said = probabilities[:, alike >= 0].sum(axis=1)
    return float((probabilities[:, alike == kind].sum(axis=1) / np.maximum(said, 1e-12)).max())


def segments_around(found: Sequence[Spike], duration_s: float) -> list[tuple[str, float, float]]:
    """Label, start and end in seconds of the phones of a whole sound, without the silence between them."""
    placed = placed_around(found, duration_s)
    starts_s = [0.0, *(one.end_s for one in placed)]
    return [(one.label, start_s, one.end_s) for one, start_s in zip(placed, starts_s, strict=False) if one.label != SILENCE]


def placed_around(found: Sequence[Spike], duration_s: float) -> list[Placed]:
    """The track of a whole sound, silence among its phones."""
    return Placer().end(found, duration_s)
