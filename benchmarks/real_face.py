"""A real face that says clips which it did not learn from, measured on the drawn video: gaps, folds, jumps, teeth.

    facesynth corpus add actor/ clips/*.mp4 --points --text-file lines.csv
    facesynth corpus add plain/ clips/*.mp4 --points --box 100,60,225,242 --text-file lines.csv
    python benchmarks/real_face.py actor/ lds network efase:configs/efase_soft.yaml --before plain/ -o report/ [--folds 5]

A row for each method, and one of the recorded motion, so that the drawing alone is judged; of the first method and of the
recorded motion also as they were drawn before: a face whose place is said (`--box`) has followed points alone, and is drawn
as before the lips were known. The face mesh finds the lips in drawn and recorded video alike; millimetres take the outer
corners of the eyes to be 90 mm apart.
"""

import argparse
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.atomic import write_text
from facesynth.capture.landmarks import LIP_PAIRS, LOWER_INNER, OUTER_CORNERS, OUTER_CORNERS_MM, UPPER_INNER
from facesynth.capture.points.footage import read_footage
from facesynth.capture.square import Square
from facesynth.capture.tracker import Tracker, around
from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.importers.points import kept_videos
from facesynth.evaluation.contestants import Contestant, contestant
from facesynth.evaluation.drawn_mouth import steps, sudden, teeth
from facesynth.face.texture.compose import Report, TexturedFace, ping_pong
from facesynth.face.texture.speaker import Speaker
from facesynth.inference.lips import bilabial_spans, heights_between
from facesynth.inference.motion import Motion
from facesynth.motion.planar import picture_points
from facesynth.progress import track
from facesynth.stage.speaker_pictures import closed_at_phones, speaker_of

BEFORE = {"jump_weight": 0.1, "fade_s": 0.0}
"""How pictures were chosen, and jumped, before the lips were known."""
MOUTH_PX = 24
"""Half the side of the head-fixed picture of the mouth, as the lips' width is 32 of its pixels."""
RECORDED = "recorded motion"
"""The row that says a clip by its own recorded points."""
STEADIED_FRAMES = 3.0
SHIFTS = ((0.0, 0.0), (0.02, 0.02), (-0.02, 0.02), (0.02, -0.02), (-0.02, -0.02))
"""Right and down, of the side of the square that is read."""
Pictures = NDArray[np.uint8]


@dataclass(frozen=True)
class Row:
    """Of one clip, recorded or drawn."""

    gaps_mm: tuple[float, ...]
    """Smallest gap at each p, b and m, pictures read in steady squares."""
    recorded_mm: tuple[float, ...]
    """The recorded ones of the same clip."""
    followed_mm: tuple[float, ...]
    """Smallest gap at each p, b and m where the square follows the face, as in capture."""
    folded: float
    """Triangles turned over, in all pictures."""
    jumps: float
    """Between recorded pictures."""
    sudden: float
    """Share of steps over three times the recorded median."""
    left_over: float
    blinking: float
    """See `facesynth.evaluation.drawn_mouth.Teeth`."""
    real_time: float
    """Seconds of drawing for a second of video, loaded or not: compare rows."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("methods", nargs="+", help="names, or NAME:settings.yaml")
    parser.add_argument("--before", type=Path, help="the same clips, added with --box")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--folds", type=int, default=5)
    options = parser.parse_args()
    rows: dict[str, list[Row]] = {}
    corpus, plain = Corpus.open(options.corpus), options.before and Corpus.open(options.before)
    methods = [contestant(spec) for spec in options.methods]
    for train, test in track(list(corpus.folds(options.folds)), "folds"):
        made = drawn(plain, train.ids, test.ids, methods[:1], ", before", **BEFORE) if plain else {}
        made |= drawn(corpus, train.ids, test.ids, methods)
        for utterance in test:
            judge(utterance, read_footage(kept_videos(corpus)[utterance.id]).frames, made, rows, options.output)
        write_text(options.output / "table.md", table(rows))
    print(table(rows))


def drawn(
    corpus: Corpus, train: tuple[str, ...], test: tuple[str, ...], methods: list[Contestant], when: str = "", **settings: Any
) -> dict[str, dict[str, tuple[Pictures, Report]]]:
    """By row: the pictures of each utterance of `test` on the face of `train`, by models of it and by the recorded points."""
    others = corpus.subset(train)
    speaker = speaker_of(others)
    face = TexturedFace(speaker, **settings)
    motions = {one.label + when: said(one, others, corpus.subset(test), speaker) for one in methods}
    motions[RECORDED + when] = {utterance.id: utterance.motion for utterance in corpus.subset(test)}
    return {row: {name: pictures(face, motion) for name, motion in some.items()} for row, some in motions.items()}


def said(method: Contestant, train: Corpus, test: Corpus, speaker: Speaker) -> dict[str, Motion]:
    """What a method makes of each utterance, its lips shut as where a real face speaks."""
    model = method.create().fit(train)
    return {u.id: closed_at_phones(model.synthesize(u.speech), u.speech.phones, speaker) for u in test}


def pictures(face: TexturedFace, motion: Motion) -> tuple[Pictures, Report]:
    """A motion drawn over the speaker's calm clip."""
    report, behind = Report(), ping_pong(0, len(face.speaker.backgrounds), len(motion))
    return np.stack(list(face.draw(picture_points(motion.frames), behind, report))), report


def judge(
    utterance: Utterance,
    real: Pictures,
    made: dict[str, dict[str, tuple[Pictures, Report]]],
    rows: dict[str, list[Row]],
    output: Path,
) -> None:
    """Add a row of one clip to each of `rows`, and save some of its pictures side by side."""
    clips = {"recorded": real} | {name: drawn[utterance.id][0] for name, drawn in made.items()}
    seen = {name: landmarks(frames) for name, frames in clips.items()}
    spans = [span for span in bilabial_spans(utterance.speech.phones, 25.0) if span[1] > span[0]]
    followed = {name: smallest_gaps(points, spans) for name, points in seen.items()}
    gaps = {name: smallest_gaps(read_again(clips[name], points, spans), spans) for name, points in seen.items()}
    mouths = {name: mouth_pictures(clips[name], points) for name, points in seen.items()}
    moved = {name: steps(grey) for name, (grey, _) in mouths.items()}
    for name in clips:
        report = made[name][utterance.id][1] if name in made else Report()
        found = teeth(*mouths[name])
        own, recorded = (tuple(gaps[which].tolist()) for which in (name, "recorded"))
        jumpy = sudden(moved[name], moved["recorded"])
        drawing = (float(report.folded_triangles), float(report.jumps))
        rows.setdefault(name, []).append(
            Row(
                own,
                recorded,
                tuple(followed[name].tolist()),
                *drawing,
                jumpy,
                found.left_over,
                found.blinking,
                report.real_time_factor,
            )
        )
    save_sheet(clips, seen, output / f"{utterance.id}.png")


def landmarks(frames: Pictures) -> NDArray[np.float64]:
    """[T, 468, 2] px; a picture in which no face is found has the points of the one before."""
    tracker, found = Tracker(), list[NDArray[np.float64]]()
    for frame in frames:
        seen = tracker.follow(frame)
        found.append(seen.points[:, :2].astype(np.float64) if seen is not None else found[-1])
    return np.stack(found)


def read_again(frames: Pictures, points: NDArray[np.float64], spans: list[tuple[int, int]]) -> NDArray[np.float64]:
    """Landmarks [T, 468, 2] like `points`, those of spans of frames anew: the mean of readings in squares that are steady.

    What the mesh finds in a picture changes by half a millimetre with the square that is cut out for it, and a square that
    follows the face has the size that the mouth had in the picture before.
    """
    tracker, found = Tracker(), points.copy()
    whole = around(np.median(points, axis=0))
    middles = gaussian_filter1d((points.min(axis=1) + points.max(axis=1)) / 2, STEADIED_FRAMES, axis=0, mode="nearest")
    for t in sorted({t for start, stop in spans for t in range(start, min(stop, len(frames)))}):
        (x, y), side = middles[t].tolist(), whole.side_px
        squares = [Square(x + right * side, y + down * side, side, whole.tilt_rad) for right, down in SHIFTS]
        seen = [looked.points[:, :2] for square in squares if (looked := tracker.look(frames[t], square)) is not None]
        found[t] = np.mean(seen, axis=0) if seen else points[t]
    return found


def smallest_gaps(points: NDArray[np.float64], spans: list[tuple[int, int]]) -> NDArray[np.float64]:
    """[S] mm"""
    across = points[:, OUTER_CORNERS[0]] - points[:, OUTER_CORNERS[1]]
    mm = OUTER_CORNERS_MM / np.linalg.norm(across, axis=1).mean()
    gap = -mm * heights_between(points, LIP_PAIRS).mean(axis=1)
    return np.array([gap[start : min(stop, len(gap))].min() for start, stop in spans if start < len(gap)])


def mouth_pictures(frames: Pictures, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """[T, h, w] brightness around the mouth, following the head (the eyes' corners), and where the inside of the lips is seen."""
    eyes = points[:, list(OUTER_CORNERS)].mean(axis=1)
    middle = np.median(points[:, [*UPPER_INNER, *LOWER_INNER]].mean(axis=1) - eyes, axis=0)
    side = np.arange(-MOUTH_PX, MOUTH_PX + 1)
    greys, insides = [], []
    for frame, point, eye in zip(frames, points, eyes, strict=True):
        place = np.stack(np.meshgrid(side, side), axis=-1) + eye + middle
        greys.append(_read(frame.mean(axis=2), place))
        insides.append(_inside(place, point))
    return np.stack(greys), np.stack(insides)


def _read(grey: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.ndimage import map_coordinates

    return np.asarray(map_coordinates(grey, [place[..., 1], place[..., 0]], order=1, mode="nearest"))


def _inside(place: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Between the inner lips, a pixel from each."""
    upper, lower = (point[list(row)] for row in (UPPER_INNER, (UPPER_INNER[0], *LOWER_INNER, UPPER_INNER[-1])))
    top, bottom = (np.interp(place[..., 0], *row[np.argsort(row[:, 0])].T) for row in (upper, lower))
    return np.asarray((place[..., 1] > top + 1) & (place[..., 1] < bottom - 1))


def save_sheet(clips: dict[str, Pictures], seen: dict[str, NDArray[np.float64]], path: Path, every: int = 4) -> None:
    """Mouths enlarged: a row for each way, every so many pictures of the spoken part."""
    from PIL import Image

    count = min(map(len, clips.values()))
    lines = []
    for name, frames in clips.items():
        x, y = np.median(seen[name][:, [13, 14]].mean(axis=1), axis=0).round().astype(int)
        crops = [frames[t, y - 28 : y + 34, x - 34 : x + 34] for t in range(12, count - 12, every)]
        lines.append(np.concatenate(crops, axis=1))
    sheet = Image.fromarray(np.concatenate(lines))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.resize((2 * sheet.width, 2 * sheet.height), Image.Resampling.BICUBIC).save(path)


def table(rows: dict[str, list[Row]]) -> str:
    """Markdown: gaps over all p, b and m of all clips, the others as means over clips."""
    names = [field.name for field in fields(Row)][3:]
    head = ["median smallest gap, mm", "median distance from the recorded one", "median where the square follows", *names]
    lines = ["| | " + " | ".join(head) + " |", "|---|" + "---:|" * len(head)]
    for name, some in rows.items():
        gaps, recorded, followed = (
            np.concatenate([getattr(row, field) for row in some]) for field in ("gaps_mm", "recorded_mm", "followed_mm")
        )
        values = [np.median(gaps), np.median(np.abs(gaps - recorded)), np.median(followed)]
        values += [np.nanmean([getattr(row, field) for row in some]) for field in names]
        lines.append(f"| {name} | " + " | ".join(f"{value:.3g}" for value in values) + " |")
    closures = sum(len(row.gaps_mm) for row in rows["recorded"])
    return f"{len(rows['recorded'])} clips, none of them learned from, {closures} closures\n\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
