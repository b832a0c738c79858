"""The recordings of one performer together: the layout that most share, what its points are, and the face at rest."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import write_text
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.importers.axes import axes_by_names
from facesynth.corpus.importers.description import (
    Description,
    Written,
    description_beside,
    description_text,
    read_description,
    turned,
)
from facesynth.corpus.importers.formats import read
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.point_groups import guess_groups, spans_a_plane
from facesynth.motion.pose import remove_head

RECORDINGS = "recordings.yaml"
"""In a corpus: how the files of its performer are written."""
LOOKED_AT = 80
"""Frames of each recording, taken evenly, on which the face at rest is measured."""
CLOSED_SHARE = 0.15
"""Share of the frames, those in which the lips are nearest, that show the mouth at rest."""
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Preview:
    """What a recording is, at a glance."""

    layout: Layout
    fps: float
    frames: NDArray[np.float32]
    """[N, C] some of its frames."""
    states_groups: bool = False
    """Whether a layout file says which points belong together."""


@dataclass(frozen=True)
class Session:
    """What recordings of one performer have in common."""

    layout: Layout
    fps: float
    written: Written
    remarks: tuple[str, ...]
    """What was guessed."""


def survey(
    paths: Sequence[Path], description: Description | None = None, fps: float | None = None, workers: Workers = ALONE
) -> Session:
    """Look at every recording; the layout and the rate are those of most of them, the rest pose is measured on all.

    Groups of markers, facing lips and axes that nobody states are guessed, which the remarks say. FacesynthError where
    none can be read.
    """
    description = description or Description()
    results = list(spread(partial(_attempt, description=description, fps=fps), paths, workers, "looking at recordings"))
    previews = [result for result in results if isinstance(result, Preview)]
    if not previews:
        raise next((result for result in results if isinstance(result, FacesynthError)), FacesynthError("there is no recording"))
    layout, alike = _most_common(previews)
    rates = Counter(round(preview.fps, 6) for preview in alike)
    rate = min(rates, key=lambda rate: (-rates[rate], -rate))
    written, remarks = description.written, list[str]()
    frames = [_picked(preview, layout) for preview in alike]
    if layout.kind == "markers":
        layout, frames, axes, remarks = _completed(layout, frames, written.axes, any(preview.states_groups for preview in alike))
        written = replace(written, axes=axes)
    return Session(layout, rate, written, tuple(remarks))


def corpus_from_files(
    folder: Path,
    paths: Sequence[Path],
    header: Mapping[str, Any],
    *,
    description: Description | None = None,
    fps: float | None = None,
    workers: Workers = ALONE,
) -> tuple[Corpus, tuple[str, ...]]:
    """Make a corpus, still empty, for the performer of recordings of other systems, and say what was guessed.

    header: performer, emotions, licence, … of `Corpus.create`.
    """
    session = survey(paths, description, fps, workers)
    notes = {"notes": "; ".join(session.remarks)} if session.remarks else {}
    keep_written(folder, session.written)  # first: a run that is interrupted in between finds no corpus, and begins anew
    corpus = Corpus.create(folder, layout=session.layout, fps=session.fps, **{**notes, **header})
    return corpus, session.remarks


def keep_written(folder: Path, written: Written) -> None:
    """Keep with a corpus how the files of its performer are written, if anything is known of it."""
    if written != Written():
        write_text(folder / RECORDINGS, description_text(Description(None, written)))


def kept_written(folder: Path) -> Written:
    """How the files of a corpus' performer are written, as it was said or guessed when the corpus was made."""
    return read_description(folder / RECORDINGS).written if (folder / RECORDINGS).is_file() else Written()


def _attempt(path: Path, description: Description, fps: float | None) -> Preview | FacesynthError:
    try:
        motion = read(path, description.layout, fps, description.written).motion
    except FacesynthError as error:
        return error
    places = np.unique(np.linspace(0, len(motion) - 1, LOOKED_AT).round().astype(int))
    beside = description_beside(path)
    stated = description.layout or (beside.layout if beside else None)
    return Preview(motion.layout, motion.fps, motion.frames[places], bool(stated and stated.groups))


def _most_common(previews: Sequence[Preview]) -> tuple[Layout, list[Preview]]:
    """The layout of most recordings (of two as frequent, the one with more points), and those that have all of it."""
    counts = Counter((preview.layout.kind, frozenset(preview.layout.names)) for preview in previews)
    kind, names = min(counts, key=lambda key: (-counts[key], -len(key[1]), sorted(key[1])))
    layout = next(s.layout for s in previews if (s.layout.kind, frozenset(s.layout.names)) == (kind, names))
    return layout, [preview for preview in previews if preview.layout.kind == kind and names <= set(preview.layout.names)]


def _picked(preview: Preview, layout: Layout) -> Floats:
    """[N, K, dimension] frames in another order of points."""
    places = [preview.layout.names.index(name) for name in layout.names]
    return preview.layout.points(preview.frames)[:, places].astype(np.float64)


def _completed(
    layout: Layout, recordings: list[Floats], axes: str, states_groups: bool
) -> tuple[Layout, list[Floats], str, list[str]]:
    """A layout of markers with groups, facing lips and rest pose, the frames and axes that go with them, and remarks.

    Groups that a layout file states are not added to.
    """
    remarks: list[str] = []
    if not axes and (guessed := axes_by_names(layout.names, _together(recordings))):
        axes = guessed
        recordings = [turned(frames, axes) for frames in recordings]
        remarks.append(f"axes taken as {axes} (left, up, out of the face) by the markers' names; --axes says otherwise")
    guess = guess_groups(layout.names, _together(recordings))
    new = {name: members for name, members in guess.groups.items() if name not in layout.groups}
    if states_groups or (layout.groups and "rigid" not in layout.groups and guess.said != "by their names"):
        new = {}
    pairs = layout.lip_pairs or guess.lip_pairs
    if new or pairs != layout.lip_pairs:
        sizes = ", ".join(f"{name} {len(members)}" for name, members in new.items())
        remarks.append(f"groups of markers told {guess.said}: {sizes or 'none'}; facing pairs of the lips {len(pairs)}")
    layout = replace(layout, groups={**new, **layout.groups}, lip_pairs=pairs)
    if layout.neutral is None:
        rest = rest_pose(layout, recordings)
        layout = layout if rest is None else replace(layout, neutral=tuple(rest.ravel().tolist()))
    return layout, recordings, axes, remarks


def _together(recordings: Iterable[Floats]) -> Floats:
    return np.concatenate(list(recordings))


def rest_pose(layout: Layout, recordings: Sequence[Floats]) -> Floats | None:
    """[K, 3] the face at rest over recordings [N, K, 3] whose head may move: the median of their own.

    Each is laid on the others by its rigid points, so that one recording of another pose, or with swapped markers, does
    not move the rest. None where a marker is seen in none.
    """
    shapes = np.array([shape for frames in recordings if (shape := _own_rest(layout, frames)) is not None])
    if not len(shapes):
        return None
    rigid = np.array(layout.groups.get("rigid", range(len(layout.names))))
    if len(rigid) < 3 or not spans_a_plane(shapes[0][rigid]):
        return np.asarray(np.median(shapes, axis=0))
    apart = [np.median([np.abs(_laid(other, shape, rigid) - shape).mean() for other in shapes]) for shape in shapes[:LOOKED_AT]]
    rest = shapes[int(np.argmin(apart))]
    for _ in range(ROUNDS):
        rest = np.median([_laid(shape, rest, rigid) for shape in shapes], axis=0)
    return rest


def _laid(shape: Floats, rest: Floats, rigid: NDArray[np.int64]) -> Floats:
    return remove_head(shape[None], rest, rigid)[0][0].astype(np.float64)


def _own_rest(layout: Layout, frames: Floats) -> Floats | None:
    """[K, 3] the rest of one recording: without its head's motion, the median of frames with the lips nearest."""
    if not np.isfinite(frames).all(axis=2).any(axis=0).all():
        return None
    rest = np.nanmedian(frames, axis=0)
    rigid = np.array(layout.groups.get("rigid", range(len(layout.names))))
    if len(rigid) >= 3 and spans_a_plane(rest[rigid]):
        for _ in range(ROUNDS):
            moved, _ = remove_head(frames, rest, rigid)
            if np.isnan(moved).all(axis=(0, 2)).any():
                break
            rest = np.nanmedian(moved, axis=0).astype(np.float64)
        else:
            frames = moved.astype(np.float64)
    if not layout.lip_pairs:
        return rest
    upper, lower = np.array(layout.lip_pairs).T
    gap = np.linalg.norm(frames[:, upper] - frames[:, lower], axis=2).mean(axis=1)
    closed = gap <= np.nanquantile(gap, CLOSED_SHARE) if np.isfinite(gap).any() else np.zeros(len(gap), bool)
    shut = frames[closed]
    whole = np.isfinite(shut).any(axis=(0, 2)) if len(shut) else np.zeros(len(rest), bool)
    rest[whole] = np.nanmedian(shut[:, whole], axis=0)
    return rest
