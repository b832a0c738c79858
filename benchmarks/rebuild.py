"""Make packaged models again by the commands of their cards: python benchmarks/rebuild.py GRID_S1=… [MODEL …]

Words of a command that are given here are replaced by what they stand for, as by `benchmarks/cards.py`; a model whose recordings
are not here is told and left out. Each model is made in an empty folder and compared with the packaged one, file by file: the
same bytes, or which differ. A manifest counts as the same where nothing but versions of packages differs, and what hashes them.
Training takes one thread, since sums of several are rounded as they come. The exit status is 1 where a file differs. With
`--keep FOLDER` what was made stays there.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cards import RECORDINGS, ROOT

from facesynth.inference.folder import CARD, MANIFEST, place_of
from facesynth.zoo.card import read_card
from facesynth.zoo.shelf import PACKAGED


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD=FOLDER|MODEL")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    places = dict(word.split("=", 1) for word in options.words if "=" in word)
    asked = [word for word in options.words if "=" not in word]
    folders = [path.parent for path in sorted(PACKAGED.glob(f"*/{CARD}")) if not asked or path.parent.name in asked]
    with tempfile.TemporaryDirectory() as empty:
        differ = [folder for folder in folders if not same(folder, places, options.keep or Path(empty))]
        return int(bool(differ))


def same(folder: Path, places: Mapping[str, str], place: Path) -> bool:
    """Make one again in a folder of its own; whether its files are the same."""
    lines = [[places.get(word, word) for word in shlex.split(line)] for line in read_card(folder / CARD).rebuild.split("&&")]
    if lacking := sorted({word for line in lines for word in line if RECORDINGS.fullmatch(word)}):
        print(f"{folder.name}: not made, without {', '.join(lacking)}")
        return True
    own = place / folder.name
    own.mkdir(parents=True, exist_ok=True)
    for line in lines:
        run(line, own)
    made = own / folder.relative_to(ROOT)
    differ = [path.name for path in sorted(made.iterdir()) if not alike(path, place_of(folder, path.name))]
    print(f"{folder.name}: {'differs in ' + ', '.join(differ) if differ else 'the same'}", flush=True)
    return not differ


def run(words: list[str], place: Path) -> None:
    """A command of this repository, in a folder, on one thread."""
    program = [str(ROOT / words[1]), *words[2:]] if words[0] == "python" else ["-m", *words]
    own = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    subprocess.run([sys.executable, *program], cwd=place, check=True, env=own)


def alike(made: Path, packaged: Path) -> bool:
    """Whether both hold the same."""
    if made.name == MANIFEST:
        return without_versions(made) == without_versions(packaged)
    return packaged.is_file() and made.read_bytes() == packaged.read_bytes()


def without_versions(path: Path) -> Any:
    """A manifest without what another installation would write."""
    stated = json.loads(path.read_text(encoding="utf-8"))
    return {name: value for name, value in stated.items() if name not in ("versions", "sha256")}


if __name__ == "__main__":
    sys.exit(main())
