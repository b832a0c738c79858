"""Two rows of phones laid beside each other: those of a text and those heard in a sound, where either may lack whole passages."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.phones import PHONE_INDEX, PHONES, VISEMES, VOWELS

Ints = NDArray[np.int32]

SAME, LOOKS_ALIKE, BOTH_VOWELS, OTHER = 20, 8, 0, -20
"""What it is worth to lay one phone beside another."""
MISSED = 20
"""Cost of one phone that the other row lacks."""
PASSAGE, PASSED = 200, 1
"""Cost of a passage that the other row lacks: of its beginning, and of each of its phones. From ten phones on it costs less
than as many that are missed; random phones find no more in common than a second beginning costs."""
_NEVER = -(2**30)


@dataclass(frozen=True, eq=False)
class Matched:
    """Which phone of the text is which that was heard."""

    partners: NDArray[np.int64]
    """[M] of each phone of the text the number of the one that was heard; -1 where none was."""
    worth: NDArray[np.int64]
    """[M] what each phone of the text is worth beside its partner; less where it has none."""
    unsaid: NDArray[np.bool_]
    """[M] phones of passages of the text that are not in the sound."""
    unwritten: NDArray[np.bool_]
    """[N] heard phones of passages that are not in the text."""


# Global alignment with two kinds of gaps (Gotoh 1982): single phones at MISSED each, and passages at PASSAGE and PASSED for each
# phone. With H the best score of the first i phones of the text and the first j that were heard, and E the best that ends inside
# an unsaid passage,
#   E(i, j) = max(E(i-1, j), H(i-1, j) - PASSAGE) - PASSED
#   H(i, j) = max(H(i-1, j-1) + worth, E(i, j), H(i-1, j) - MISSED, H(i, j-1) - MISSED, max_k<j H(i, k) - PASSAGE - PASSED (j-k)).
# What stands in the same row is a running maximum, so that a row is a few operations on whole arrays. Of all rows only each
# sqrt(M)-th is kept; those between are computed again on the way back: memory is N sqrt(M) in place of N M.
def match(written: Sequence[str], heard: Sequence[str]) -> Matched:
    """The best way to lay M written phones beside N heard ones, both in order."""
    partners, worth = np.full(len(written), -1), np.full(len(written), -MISSED)
    unsaid, unwritten = np.zeros(len(written), bool), np.zeros(len(heard), bool)
    i, j, passing = len(written), len(heard), False
    for first, scores, passages, table in _blocks_from_the_end(_numbers(written), _numbers(heard)):
        while i > first or (first == 0 and j > 0):
            row, best = i - first, scores[i - first, j]
            if passing:
                unsaid[i - 1], i = True, i - 1
                passing = passages[row, j] != scores[row - 1, j] - PASSAGE - PASSED
            elif row and j and best == scores[row - 1, j - 1] + table[row - 1, j - 1]:
                partners[i - 1], worth[i - 1] = j - 1, table[row - 1, j - 1]
                i, j = i - 1, j - 1
            elif row and best == scores[row - 1, j] - MISSED:
                i -= 1
            elif row and best == passages[row, j]:
                passing = True
            elif best == scores[row, j - 1] - MISSED:
                j -= 1
            else:
                ways = scores[row, :j] - PASSAGE - PASSED * np.arange(j, 0, -1)
                begin = int(np.flatnonzero(ways == best)[-1])
                unwritten[begin:j], j = True, begin
    return Matched(partners, worth, unsaid, unwritten)


def _blocks_from_the_end(written: Ints, heard: Ints) -> Iterator[tuple[int, Ints, Ints, Ints]]:
    """First row of each block, its H and E [rows + 1, N + 1], and what its phones are worth [rows, N]; the last block first."""
    size = max(1, math.isqrt(len(written)))
    worth = _worth()[:, heard]
    row = _first_row(len(heard))
    kept = {0: row}
    for i, phone in enumerate(written[: max(0, len(written) - 1) // size * size], start=1):
        row = _next_row(*row, worth[phone])
        if i % size == 0:
            kept[i] = row
    for first in sorted(kept, reverse=True):
        rows = [kept[first]]
        phones = written[first : first + size]
        for phone in phones:
            rows.append(_next_row(*rows[-1], worth[phone]))
        scores, passages = (np.stack(part) for part in zip(*rows, strict=True))
        yield first, scores, passages, worth[phones]


def _first_row(count: int) -> tuple[Ints, Ints]:
    places = np.arange(count + 1, dtype=np.int32)
    scores = np.maximum(-MISSED * places, -PASSAGE - PASSED * places)
    return scores, np.full(count + 1, _NEVER, np.int32)


def _next_row(scores: Ints, passages: Ints, worth: Ints) -> tuple[Ints, Ints]:
    """H and E [N + 1] of the next phone of the text."""
    places = np.arange(len(scores), dtype=np.int32)
    passages = np.maximum(passages, scores - PASSAGE) - PASSED
    best = np.maximum(passages, scores - MISSED)
    best[1:] = np.maximum(best[1:], scores[:-1] + worth)
    best = np.maximum.accumulate(best + MISSED * places) - MISSED * places
    best[1:] = np.maximum(best[1:], np.maximum.accumulate(best + PASSED * places)[:-1] - PASSED * places[1:] - PASSAGE)
    return best, passages


def _numbers(phones: Sequence[str]) -> Ints:
    return np.array([PHONE_INDEX[phone] for phone in phones], np.int32)


@cache
def _worth() -> Ints:
    """[P, P] of each phone beside each."""
    looks, vowel = np.array(VISEMES), np.isin(PHONES, list(VOWELS))
    table = np.where(vowel[:, None] & vowel, BOTH_VOWELS, OTHER)
    table = np.where(looks[:, None] == looks, LOOKS_ALIKE, table)
    return np.where(np.eye(len(PHONES), dtype=bool), SAME, table).astype(np.int32)
