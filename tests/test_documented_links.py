"""Links of README.md, the changes, docs/ and examples/: files and headings that they point to are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted(page for pattern in ("*.md", "docs/*.md", "examples/*/README.md") for page in ROOT.glob(pattern))
BLOCK = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)


def anchors(text):
    """Of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def dead_links(text, page):
    """Targets of a page's links that are not there; addresses of the network are not looked at."""
    for target in re.findall(r"\[[^\]]*\]\(([^)\s]+)\)", BLOCK.sub("", text)):
        name, _, heading = target.partition("#")
        to = page.parent / name if name else page
        if re.match(r"\w+:", target):
            continue
        if not to.exists() or (heading and heading not in anchors(text if to == page else to.read_text(encoding="utf-8"))):
            yield target


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_page_links_to_is_there(page):
    assert not list(dead_links(page.read_text(encoding="utf-8"), page))


def test_links_to_nothing_are_seen():
    text = "# One thing\n[a](#one-thing) [b](#another) [c](nowhere.md) [d](frontier.md#what-to-take) [e](frontier.md#nothing)"
    assert list(dead_links(text, ROOT / "docs" / "results.md")) == ["#another", "nowhere.md", "frontier.md#nothing"]
