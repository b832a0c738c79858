"""The same work on many things: in this process, in several, or on a Ray cluster, with the same results in order."""

import multiprocessing
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Literal, TypeVar

from threadpoolctl import threadpool_limits

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.progress import track

Item = TypeVar("Item")
Result = TypeVar("Result")
Engine = Literal["processes", "ray"]
ENGINES: tuple[Engine, ...] = ("processes", "ray")

MOST_DEATHS = 3
"""A worker that dies so often is ended by what it works on, or for the memory that it takes."""
OBJECT_STORE_BYTES = 200 * 2**20
"""Memory in which a local Ray keeps results on their way: one recording each."""


@dataclass(frozen=True)
class Workers:
    """Who does the work."""

    jobs: int = 1
    """How many processes at once; with an address, how many tasks are under way."""
    engine: Engine = "processes"
    address: str = ""
    """Of a Ray cluster (`host:port`, or `auto`), whose machines must see the same files; empty: this computer."""

    def __post_init__(self) -> None:
        if self.jobs < 1:
            raise FacesynthError(f"the number of jobs must be 1 or more; got {self.jobs}")
        if self.engine not in ENGINES:
            raise unknown("engine", self.engine, ENGINES)
        if self.address and self.engine != "ray":
            raise FacesynthError("an address belongs to the engine ray; give --engine ray as well")


ALONE = Workers()


def spread(function: Callable[[Item], Result], items: Sequence[Item], workers: Workers, what: str) -> Iterator[Result]:
    """`map(function, items)` by the workers, showing progress; in this process where one is enough.

    Where a worker dies, what it had not finished is done again by new ones. FacesynthError where that does not help;
    results until then were yielded.
    """
    work = partial(_in_one_thread, function)
    if workers.engine == "ray" and len(items):
        return track(_quietly(_on_ray(work, items, workers)), what, len(items))
    if workers.jobs == 1 or len(items) < 2:
        return track(map(work, items), what, len(items))
    return track(_persistent(work, items, workers.jobs), what, len(items))


def _in_one_thread(function: Callable[[Item], Result], item: Item) -> Result:
    """Sums over several threads are rounded otherwise than in one: the result must not depend on who has how many."""
    with threadpool_limits(1):
        return function(item)


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
    raise _died()


def _pooled(function: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> Iterator[Result]:
    context = multiprocessing.get_context("spawn")
    work = partial(_on_bytes, pickle.dumps(function))
    with ProcessPoolExecutor(min(jobs, len(items)), context, initializer=_end_with_parent) as pool:
        try:
            yield from map(pickle.loads, pool.map(work, map(pickle.dumps, items)))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _on_bytes(function: bytes, item: bytes) -> bytes:
    """Everything travels as bytes: tensors would otherwise be handed over as open files, one for each of thousands."""
    return pickle.dumps(_unpacked(function)(pickle.loads(item)))  # noqa: S301 - from the parent process


@lru_cache(maxsize=1)
def _unpacked(function: bytes) -> Callable[[Any], Any]:
    """Once in each worker, for a function may bring a model along."""
    found: Callable[[Any], Any] = pickle.loads(function)  # noqa: S301 - from the parent process
    return found


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for work for ever: it ends as soon as the parent does."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=wait, name="end with parent", daemon=True).start()


def _quietly(results: Iterator[Result]) -> Iterator[Result]:
    """The same results; what Ray tells of dead workers meanwhile goes to stderr, for stdout may be somebody's JSON."""
    with redirect_stdout(sys.stderr):
        yield from results


def _on_ray(function: Callable[[Item], Result], items: Sequence[Item], workers: Workers) -> Iterator[Result]:
    """Tasks on a cluster, a few more under way than there are workers; Ray itself starts again what a dead worker left."""
    ray = _joined(workers)

    def work(item: Item) -> Result:  # Ray takes nothing but plain functions
        return function(item)

    task = ray.remote(num_cpus=1, max_retries=MOST_DEATHS - 1)(work)
    waiting: list[Any] = []
    started = 0
    try:
        while started < len(items) or waiting:
            while started < len(items) and len(waiting) < 2 * workers.jobs:
                waiting.append(task.remote(items[started]))
                started += 1
            yield ray.get(waiting.pop(0))
    except ray.exceptions.WorkerCrashedError:
        raise _died() from None
    except ray.exceptions.RayTaskError as error:
        raise error.cause or error from None
    finally:
        for left in waiting:
            ray.cancel(left, force=True)
        ray.shutdown()


def _joined(workers: Workers) -> Any:
    try:
        import ray
    except ImportError:
        raise FacesynthError("the engine ray is not installed; run: pip install 'facesynth[ray]'") from None
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"  # Ray would otherwise tell its makers that it runs
    quiet: dict[str, Any] = {"logging_level": "ERROR", "log_to_driver": False, "configure_logging": False}
    try:
        if workers.address:
            ray.init(address=workers.address, **quiet)
        else:
            ray.init(num_cpus=workers.jobs, include_dashboard=False, object_store_memory=OBJECT_STORE_BYTES, **quiet)
    except (ConnectionError, RuntimeError, ValueError, OSError, TimeoutError) as error:
        where = workers.address or "this computer"
        raise FacesynthError(f"Ray does not start on {where} ({' '.join(str(error).split())[:200]})") from None
    return ray


def _died() -> FacesynthError:
    return FacesynthError(f"worker processes died {MOST_DEATHS} times (too little memory?); use fewer jobs, what is done is kept")
