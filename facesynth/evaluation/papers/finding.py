"""What a paper states, what came out here, and whether the two may be compared: never more than that."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

Status = Literal["measured", "not available", "not implemented"]
COLUMNS = ("where", "what", "paper", "ours", "comparable", "why", "status")


@dataclass(frozen=True)
class Finding:
    """One figure of a paper."""

    where: str
    """Table, figure or section."""
    what: str
    paper: str
    """As the paper prints it, with its unit."""
    ours: str = ""
    comparable: bool = False
    """Whether the numbers mean the same thing, measured under conditions alike enough to set them side by side."""
    why: str = ""
    """Why they can or cannot be compared, or why there is no figure of ours."""
    status: Status = "measured"


@dataclass(frozen=True)
class Reproduction:
    """All figures of a paper that a corpus allows, and those that it does not."""

    paper: str
    reference: str
    setting: str
    """What our figures were measured on."""
    findings: tuple[Finding, ...]

    def markdown(self) -> str:
        """A table, then what is missing."""
        lines = [f"# {self.paper}: {self.reference}", "", self.setting, ""]
        lines += ["| where | what | paper | ours | comparable |", "| --- | --- | ---: | ---: | --- |"]
        for one in self.findings:
            if one.status == "measured":
                verdict = f"{'yes' if one.comparable else 'no'}: {one.why}"
                lines.append(f"| {one.where} | {one.what} | {one.paper} | {one.ours} | {verdict} |")
        for status in ("not available", "not implemented"):
            missing = [one for one in self.findings if one.status == status]
            if missing:
                lines += ["", f"{status.capitalize()} here:", ""]
                lines += [f"- {one.where}, {one.what} (paper: {one.paper}): {one.why}" for one in missing]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """A line for each figure."""
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows([asdict(one) | {"comparable": "yes" if one.comparable else "no"} for one in self.findings])
        return text.getvalue()


def not_implemented(where: str, what: str, paper: str, why: str) -> Finding:
    """A figure for which the method is missing."""
    return Finding(where, what, paper, why=why, status="not implemented")


def not_available(where: str, what: str, paper: str, why: str) -> Finding:
    """A figure that this corpus cannot give."""
    return Finding(where, what, paper, why=why, status="not available")


def values(numbers: Sequence[float], form: str = "{:.3g}") -> str:
    """Numbers in a cell."""
    return " / ".join(form.format(number) for number in numbers)
