"""A real face that says clips which it did not learn from, measured on the drawn video: gaps, folds, jumps, teeth.

    facesynth corpus add actor/ clips/*.mp4 --points --text-file lines.csv
    facesynth corpus add plain/ clips/*.mp4 --points --box 100,60,225,242 --text-file lines.csv
    python benchmarks/real_face.py actor/ --before plain/ -o report/ [--folds 5] [--method lds]

A face whose place is said (`--box`) has followed points alone, and is drawn as before the lips were known. The face mesh
finds the lips in drawn and recorded video alike; millimetres take the outer corners of the eyes to be 90 mm apart.
"""

import argparse
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import write_text
from facesynth.capture.landmarks import LIP_PAIRS, LOWER_INNER, OUTER_CORNERS, OUTER_CORNERS_MM, UPPER_INNER
from facesynth.capture.points.footage import read_footage
from facesynth.capture.tracker import Tracker
from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.importers.points import kept_videos
from facesynth.evaluation.drawn_mouth import steps, sudden, teeth
from facesynth.face.texture.compose import Report, TexturedFace, ping_pong
from facesynth.inference.lips import bilabial_spans, heights_between
from facesynth.methods.registry import create
from facesynth.motion.planar import picture_points
from facesynth.progress import track
from facesynth.stage.speaker_pictures import closed_at_phones, speaker_of

BEFORE = {"jump_weight": 0.1, "fade_s": 0.0}
"""How pictures were chosen, and jumped, before the lips were known."""
MOUTH_PX = 24
"""Half the side of the head-fixed picture of the mouth, as the lips' width is 32 of its pixels."""
WAYS = ("before", "now", "recorded motion, before", "recorded motion, now")
"""The second two say the clip by its own recorded points, so that the drawing alone is judged."""
Pictures = NDArray[np.uint8]


@dataclass(frozen=True)
class Row:
    """Of one clip, recorded or drawn."""

    gaps_mm: tuple[float, ...]
    """Smallest gap at each p, b and m."""
    recorded_mm: tuple[float, ...]
    """The recorded ones of the same clip."""
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
    parser.add_argument("--before", type=Path, required=True, help="the same clips, added with --box")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--method", default="lds")
    options = parser.parse_args()
    rows: dict[str, list[Row]] = {name: [] for name in ("recorded", *WAYS)}
    corpus, plain = Corpus.open(options.corpus), Corpus.open(options.before)
    for train, test in track(list(corpus.folds(options.folds)), "folds"):
        made = {**drawn(plain, train.ids, test.ids, options.method, "before", **BEFORE)}
        made |= drawn(corpus, train.ids, test.ids, options.method, "now")
        for utterance in test:
            judge(utterance, read_footage(kept_videos(corpus)[utterance.id]).frames, made, rows, options.output)
    text = table(rows)
    write_text(options.output / "table.md", text)
    print(text)


def drawn(
    corpus: Corpus, train: tuple[str, ...], test: tuple[str, ...], method: str, when: str, **settings: float
) -> dict[str, dict[str, tuple[Pictures, Report]]]:
    """The pictures of each utterance of `test` on the face of `train`, by the recorded points and by a model's."""
    others = corpus.subset(train)
    model, speaker = create(method).fit(others), speaker_of(others)
    face = TexturedFace(speaker, **settings)
    made: dict[str, dict[str, tuple[Pictures, Report]]] = {way: {} for way in WAYS if when in way}
    for name in test:
        for way, clips in made.items():
            motion = corpus[name].motion
            if "recorded" not in way:
                speech = corpus[name].speech
                motion = closed_at_phones(model.synthesize(speech), speech.phones, speaker)
            report, behind = Report(), ping_pong(0, len(face.speaker.backgrounds), len(motion))
            clips[name] = np.stack(list(face.draw(picture_points(motion.frames), behind, report))), report
    return made


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
    gaps = {name: smallest_gaps(points, spans) for name, points in seen.items()}
    mouths = {name: mouth_pictures(clips[name], points) for name, points in seen.items()}
    moved = {name: steps(grey) for name, (grey, _) in mouths.items()}
    for name in clips:
        report = made[name][utterance.id][1] if name in made else Report()
        found = teeth(*mouths[name])
        own, recorded = (tuple(gaps[which].tolist()) for which in (name, "recorded"))
        jumpy = sudden(moved[name], moved["recorded"])
        drawing = (float(report.folded_triangles), float(report.jumps))
        rows[name].append(Row(own, recorded, *drawing, jumpy, found.left_over, found.blinking, report.real_time_factor))
    save_sheet(clips, seen, output / f"{utterance.id}.png")


def landmarks(frames: Pictures) -> NDArray[np.float64]:
    """[T, 468, 2] px; a picture in which no face is found has the points of the one before."""
    tracker, found = Tracker(), []
    for frame in frames:
        seen = tracker.follow(frame)
        found.append(seen.points[:, :2].astype(np.float64) if seen is not None else found[-1])
    return np.stack(found)


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
    names = [field.name for field in fields(Row)][2:]
    head = ["median smallest gap, mm", "median distance from the recorded one", *names]
    lines = ["| | " + " | ".join(head) + " |", "|---|" + "---:|" * len(head)]
    for name, some in rows.items():
        gaps, recorded = (np.concatenate([getattr(row, field) for row in some]) for field in ("gaps_mm", "recorded_mm"))
        values = [np.median(gaps), np.median(np.abs(gaps - recorded))]
        values += [np.nanmean([getattr(row, field) for row in some]) for field in names]
        lines.append(f"| {name} | " + " | ".join(f"{value:.3g}" for value in values) + " |")
    closures = sum(len(row.gaps_mm) for row in rows["now"])
    return f"{len(rows['now'])} clips, none of them learned from, {closures} closures\n\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
