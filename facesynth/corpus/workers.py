"""The same work on many things, in several processes, with results in order."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from facesynth.errors import FacesynthError
from facesynth.progress import track

Item = TypeVar("Item")
Result = TypeVar("Result")


MOST_DEATHS = 3
"""A worker that dies so often is ended by what it works on, or for the memory that it takes."""


def spread(function: Callable[[Item], Result], items: Sequence[Item], jobs: int, what: str) -> Iterator[Result]:
    """`map(function, items)` in `jobs` processes, showing progress; in this process where one is enough.

    Where a worker dies, what it had not finished is done again by new ones. FacesynthError where that does not help;
    results until then were yielded.
    """
    if jobs < 1:
        raise FacesynthError(f"the number of jobs must be 1 or more; got {jobs}")
    if jobs == 1 or len(items) < 2:
        return track(map(function, items), what, len(items))
    return track(_persistent(function, items, jobs), what, len(items))


def _persistent(function: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> Iterator[Result]:
    done = 0
    for _ in range(MOST_DEATHS):
        try:
            for result in _pooled(function, items[done:], jobs):
                done += 1
                yield result
            return
        except BrokenProcessPool:
            continue
    raise FacesynthError(f"worker processes died {MOST_DEATHS} times (too little memory?); use fewer jobs, what is done is kept")


def _pooled(function: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> Iterator[Result]:
    with ProcessPoolExecutor(min(jobs, len(items)), multiprocessing.get_context("spawn")) as pool:
        try:
            yield from pool.map(function, items)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
