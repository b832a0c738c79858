"""What a paper states, what came out here, and whether the two may be compared: never more than that."""

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from typing import Any, Literal

Status = Literal["measured", "not available", "not implemented"]
COLUMNS = ("where", "what", "paper", "ours", "comparable", "why", "status")


STYLE = "body{max-width:60em;margin:2em auto;font:15px/1.5 sans-serif}h2{font-size:1.05em;margin-top:2em}img{max-width:100%}"


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
    figure: str = ""
    """A picture as a data URI, for the page."""


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
        writer.writerows([plain(one) | {"comparable": "yes" if one.comparable else "no"} for one in self.findings])
        return text.getvalue()

    def written_as(self, suffix: str) -> str:
        """The content of a file: .html, .md or .csv."""
        return self.page() if suffix == ".html" else self.csv() if suffix == ".csv" else self.markdown()

    def to_dict(self) -> dict[str, Any]:
        """As JSON can hold it, without pictures."""
        return {**vars(self), "findings": [plain(one) for one in self.findings]}

    def page(self) -> str:
        """One page (HTML) that needs no other file: every figure of the paper with ours, and its picture where one is drawn."""
        shown = "\n".join(_section(one) for one in self.findings)
        head = f"<h1>{escape(self.paper)}</h1><p>{escape(self.reference)}</p><p>{escape(self.setting)}</p>"
        title = f'<meta charset="utf-8"><title>{escape(self.paper)}</title><style>{STYLE}</style>'
        return f'<!doctype html><html lang="en">{title}{head}\n{shown}</html>\n'


def plain(one: Finding) -> dict[str, Any]:
    """A finding without its picture."""
    return {key: value for key, value in asdict(one).items() if key != "figure"}


def _section(one: Finding) -> str:
    title = f"<h2>{escape(one.where)}: {escape(one.what)}</h2>"
    if one.status != "measured":
        return f"{title}<p>paper: {escape(one.paper)}; {one.status} here: {escape(one.why)}</p>"
    verdict = f"{'comparable' if one.comparable else 'not comparable'}: {escape(one.why)}"
    picture = f'<img src="{one.figure}" alt="{escape(one.what)}">' if one.figure else ""
    return f"{title}<p>paper: {escape(one.paper)}; ours: <b>{escape(one.ours)}</b></p><p>{verdict}</p>{picture}"


def not_implemented(where: str, what: str, paper: str, why: str) -> Finding:
    """A figure for which the method is missing."""
    return Finding(where, what, paper, why=why, status="not implemented")


def not_available(where: str, what: str, paper: str, why: str) -> Finding:
    """A figure that this corpus cannot give."""
    return Finding(where, what, paper, why=why, status="not available")


def values(numbers: Sequence[float], form: str = "{:.3g}") -> str:
    """Numbers in a cell."""
    return " / ".join(form.format(number) for number in numbers)
