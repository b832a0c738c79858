"""The one exception that means "the input is wrong", as opposed to "the program is"."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class RuntimeInputError(ValueError):
    """Something a user can mend; the message says what was got, what was wanted and what to do."""


def unknown(what: str, got: str, known: Iterable[str]) -> RuntimeInputError:
    """An error for a name that does not exist, with the nearest ones that do."""
    names = sorted(set(known))
    near = difflib.get_close_matches(got, names, n=3, cutoff=0.4) or names[:12]
    return RuntimeInputError(f"unknown {what} {got!r}; known: {', '.join(near)}")


def reject_options(method: str, options: Iterable[str], known: Iterable[str]) -> None:
    """RuntimeInputError where keyword options are left over."""
    surplus = sorted(options)
    if surplus:
        raise RuntimeInputError(f"{method} knows the options {', '.join(known)}; got {', '.join(surplus)}")
