"""Progress: one way of showing it, on standard error; a bar for who watches, a line now and then for a log."""

import os
import sys
import time
from collections.abc import Iterable, Iterator, Sized
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")

LINE_EVERY_S = 30.0
"""Where standard error is no terminal."""
LINE_EVERY_VARIABLE = "FACESYNTH_PROGRESS_S"
"""In the environment: so many seconds between lines instead, for a program that reads them."""


def track(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Yield `items`, showing how far they got: after half a second on a terminal, else as a line every 30 s."""
    if sys.stderr.isatty():
        return iter(tqdm(items, desc=what, total=total, delay=0.5, file=sys.stderr, leave=False))
    return _logged(items, what, len(items) if total is None and isinstance(items, Sized) else total)


def _logged(items: Iterable[Item], what: str, total: int | None) -> Iterator[Item]:
    begun = said = time.monotonic()
    every_s = float(os.environ.get(LINE_EVERY_VARIABLE) or LINE_EVERY_S)
    for done, item in enumerate(items):
        now = time.monotonic()
        if now - said >= every_s:
            said = now
            print(f"{what}: {done}{f' of {total}' if total else ''} after {now - begun:.0f} s", file=sys.stderr, flush=True)
        yield item
