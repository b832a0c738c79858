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


def spread(function: Callable[[Item], Result], items: Sequence[Item], jobs: int, what: str) -> Iterator[Result]:
    """`map(function, items)` in `jobs` processes, showing progress; in this process where one is enough.

    FacesynthError where a worker was ended from outside; results until then were yielded.
    """
    if jobs < 1:
        raise FacesynthError(f"the number of jobs must be 1 or more; got {jobs}")
    if jobs == 1 or len(items) < 2:
        yield from track(map(function, items), what, len(items))
        return
    with ProcessPoolExecutor(min(jobs, len(items)), multiprocessing.get_context("spawn")) as pool:
        try:
            yield from track(pool.map(function, items), what, len(items))
        except BrokenProcessPool:
            raise FacesynthError(
                "a worker process was ended from outside (memory?); run it again, what is done is kept"
            ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
