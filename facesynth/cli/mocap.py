"""What a person says of mocap and other files: --layout, --fps, --axes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import grouped
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus import Corpus
    from facesynth.corpus.importers.description import Description
    from facesynth.corpus.workers import Workers
    from facesynth.inference.layout import Layout


@dataclass(frozen=True)
class Said:
    """The options as they were given."""

    layout_file: Path | None = None
    fps: float | None = None
    axes: str = ""

    def description(self) -> Description:
        """The layout file, and --axes before what it says of them."""
        from facesynth.corpus.importers.description import Description, Written, read_description

        found = read_description(self.layout_file) if self.layout_file else Description()
        return replace(found, written=Written(axes=self.axes).over(found.written))

    def corpus(
        self, folder: Path, files: Iterable[Path], header: Mapping[str, Any], workers: Workers
    ) -> tuple[Corpus, tuple[str, ...]] | None:
        """A new corpus that fits the motion files among recordings, and what was guessed; None where most are videos."""
        from facesynth.corpus.add.recordings import VIDEO, find_recordings
        from facesynth.corpus.importers.session import corpus_from_files

        motions = [recording.motion for recording in find_recordings(files)[0]]
        mocap = [path for path in motions if path.suffix.lower() not in VIDEO]
        if not mocap or (self.layout_file is None and 2 * len(mocap) <= len(motions)):
            return None
        return corpus_from_files(folder, mocap, header, description=self.description(), fps=self.fps, workers=workers)

    def require_nothing(self) -> None:
        """FacesynthError where the corpus is there: what its files are was said when it was made."""
        if self != Said():
            raise FacesynthError(
                "--layout, --fps and --axes are for a new corpus, which keeps them (recordings.yaml); for files that differ"
                " lay a layout.yaml beside them"
            )


LAYOUT_HELP = "YAML or JSON: names and groups of channels, how files are written; what files say themselves, otherwise."
AXES_HELP = "Mocap: the files' axes that run to the performer's left, up, and out of the face, such as x,z,-y."
said_of_files = grouped(
    "said",
    Said,
    layout_file=click.option("--layout", "layout_file", type=FILE, help=LAYOUT_HELP),
    fps=click.option("--fps", type=click.FloatRange(1, 1000), help="Rate of files that do not state theirs."),
    axes=click.option("--axes", default="", help=AXES_HELP),
)
"""The options --layout, --fps and --axes, which the command gets as `said`."""


def read_layout(path: Path) -> Layout:
    """The layout of a layout file."""
    from facesynth.corpus.importers.description import read_description

    layout = read_description(path).layout
    if layout is None:
        raise FacesynthError(f"{path}: a layout needs kind and names")
    return layout


def keep_written_of(folder: Path, layout_file: Path) -> None:
    """How files are written stays with the corpus whose layout file says it."""
    from facesynth.corpus.importers.description import read_description
    from facesynth.corpus.importers.session import keep_written

    keep_written(folder, read_description(layout_file).written)
