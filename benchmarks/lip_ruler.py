"""How well the gap of lips is read from pictures: recorded pictures of shut lips, opened by known millimetres.

    python benchmarks/lip_ruler.py actor/ -o report/ [--folds 5]

`actor/` as in `real_face.py`. In each recorded picture in which p, b or m shuts the lips, these are moved apart, less towards
their corners, and what lies between them is dark, or teeth above darkness, in colours of the speaker's open mouth. It is read by
a ruler that learned from other clips, and by the face mesh: once, and as the mean of five looks in squares a little aside.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from real_face import Recorded, recorded_clips
from scipy.ndimage import gaussian_filter, map_coordinates

from facesynth.atomic import write_text
from facesynth.capture.landmarks import LIP_PAIRS, LOWER_INNER, UPPER_INNER
from facesynth.capture.lip_ruler import SHUT_UP_TO, LipRuler, line, line_colours, mesh_gaps, mm_per_px, skin_colour
from facesynth.capture.square import Square
from facesynth.capture.tracker import Tracker, around
from facesynth.corpus import Corpus
from facesynth.progress import track

OPENED_MM = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0)
FINE = 4
"""Rows to each row of a picture while it is opened."""
NEAR_PX, FAR_PX = 8.0, 26.0
"""Lips move as one up to so far from where they touch; beyond, nothing moves."""
SHIFTS = ((0.0, 0.0), (0.02, 0.02), (-0.02, 0.02), (0.02, -0.02), (-0.02, -0.02))
"""Right and down, of the side of the square that is read."""
READINGS = ("from the picture", "by the mesh", "by the mesh, five squares")
Picture = NDArray[np.uint8]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """Of one picture: how far it was opened, and by how much more its lips seem apart than before."""

    opened_mm: float
    kind: str
    more_mm: tuple[float, ...]
    """For each of READINGS."""
    shut_mm: tuple[float, ...]
    """What they read before."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--folds", type=int, default=5)
    options = parser.parse_args()
    corpus, readings = Corpus.open(options.corpus), list[Reading]()
    clips = recorded_clips(corpus)
    shut_mm = SHUT_UP_TO * float(np.median(np.concatenate([clip.samples.narrow_mm for clip in clips.values()])))
    for train, test in track(list(corpus.folds(options.folds)), "folds"):
        ruler = LipRuler.learn([clips[name].samples for name in train.ids])
        for name in test.ids:
            readings += readings_of(clips[name], ruler, shut_mm)
        write_text(options.output / "lip_ruler.md", table(readings))
    print(table(readings))


def readings_of(clip: Recorded, ruler: LipRuler, shut_mm: float) -> Iterator[Reading]:
    """All that is read of the pictures of one clip in which the mesh has lips no farther apart than `shut_mm`."""
    frames, scale = clip.frames(), mm_per_px(clip.points)
    gaps = mesh_gaps(clip.points)
    narrow = [start + int(gaps[start:stop].argmin()) for start, stop in clip.spans]
    if not len(clip.samples.inside):
        return
    dark, bright = np.quantile(clip.samples.inside.reshape(-1, 3), [0.1, 0.9], axis=0)
    for t in narrow:
        if gaps[t] > shut_mm:
            continue
        skin = skin_colour(line_colours(frames[t], clip.points[t], scale))
        shut = read(frames[t], clip.points[t], scale, ruler)
        for kind, colours in (("dark", np.stack([dark, dark])), ("teeth", np.stack([bright, bright, dark]))):
            for wide in OPENED_MM[1:]:
                picture, truly = opened(frames[t], clip.points[t], wide / scale, colours * skin)
                seen = read(picture, clip.points[t], scale, ruler)
                yield Reading(truly * scale, kind, tuple(np.subtract(seen, shut).tolist()), shut)


def read(picture: Picture, points: Points, scale: float, ruler: LipRuler) -> tuple[float, ...]:
    """mm, for each of READINGS, of a picture whose face was at `points` [468, 2]."""
    tracker, square = Tracker(), around(points.astype(np.float32))
    apart = ((square.x_px + x * square.side_px, square.y_px + y * square.side_px) for x, y in SHIFTS)
    looks = [tracker.look(picture, Square(x, y, square.side_px, square.tilt_rad)) for x, y in apart]
    found = np.stack([look.points[:, :2] for look in looks if look is not None]).astype(np.float64)
    mesh = mesh_gaps(found) * scale / mm_per_px(found)
    return float(ruler.read(line(picture, found[0], scale)[None])[0]), float(mesh[0]), float(mesh.mean())


def opened(picture: Picture, points: Points, gap_px: float, inside: NDArray[np.float64]) -> tuple[Picture, float]:
    """A picture of shut lips opened by `gap_px` in the middle, colours [D, 3] from the upper lip to the lower one between.

    And how far it is open, px, on average at the facing points that a gap is measured at.
    """
    left, right = sorted((points[UPPER_INNER[0], 0], points[UPPER_INNER[-1], 0]))
    middle, half = (left + right) / 2, (right - left) / 2
    columns = np.arange(int(left) - 2, int(right) + 3)
    touching, out = _contact(picture, points, columns), picture.astype(np.float64)
    top, bottom = int(touching.min() - FAR_PX), int(touching.max() + FAR_PX) + 1
    rows = np.arange(top, bottom, 1 / FINE) + 0.5 / FINE - 0.5
    for x, contact in zip(columns, touching, strict=True):
        away, wide = rows - contact, gap_px * _bow(float(x), middle, half) / 2
        moved = np.clip((FAR_PX - np.abs(away)) / (FAR_PX - NEAR_PX), 0, 1)
        source = rows - np.sign(away) * np.minimum(np.abs(away), wide * moved * moved * (3 - 2 * moved))
        column = np.stack([np.interp(source, np.arange(len(picture)), picture[:, x, k]) for k in range(3)], axis=-1)
        hole = np.abs(away) < wide
        down = (away[hole] + wide) / max(2 * wide, 1e-9) * (len(inside) - 1)
        column[hole] = inside[down.round().astype(int)]
        out[top:bottom, x] = column.reshape(-1, FINE, 3).mean(axis=1)
    box = (slice(top, bottom), slice(columns[0] - 2, columns[-1] + 3))
    out[box] = gaussian_filter(out[box], (0.4, 0.4, 0))
    truly = gap_px * np.mean([_bow(points[above, 0], middle, half) for above, _ in LIP_PAIRS])
    return out.clip(0, 255).round().astype(np.uint8), float(truly)


def _bow(x: float, middle: float, half: float) -> float:
    return max(0.0, 1 - ((x - middle) / half) ** 2)


def _contact(picture: Picture, points: Points, columns: NDArray[np.int64]) -> NDArray[np.float64]:
    """[C] the row in which shut lips touch: the middle of the mesh's inner lips, shifted to where most rows are darkest."""
    lower = (UPPER_INNER[0], *LOWER_INNER, UPPER_INNER[-1])
    sides = [points[list(row)][np.argsort(points[list(row), 0])] for row in (UPPER_INNER, lower)]
    guess = np.mean([np.interp(columns, *side.T) for side in sides], axis=0)
    off = np.arange(-2.5, 2.6, 0.25)
    grey = gaussian_filter(picture.mean(axis=2), 0.5)
    seen = map_coordinates(grey, [guess[:, None] + off, np.broadcast_to(columns[:, None], (len(guess), len(off)))], order=1)
    return guess + float(np.median(off[seen.argmin(axis=1)]))


def table(readings: list[Reading]) -> str:
    """Markdown: median of what is read for what was opened, and the spread (standard deviation)."""
    shut = np.array([reading.shut_mm for reading in readings])
    lines = ["| opened by, mm | between the lips | " + " | ".join(READINGS) + " |", "|---:|---|" + "---:|" * len(READINGS)]
    lines.append("| not opened | | " + " | ".join(_cell(column) for column in np.unique(shut, axis=0).T) + " |")
    for kind in ("dark", "teeth"):
        for wide in OPENED_MM[1:]:
            some = [r for r in readings if r.kind == kind and 0.85 * wide < r.opened_mm <= wide]
            truly = np.mean([r.opened_mm for r in some])
            lines.append(
                f"| {truly:.2g} | {kind} | " + " | ".join(_cell(c) for c in np.array([r.more_mm for r in some]).T) + " |"
            )
    return "\n".join(lines) + "\n"


def _cell(values: NDArray[np.float64]) -> str:
    return f"{np.median(values):.2f} ({values.std():.2f})"


if __name__ == "__main__":
    main()
