"""Something that is wrong with a corpus."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from facesynth.inference.errors import FacesynthError

Read = TypeVar("Read")


@dataclass(frozen=True)
class Problem:
    """Something that is wrong with a corpus."""

    file: str
    """Relative to the corpus' folder."""
    what: str
    do: str
    grave: bool = True
    """False for what is merely worth knowing."""
    nodes: tuple[str, ...] = ()
    """In which it can be seen, where it can be told."""

    def __str__(self) -> str:
        return f"{'' if self.grave else 'note: '}{self.file}: {self.what} → {self.do}"


def attempt(problems: list[Problem], file: str, do: str, read: Callable[[], Read]) -> Read | None:
    """What `read` gives; where it finds fault, that becomes a problem and None is returned."""
    try:
        return read()
    except FacesynthError as error:
        problems.append(Problem(file, str(error), do))
        return None
