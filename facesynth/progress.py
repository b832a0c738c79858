"""Progress bars: one way of showing them, on standard error, silent where nobody watches."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")


def track(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Yield `items`, showing after half a second how far they got; nothing where stderr is no terminal."""
    return iter(tqdm(items, desc=what, total=total, delay=0.5, file=sys.stderr, disable=None, leave=False))
