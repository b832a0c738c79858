"""Where the passages of a transcript are in a sound, and what either has that the other lacks, by the phones that are heard."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.spikes import REACH_S, Spike
from facesynth.speech.phone_matching import Matched, match
from facesynth.speech.pieces import quietest_s
from facesynth.speech.pronunciation import pronounce

LEAST_SAID = 0.5
"""A transcript of whose words fewer are heard is another sound's."""
FEWEST_HEARD = 10
"""Phones between two words that nobody wrote down; fewer are taken for the network's."""

CHANCE = 7
"""Worth of a phone in words that are alike by chance, or more; of words that are said it is 14.6, the mean of 20 sentences."""
NEAR = 20
"""Words on either side of what is not said that may be alike by chance."""


@dataclass(frozen=True)
class Passage:
    """A stretch of sound, and what is said in it."""

    start_s: float
    end_s: float
    words: tuple[str, ...]
    """None where something is said that the transcript lacks."""
    pauses_s: tuple[tuple[float, float], ...] = ()
    """Between each word and the next: when one ends and the other begins, seconds."""


@dataclass(frozen=True)
class Unsaid:
    """Words of the transcript that are not in the sound."""

    words: tuple[str, ...]
    at_s: float
    """Where they would be."""


@dataclass(frozen=True)
class Followed:
    """A transcript followed through a sound."""

    passages: tuple[Passage, ...]
    """From the beginning of the sound to its end."""
    unsaid: tuple[Unsaid, ...]


@dataclass(frozen=True)
class _Run:
    """Words that follow one another, and the spikes they are heard by.

    Without words, spikes of what nobody wrote; without spikes, words that are not said.
    """

    words: tuple[str, ...]
    spikes: tuple[tuple[int, int], ...]
    """First and last of each word, or of the whole."""


def follow(audio: NDArray[np.float32], rate: int, words: Sequence[str], heard: Sequence[Spike]) -> Followed | None:
    """Words in a sound [S] in which these phones were heard; None where less than half of the words are in it."""
    spoken = [pronounce(word) for word in words]
    found = match([phone for phones in spoken for phone in phones], [spike.phone for spike in heard])
    edges = np.cumsum([0, *map(len, spoken)])
    spans = list(_spans(found, edges, _said(found, edges)))
    if sum(span is not None for span in spans) < LEAST_SAID * len(words):
        return None
    return _laid(audio, rate, heard, list(_with_unwritten(_runs(words, spans, found), len(heard))))


# Where a passage was replaced by another, words on the edge of what is not said may lie on phones of what nobody wrote, as some
# are alike by chance. Edges are where the sum of worth - CHANCE over the phones beyond them is largest.
def _said(found: Matched, edges: NDArray[np.int64]) -> NDArray[np.bool_]:
    """[W] whether each word, whose phones lie between two edges, is in the sound."""
    count = np.diff(edges)
    said = np.add.reduceat(found.unsaid, edges[:-1], dtype=int) <= count / 2
    worth = np.add.reduceat(found.worth, edges[:-1]) - CHANCE * count
    unwritten = np.cumsum([0, *found.unwritten])
    for first, stop in _stretches(~said):
        around = found.partners[edges[max(0, first - NEAR)] : edges[min(len(said), stop + NEAR)]]
        around = around[around >= 0]
        if not len(around) or unwritten[around[-1]] - unwritten[around[0]] < FEWEST_HEARD:
            continue
        said[first - _negative(worth[:first][::-1], said[:first][::-1]) : first] = False
        said[stop : stop + _negative(worth[stop:], said[stop:])] = False
    return said


def _negative(worth: NDArray[np.int64], said: NDArray[np.bool_]) -> int:
    """How many of the first words that are said are worth the least together."""
    count = NEAR if said[:NEAR].all() else int(said.argmin())
    sums = np.cumsum([0, *worth[:count]])
    return int(sums.argmin())


def _stretches(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last of each run of marks."""
    edges = np.flatnonzero(np.diff(marked.astype(np.int8), prepend=0, append=0))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _spans(found: Matched, edges: NDArray[np.int64], said: NDArray[np.bool_]) -> Iterator[tuple[int, int] | None]:
    """First and last spike of each word; None where it is not said."""
    before = np.cumsum([0, *found.unwritten])
    last = 0
    for is_said, (start, stop) in zip(said, pairwise(edges), strict=True):
        if not is_said:
            yield None
            continue
        own = found.partners[start:stop]
        own = own[own >= 0]
        if len(own):
            parts = np.split(own, np.flatnonzero(np.diff(before[own]) >= FEWEST_HEARD) + 1)
            own = max(parts, key=len)  # what nobody wrote may have been laid inside a word
            last = int(own[-1])
        yield (int(own[0]) if len(own) else last), last


def _runs(words: Sequence[str], spans: Sequence[tuple[int, int] | None], found: Matched) -> Iterator[_Run]:
    """Words that follow one another in the sound, and words that are not in it, in the order of the transcript."""
    before = np.cumsum([0, *found.unwritten])
    together: list[str] = []
    spikes: list[tuple[int, int]] = []
    for word, span in zip(words, spans, strict=True):
        parted = span is not None and spikes and before[span[0]] - before[spikes[-1][1]] >= FEWEST_HEARD
        if together and ((span is None) != (not spikes) or parted):
            yield _Run(tuple(together), tuple(spikes))
            together, spikes = [], []
        together.append(word)
        spikes += [span] if span is not None else []
    yield _Run(tuple(together), tuple(spikes))


def _with_unwritten(runs: Iterator[_Run], count: int) -> Iterator[_Run]:
    """The runs with those of the spikes between them, of `count`, that belong to no word."""
    now = 0
    for run in [*runs, _Run((), ((count, count),))]:
        first = run.spikes[0][0] if run.spikes else now
        if first - now >= FEWEST_HEARD:
            yield _Run((), ((now, first - 1),))
        if run.words:
            yield run
        now = run.spikes[-1][1] + 1 if run.spikes else now


def _laid(audio: NDArray[np.float32], rate: int, heard: Sequence[Spike], runs: Sequence[_Run]) -> Followed:
    """Runs as passages that fill the sound, cut where it is quietest between them."""
    passages: list[Passage] = []
    unsaid: list[Unsaid] = []
    sounding = [run for run in runs if run.spikes]
    ends_s = [quietest_s(audio, rate, *_between(heard, run, after)) for run, after in pairwise(sounding)]
    edges = pairwise([0.0, *ends_s, len(audio) / rate])
    for run in runs:
        if not run.spikes:
            unsaid.append(Unsaid(run.words, passages[-1].end_s if passages else 0.0))
            continue
        pauses = [_pause(heard[a], heard[b]) for (_, a), (b, _) in pairwise(run.spikes)] if run.words else []
        passages.append(Passage(*next(edges), run.words, tuple(pauses)))
    return Followed(tuple(passages), tuple(unsaid))


def _pause(before: Spike, after: Spike) -> tuple[float, float]:
    """When a phone ends and the next one begins."""
    end_s, start_s = before.last_s + REACH_S, after.first_s - REACH_S
    return (end_s, start_s) if end_s < start_s else ((end_s + start_s) / 2,) * 2


def _between(heard: Sequence[Spike], run: _Run, after: _Run) -> tuple[float, float]:
    return heard[run.spikes[-1][1]].last_s, heard[after.spikes[0][0]].first_s
