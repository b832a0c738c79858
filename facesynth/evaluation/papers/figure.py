"""A table or figure of a paper, and how it is measured here: what a paper's list holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from facesynth.evaluation.papers.finding import Finding, not_available
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.evaluation.papers import Material


@dataclass(frozen=True)
class Figure:
    """An entry of a paper's `FIGURES`."""

    where: str
    """Table, figure or section."""
    what: str
    paper: str
    """As the paper prints it, with its unit."""
    measure: Callable[[Material], Sequence[Finding]]
    """Rows of ours, with their pictures; it raises FacesynthError where the recordings cannot give them."""

    def findings(self, material: Material) -> list[Finding]:
        """What was measured, or the reason why nothing was."""
        try:
            return list(self.measure(material))
        except FacesynthError as reason:
            return [not_available(self.where, self.what, self.paper, str(reason))]


def absent(where: str, what: str, paper: str, why: str) -> Figure:
    """An entry that no recordings can give."""
    return Figure(where, what, paper, lambda _: [not_available(where, what, paper, why)])
