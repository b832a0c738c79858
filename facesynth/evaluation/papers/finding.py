"""What a paper states, what came out here, and whether the two may be compared: never more than that."""

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from typing import Any, Literal

Status = Literal["measured", "not available"]
COLUMNS = ("where", "what", "paper", "ours", "comparable", "why", "status")


STYLE = (
    "body{max-width:66em;margin:2em auto;font:15px/1.5 sans-serif}h2{font-size:1.1em;margin-top:2.5em}img{max-width:100%}"
    "table{border-collapse:collapse}td,th{padding:.2em .8em .2em 0;text-align:left;vertical-align:top;border-top:1px solid #ddd}"
)


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
        if missing := [one for one in self.findings if one.status != "measured"]:
            lines += ["", "Not available here:", ""]
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
        """One page (HTML) that needs no other file: each figure of the paper with what was measured, and its pictures."""
        places = dict.fromkeys(one.where for one in self.findings)
        shown = "\n".join(_section(where, [one for one in self.findings if one.where == where]) for where in places)
        head = f"<h1>{escape(self.paper)}</h1><p>{escape(self.reference)}</p><p>{escape(self.setting)}</p>"
        title = f'<meta charset="utf-8"><title>{escape(self.paper)}</title><style>{STYLE}</style>'
        return f'<!doctype html><html lang="en">{title}{head}\n{shown}</html>\n'


def plain(one: Finding) -> dict[str, Any]:
    """A finding without its picture."""
    return {key: value for key, value in asdict(one).items() if key != "figure"}


def _section(where: str, findings: Sequence[Finding]) -> str:
    """A figure of the paper: what was measured of it, then its pictures."""
    head = "<tr><th></th><th>paper</th><th>ours</th><th>comparable</th></tr>"
    rows = "\n".join(map(_table_row, findings))
    pictures = "\n".join(f'<p><img src="{one.figure}" alt="{escape(one.what)}"></p>' for one in findings if one.figure)
    return f"<h2>{escape(where)}</h2><table>{head}\n{rows}</table>\n{pictures}"


def _table_row(one: Finding) -> str:
    cells = [escape(one.what), escape(one.paper)]
    if one.status != "measured":
        return f"<tr><td>{'</td><td>'.join(cells)}</td><td colspan=2>{one.status} here: {escape(one.why)}</td></tr>"
    cells += [f"<b>{escape(one.ours)}</b>", f"{'yes' if one.comparable else 'no'}: {escape(one.why)}"]
    return f"<tr><td>{'</td><td>'.join(cells)}</td></tr>"


def not_available(where: str, what: str, paper: str, why: str) -> Finding:
    """A figure that this corpus cannot give."""
    return Finding(where, what, paper, why=why, status="not available")


def values(numbers: Sequence[float], form: str = "{:.3g}") -> str:
    """Numbers in a cell."""
    return " / ".join(form.format(number) for number in numbers)
