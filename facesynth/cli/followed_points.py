"""`corpus add --points`: points that are followed in videos, for a model that shows the real face."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from facesynth.cli.options import grouped
from facesynth.cli.types import FILE
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from facesynth.corpus import Corpus
    from facesynth.corpus.add.add import AddReport


@dataclass(frozen=True)
class Followed:
    """Where the face is in the first picture, as it was given; it is found otherwise."""

    box: str | None
    mask: Path | None

    def corpus(self, folder: Path, files: tuple[Path, ...], header: Mapping[str, Any], face: int | None) -> Corpus:
        """A new corpus of points followed in videos."""
        from facesynth.capture.points.finding import read_mask
        from facesynth.corpus.importers.points import Where, corpus_from_points

        where = Where(_numbers(self.box) if self.box else None, read_mask(self.mask) if self.mask else None, face)
        return corpus_from_points(folder, files, header, where)


points_followed = grouped(
    "followed",
    lambda points, box, mask: Followed(box, mask) if points or box or mask else None,
    points=click.option("--points", is_flag=True, help="Follow salient points of the lower face, to show the real face."),
    box=click.option("--box", help="With --points: the face in the first picture, LEFT,TOP,RIGHT,BOTTOM px."),
    mask=click.option("--mask", type=FILE, help="With --points: PNG of that picture's size, the lower face in white."),
)
"""The options --points, --box and --mask, which the command gets as `followed`: None where no points are."""


def _numbers(box: str) -> tuple[float, ...]:
    try:
        left, top, right, bottom = (float(number) for number in box.split(","))
    except ValueError:
        raise FacesynthError(f"--box wants LEFT,TOP,RIGHT,BOTTOM in pixels, such as 100,60,225,242; got {box!r}") from None
    return left, top, right, bottom


def require_points(corpus: Corpus, points: bool) -> None:
    """FacesynthError where points were asked for and the corpus is one of something else."""
    from facesynth.motion.planar import is_tracked

    if points and not is_tracked(corpus.layout):
        raise FacesynthError(f"{corpus.path} is a corpus of {corpus.layout.kind}; followed points need a corpus of their own")


def keep_videos_of(corpus: Corpus, files: Iterable[Path], report: AddReport, utterance_id: str | None) -> None:
    """The pictures of followed points stay with the corpus: the face is drawn from them."""
    from facesynth.motion.planar import is_tracked

    if not is_tracked(corpus.layout):
        return
    from facesynth.corpus.add.recordings import VIDEO, find_recordings
    from facesynth.corpus.importers.points import forget_videos, keep_videos

    ids = {*report.added, *report.changed, *report.unchanged}
    videos = {utterance_id or r.name: r.motion for r in find_recordings(files)[0] if r.motion.suffix.lower() in VIDEO}
    forget_videos(corpus, [name for name, parts in report.changed.items() if "motion" in parts])
    keep_videos(corpus, {name: videos[name] for name in sorted(ids) if name in videos})
