"""Measure again what the cards of the packaged models state: python benchmarks/cards.py GRID_S1=… GRID_S26=… [--write] [MODEL …]

Each figure of a card has the command that prints it and a regular expression that finds it there. Words of a command that are
given here (GRID_S1, a corpus of that talker; DATA, the folder of recordings; …) are replaced by what they stand for; a command
with another word in capitals, whose recordings are not here, is told and left out. A command that several figures share runs
once. `--write` puts what was found into the cards; without, a figure that differs makes the exit status 1.
"""

import argparse
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import CARD
from facesynth.zoo.card import Figure, read_card, write_card
from facesynth.zoo.shelf import PACKAGED

ROOT = Path(__file__).parent.parent
RECORDINGS = re.compile(r"[A-Z][A-Z0-9_]+")
"""Words of a command that stand for recordings."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD=FOLDER|MODEL")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    places = dict(word.split("=", 1) for word in options.words if "=" in word)
    asked = [word for word in options.words if "=" not in word]
    cards = [path for path in sorted(PACKAGED.glob(f"*/{CARD}")) if not asked or path.parent.name in asked]
    differs = [path for path in cards if not again(path, places, write=options.write)]
    return int(bool(differs) and not options.write)


def again(path: Path, places: Mapping[str, str], *, write: bool) -> bool:
    """Measure the figures of a card; whether all that could be measured are as it states."""
    card = read_card(path)
    measured = replace(card, figures=tuple(told(path.parent.name, figure, measure(figure, places)) for figure in card.figures))
    if write and measured != card:
        write_card(path, measured)
    return measured == card


def measure(figure: Figure, places: Mapping[str, str]) -> Figure | None:
    """The figure as its command prints it now; None where its recordings are not here."""
    words = [places.get(word, word) for word in shlex.split(figure.command)]
    if any(RECORDINGS.fullmatch(word) for word in words):
        return None
    return replace(figure, value=value_in(output_of(tuple(words)), figure))


@cache
def output_of(words: tuple[str, ...]) -> str:
    """What a command of this repository prints."""
    command = [sys.executable, *words[1:]] if words[0] == "python" else [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise FacesynthError(f"{shlex.join(words)} failed: {done.stderr.strip().splitlines()[-1:]}")
    return done.stdout


def value_in(printed: str, figure: Figure) -> float:
    """The number that the figure's expression finds."""
    found = re.search(figure.found_by, printed) if figure.found_by else None
    if found is None:
        raise FacesynthError(f"{figure.command} printed nothing that {figure.found_by!r} finds: {figure.what}")
    return float(found.group(1))


def told(name: str, stated: Figure, measured: Figure | None) -> Figure:
    """The figure that holds, after it was printed: the measured one, or the stated one where none was."""
    if measured is None:
        print(f"{name}: {stated.what}: not measured, without the recordings of {stated.command}", flush=True)
        return stated
    change = "as stated" if stated.value == measured.value else f"stated {stated.value:g}"
    print(f"{name}: {measured.what}: {measured.value:g} ({change})", flush=True)
    return measured


if __name__ == "__main__":
    sys.exit(main())
