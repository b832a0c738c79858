"""A real face that says clips which it did not learn from, measured on the drawn video: gaps, folds, jumps, teeth.

    facesynth corpus add actor/ clips/*.mp4 --points --text-file lines.csv
    facesynth corpus add plain/ clips/*.mp4 --points --box 100,60,225,242 --text-file lines.csv
    python benchmarks/real_face.py actor/ lds network efase:configs/efase_soft.yaml --before plain/ -o report/ [--first 3]

A row for each method, and one of the recorded motion, so that the drawing alone is judged; of the first method and of the
recorded motion also as they were drawn before: a face whose place is said (`--box`) has followed points alone, and is drawn
as before the lips were known. How far lips are apart is read from what is seen between them, in drawn and recorded video alike,
by a ruler that learned from the recorded clips of the other folds (`benchmarks/lip_ruler.py`: how well); millimetres take the
outer corners of the eyes to be 90 mm apart. What methods make is kept in `report/motions`, what was measured of a clip in
`report/rows`: a second run learns and draws only the rows that are not there (its `*.png` show these alone), so remove what
another version made.
"""

import argparse
import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import write_text
from facesynth.capture.landmarks import LOWER_INNER, OUTER_CORNERS, UPPER_INNER
from facesynth.capture.lip_ruler import LipRuler, Samples, line, mesh_gaps, mm_per_px
from facesynth.capture.points.footage import read_footage
from facesynth.capture.tracker import Tracker
from facesynth.corpus import Corpus
from facesynth.corpus.importers.points import kept_videos
from facesynth.evaluation.contestants import Contestant, contestant
from facesynth.evaluation.drawn_mouth import steps, sudden, teeth
from facesynth.evaluation.predictions import load_prediction, save_prediction
from facesynth.face.texture.compose import Report, TexturedFace, ping_pong
from facesynth.face.texture.speaker import Speaker
from facesynth.inference.lips import bilabial_spans
from facesynth.inference.motion import Motion
from facesynth.motion.planar import picture_points
from facesynth.progress import track
from facesynth.stage.speaker_pictures import closed_at_phones, speaker_of

BEFORE = {"jump_weight": 0.1, "fade_s": 0.0}
"""How pictures were chosen, and jumped, before the lips were known."""
MOUTH_PX = 24
"""Half the side of the head-fixed picture of the mouth, as the lips' width is 32 of its pixels."""
BEFORE_TOO = ", before"
RECORDED = "recorded motion"
"""The row that says a clip by its own recorded points."""
Pictures = NDArray[np.uint8]


@dataclass(frozen=True)
class Row:
    """Of one clip, recorded or drawn."""

    gaps_mm: list[float]
    """Smallest gap at each p, b and m, read from the pictures."""
    recorded_mm: list[float]
    """The recorded ones of the same clip."""
    mesh_mm: list[float]
    """The same by the face mesh, which hardly sees a slit between lips and has a gap where they are shut."""
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
    parser.add_argument("--first", type=int, help="test only so many of the folds")
    options = parser.parse_args()
    corpus, plain = Corpus.open(options.corpus), options.before and Corpus.open(options.before)
    methods, clips = [contestant(spec) for spec in options.methods], recorded_clips(corpus)
    before = [label + BEFORE_TOO for label in (methods[0].label, RECORDED)] if plain else []
    rows: dict[str, list[Row]] = {row: [] for row in ("recorded", *before, *(one.label for one in methods), RECORDED)}
    for train, test in track(list(corpus.folds(options.folds))[: options.first], "folds"):
        kept = [read_rows(options.output, name) for name in test.ids]
        if wanted := lacking(rows, kept):
            motions = options.output / "motions"
            made = drawn(plain, train.ids, test.ids, methods[:1], motions, wanted, BEFORE_TOO, **BEFORE) if plain else {}
            made |= drawn(corpus, train.ids, test.ids, methods, motions, wanted)
            ruler = LipRuler.learn([clips[name].samples for name in train.ids])
            kept = [judged(name, clips[name], ruler, made, options.output) for name in test.ids]
        for row, some in rows.items():
            some += [known[row] for known in kept]
        write_text(options.output / "table.md", table(rows))
    print(table(rows))


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recorded clip, seen once."""

    video: Path
    points: NDArray[np.float64]
    """[T, 468, 2] px the face mesh."""
    spans: list[tuple[int, int]]
    """Frames of each p, b and m."""
    samples: Samples

    def frames(self) -> Pictures:
        """[T, H, W, 3]"""
        return read_footage(self.video).frames


def recorded_clips(corpus: Corpus) -> dict[str, Recorded]:
    """Of each utterance."""
    out, videos = {}, kept_videos(corpus)
    for utterance in track(list(corpus), "looking at recorded clips"):
        frames = read_footage(videos[utterance.id]).frames
        points = landmarks(frames)
        said = bilabial_spans(utterance.speech.phones, utterance.motion.fps)
        spans = [(start, min(stop, len(frames))) for start, stop in said if start < min(stop, len(frames))]
        out[utterance.id] = Recorded(videos[utterance.id], points, spans, Samples.of(frames, points, spans))
    return out


def drawn(
    corpus: Corpus,
    train: tuple[str, ...],
    test: tuple[str, ...],
    methods: list[Contestant],
    kept: Path,
    wanted: set[str],
    when: str = "",
    **settings: Any,
) -> dict[str, dict[str, tuple[Pictures, Report]]]:
    """By row that is `wanted`: the pictures of each utterance of `test` on the face of `train`, by models of it and by the
    recorded points."""
    methods = [one for one in methods if one.label + when in wanted]
    if not methods and RECORDED + when not in wanted:
        return {}
    others = corpus.subset(train)
    speaker = speaker_of(others)
    face = TexturedFace(speaker, **settings)
    motions = {one.label + when: said(one, others, corpus.subset(test), speaker, kept / (one.label + when)) for one in methods}
    if RECORDED + when in wanted:
        motions[RECORDED + when] = {utterance.id: utterance.motion for utterance in corpus.subset(test)}
    return {row: {name: pictures(face, motion) for name, motion in some.items()} for row, some in motions.items()}


def said(method: Contestant, train: Corpus, test: Corpus, speaker: Speaker, kept: Path) -> dict[str, Motion]:
    """What a method makes of each utterance, its lips shut as where a real face speaks; read where it was `kept`."""
    paths = {utterance.id: kept / f"{utterance.id}.npz" for utterance in test}
    if all(path.is_file() for path in paths.values()):
        return {name: load_prediction(path)[1] for name, path in paths.items()}
    model = method.create().fit(train)
    made = {u.id: closed_at_phones(model.synthesize(u.speech), u.speech.phones, speaker) for u in test}
    for name, motion in made.items():
        save_prediction(paths[name], name, motion)
    return made


def pictures(face: TexturedFace, motion: Motion) -> tuple[Pictures, Report]:
    """A motion drawn over the speaker's calm clip."""
    report, behind = Report(), ping_pong(0, len(face.speaker.backgrounds), len(motion))
    return np.stack(list(face.draw(picture_points(motion.frames), behind, report))), report


def read_rows(output: Path, name: str) -> dict[str, Row]:
    """What was measured of a clip before, by what made it."""
    path = output / "rows" / f"{name}.json"
    return {row: Row(**values) for row, values in json.loads(path.read_text()).items()} if path.is_file() else {}


def lacking(rows: Collection[str], kept: list[dict[str, Row]]) -> set[str]:
    """Those of `rows` that were not measured of every clip."""
    return {row for row in rows if not all(row in known for known in kept)}


def judged(
    name: str, clip: Recorded, ruler: LipRuler, made: dict[str, dict[str, tuple[Pictures, Report]]], output: Path
) -> dict[str, Row]:
    """The rows of one clip, kept in `output`; and some of its pictures side by side, and those of p, b and m."""
    clips = {"recorded": clip.frames()} | {row: drawn[name][0] for row, drawn in made.items()}
    seen = {row: landmarks(frames) if row in made else clip.points for row, frames in clips.items()}
    closed = {row: smallest_gaps(gaps_by(ruler, clips[row], points, clip.spans), clip.spans) for row, points in seen.items()}
    mouths = {row: mouth_pictures(clips[row], points) for row, points in seen.items()}
    moved = {row: steps(grey) for row, (grey, _) in mouths.items()}
    rows = {}
    for row, (gaps, _) in closed.items():
        report = made[row][name][1] if row in made else Report()
        found = teeth(*mouths[row])
        rows[row] = Row(
            gaps,
            closed["recorded"][0],
            smallest_gaps(mesh_gaps(seen[row]), clip.spans)[0],
            float(report.folded_triangles),
            float(report.jumps),
            sudden(moved[row], moved["recorded"]),
            found.left_over,
            found.blinking,
            report.real_time_factor,
        )
    rows = read_rows(output, name) | rows
    write_text(output / "rows" / f"{name}.json", json.dumps({row: asdict(values) for row, values in rows.items()}))
    save_sheet(clips, seen, {row: list(range(12, len(clip.points) - 12, 4)) for row in clips}, output / f"{name}.png")
    save_sheet(clips, seen, {row: frames for row, (_, frames) in closed.items()}, output / f"{name}_closed.png")
    return rows


def landmarks(frames: Pictures) -> NDArray[np.float64]:
    """[T, 468, 2] px; a picture in which no face is found has the points of the one before."""
    tracker, found = Tracker(), list[NDArray[np.float64]]()
    for frame in frames:
        seen = tracker.follow(frame)
        found.append(seen.points[:, :2].astype(np.float64) if seen is not None else found[-1])
    return np.stack(found)


def gaps_by(ruler: LipRuler, frames: Pictures, points: NDArray[np.float64], spans: list[tuple[int, int]]) -> NDArray[np.float64]:
    """[T] mm between the lips in frames of the spans; infinite in others."""
    gaps, scale = np.full(len(frames), np.inf), mm_per_px(points)
    looked = sorted({t for span in spans for t in range(*span)})
    if looked:
        gaps[looked] = ruler.read(np.stack([line(frames[t], points[t], scale) for t in looked]))
    return gaps


def smallest_gaps(gaps: NDArray[np.float64], spans: list[tuple[int, int]]) -> tuple[list[float], list[int]]:
    """Of gaps [T] in each span, and the frames."""
    narrow = [start + int(gaps[start:stop].argmin()) for start, stop in spans]
    return gaps[narrow].tolist(), narrow


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


def save_sheet(clips: dict[str, Pictures], seen: dict[str, NDArray[np.float64]], shown: dict[str, list[int]], path: Path) -> None:
    """Mouths enlarged: a row for each way, of the frames `shown` of it."""
    from PIL import Image

    if not all(shown.values()):
        return
    lines = []
    for name, frames in clips.items():
        x, y = np.median(seen[name][:, [13, 14]].mean(axis=1), axis=0).round().astype(int)
        lines.append(np.concatenate([frames[t, y - 28 : y + 34, x - 34 : x + 34] for t in shown[name]], axis=1))
    sheet = Image.fromarray(np.concatenate(lines))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.resize((2 * sheet.width, 2 * sheet.height), Image.Resampling.BICUBIC).save(path)


def table(rows: dict[str, list[Row]]) -> str:
    """Markdown: gaps over all p, b and m of all clips, the others as means over clips."""
    names = [field.name for field in fields(Row)][3:]
    head = ["smallest gap at p, b, m, median, mm", "more than recorded, median", "distance from the recorded one, median"]
    head += ["smallest gap by the face mesh, median", *names]
    lines = ["| | " + " | ".join(head) + " |", "|---|" + "---:|" * len(head)]
    for name, some in rows.items():
        gaps, recorded, mesh = (np.concatenate([getattr(row, f) for row in some]) for f in ("gaps_mm", "recorded_mm", "mesh_mm"))
        values = [np.median(gaps), np.median(gaps - recorded), np.median(np.abs(gaps - recorded)), np.median(mesh)]
        values += [np.nanmean([getattr(row, field) for row in some]) for field in names]
        lines.append(f"| {name} | " + " | ".join(f"{value:.3g}" for value in values) + " |")
    closures = sum(len(row.gaps_mm) for row in rows["recorded"])
    return f"{len(rows['recorded'])} clips, none of them learned from, {closures} closures\n\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
