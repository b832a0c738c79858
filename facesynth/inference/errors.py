"""The one exception that means "the input is wrong", as opposed to "the program is"."""

import difflib
from collections.abc import Iterable


class FacesynthError(ValueError):
    """Something a user can mend. The message says what was got, what was wanted and what to do.

    The command line prints it as one line and leaves with exit code 2.
    """


def unknown(what: str, got: str, known: Iterable[str]) -> FacesynthError:
    """An error for a name that does not exist, with the nearest ones that do."""
    names = sorted(set(known))
    near = difflib.get_close_matches(got, names, n=3, cutoff=0.4) or names[:12]
    return FacesynthError(
        f"unknown {what} {got!r}; did you mean {', '.join(near)}?" if near else f"unknown {what} {got!r}; there are none"
    )


def reject_options(method: str, options: Iterable[str], known: Iterable[str]) -> None:
    """FacesynthError where keyword options are left over."""
    surplus = sorted(options)
    if surplus:
        raise FacesynthError(f"{method} knows the options {', '.join(known)}; got {', '.join(surplus)}")
