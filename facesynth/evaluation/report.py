"""The report: one page for a browser that needs no network, and the same as files."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.atomic import write_text
from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation import figures
from facesynth.evaluation.compare import Evaluation
from facesynth.evaluation.contestants import SAME_WORDS, SECOND_TAKE, Family, is_recorded, references
from facesynth.evaluation.curve import LIVELY, MEASURES, Curve, Measure, Point
from facesynth.evaluation.curve_figure import curve_figure
from facesynth.evaluation.details import Details
from facesynth.evaluation.drawing import RECORDED, head_figure
from facesynth.evaluation.exports import best_labels, write_exports
from facesynth.evaluation.face_video import worst_shown, write_side_by_side
from facesynth.evaluation.family_figure import family_figure
from facesynth.evaluation.metrics import DEFINITIONS
from facesynth.evaluation.pair import Array
from facesynth.evaluation.paired import statements, tallied
from facesynth.evaluation.point_face import PointFace
from facesynth.evaluation.table import ARROWS, Comparison, short_number
from facesynth.evaluation.trajectories import MOST_SHOWN, trajectory_figure
from facesynth.evaluation.verdict import verdicts
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.progress import track

PAGE = "index.html"
MOST_PANELS = 5
MOST_IN_WORDS = 9
"""Of more rows a sentence each would be read by nobody."""
SHOWN_LAST = ("tcn", "ridge", SAME_WORDS, SECOND_TAKE, "phone mean", "mean face")
"""Rows that are drawn where there is room, in this order: the less they move, the later."""
SHAPE_FRAMES = 4000
"""Recorded frames from which the shape at rest comes."""


@dataclass(frozen=True)
class Wish:
    """How a page is wanted."""

    title: str
    shown: tuple[str, ...] = ()
    """Ids of the utterances to draw; none: the median one and the worst one of the first method."""
    videos: bool = True


def require_drawing() -> None:
    """FacesynthError where the packages that draw the page are not installed; said before hours of training."""
    for package in ("matplotlib", "jinja2", "PIL"):
        if find_spec(package) is None:
            raise FacesynthError(f"a report needs {package}; install it with: pip install 'facesynth[report]'")


def write_report(folder: str | Path, result: Evaluation, corpus: Corpus, families: Sequence[Family], wish: Wish) -> Path:
    """Write the page and its files into a folder; returns the page."""
    from jinja2 import Environment, PackageLoader

    require_drawing()
    folder = Path(folder)
    write_exports(folder, result, families)
    page = Environment(loader=PackageLoader("facesynth.evaluation", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    text = page.get_template("report.html").render(_contents(result, corpus, families, wish))
    write_text(folder / PAGE, text)
    return folder / PAGE


def _contents(result: Evaluation, corpus: Corpus, families: Sequence[Family], wish: Wish) -> dict[str, Any]:
    comparison, unit, pictured = result.comparison, corpus.layout.unit, pictured_rows(result.comparison, families)
    details = {label: one for label, one in result.details.items() if label in pictured}
    colours = figures.colour_of([*pictured, *(family.curve for family in families if family.curve)])
    recorded = _some_frames(corpus, comparison.utterances)
    face = PointFace.of(corpus.layout, recorded)
    matrices = {row.label: row.confusion for row in comparison.rows if row.confusion and row.label in pictured}
    if comparison.recorded_emotions:
        matrices = {"recorded": comparison.recorded_emotions, **matrices}
    return {
        "wish": wish,
        "synthetic": corpus.synthetic,
        "main": _tables(comparison, result.main_columns()),
        "whole": _tables(comparison, [column.name for column in comparison.columns]),
        "notes": result.warnings() + comparison.notes(result.main_columns()),
        "whole_notes": comparison.notes([column.name for column in comparison.columns]),
        "verdicts": verdicts(result),
        "many": len(comparison.rows) > MOST_IN_WORDS,
        "left_out": len(comparison.rows) - len(pictured),
        "statements": statements(result.differences),
        "tally": tallied(result.differences),
        "differences": result.differences,
        "emotions": _by_emotion(comparison, result.main_columns(), pictured),
        "phones": _phones(details),
        **_curves(result, families, unit, colours),
        "face": figures.face_figure(details, face, unit),
        "histograms": figures.histogram_figure(details, unit, colours),
        "confusions": figures.confusion_figure(matrices),
        "families": [(family, family_figure(comparison, family)) for family in families],
        "shown": list(_shown(result, corpus, face, wish, colours)),
        "provenance": comparison.provenance,
        "made_of": {label: accounts for label, accounts in result.accounts.items() if accounts},
        "definitions": {c.name: DEFINITIONS[c.name] for c in comparison.columns if c.name in DEFINITIONS},
        "unit": unit,
    }


def pictured_rows(comparison: Comparison, families: Sequence[Family]) -> list[str]:
    """Rows that have pictures of their own: all but the variants, whose families have theirs.

    Where there are variants and reference rows alone, the first of each family is drawn for it.
    """
    variants = {label for family in families for label in family.labels}
    rows = [row.label for row in comparison.rows]
    named = [label for label in rows if label not in variants]
    if {label for label in named if not is_recorded(label)} - {one.label for one in references()}:
        return named
    firsts = {family.labels[0] for family in families}
    return [label for label in rows if label in firsts or label not in variants]


def table(comparison: Comparison, columns: Sequence[str], labels: Sequence[str] | None = None) -> dict[str, Any]:
    """Heads and rows of cells: text, interval, whether it is the best; all rows, or those with `labels`."""
    chosen = [column for column in comparison.columns if column.name in columns]
    best = {column.name: best_labels(comparison, column.name, column.best) for column in chosen}
    rows = []
    for row in (row for row in comparison.rows if labels is None or row.label in labels):
        scores = [comparison.scores[row.label][column.name] for column in chosen]
        cells = [
            (*str(s).partition(" [")[::2], row.label in best[c.name], s.utterances) for c, s in zip(chosen, scores, strict=True)
        ]
        rows.append((row.label, cells))
    heads = [(column.name, "" if column.unit == "1" else column.unit, ARROWS[column.best]) for column in chosen]
    return {"heads": heads, "rows": rows}


def _tables(
    comparison: Comparison, columns: Sequence[str], labels: Sequence[str] | None = None
) -> list[tuple[str, dict[str, Any]]]:
    """With titles, a table of the rows that have all utterances, and for rows that lack some one of what they have."""
    (_, whole), *partial = comparison.tables()
    spoken = comparison.measured(columns)
    return [("", table(whole, columns, labels)), *((title, table(part, spoken, labels)) for title, part in partial)]


def _by_emotion(
    comparison: Comparison, columns: Sequence[str], labels: Sequence[str]
) -> dict[str, list[tuple[str, dict[str, Any]]]]:
    found = dict.fromkeys(sorted(comparison.emotions))
    if len(found) < 2:
        return {}
    quality = comparison.measured(columns)
    return {emotion: _tables(comparison.of_emotion(emotion), quality, labels) for emotion in found}


def _curves(result: Evaluation, families: Sequence[Family], unit: str, colours: Mapping[str, str]) -> dict[str, Any]:
    """The picture of all curves, and for each curve the nearest and the best lively point by both errors.

    Variants of a family that is no single method are left out: they have a picture of their own.
    """
    curves = [curve for curve in result.curves(families) if curve.label in colours]
    known = (*(one.label for one in references()), SECOND_TAKE, SAME_WORDS)
    rows = [
        (
            curve.label,
            [_best(curve, point, measure) for measure in MEASURES for point in (curve.nearest(measure), curve.lively(measure))],
        )
        for curve in curves
    ]
    return {"trade": curve_figure(curves, known, unit, colours) if curves else "", "curves": rows, "lively": LIVELY}


def _best(curve: Curve, point: Point | None, measure: Measure) -> tuple[str, str]:
    """A point in words, and what it takes."""
    if point is None:
        return "—", ""
    sharpened = f"sharpened {point.sharpening:g}" if point.sharpening else ""
    takes = [part for part in (point.setting if point.setting != curve.label else "", sharpened) if part]
    return f"{short_number(getattr(point, measure))} at {point.energy_ratio:.2f}", ", ".join(takes)


def _phones(details: Mapping[str, Details]) -> dict[str, Any]:
    """For each phone its count, and for each method the lip error before and after alignment in time."""
    rows: dict[str, dict[str, tuple[float, float]]] = {}
    counts: dict[str, int] = {}
    for label, one in details.items():
        for phone in one.phones:
            rows.setdefault(phone.phone, {})[label] = (phone.lip_error, phone.aligned_lip_error)
            counts[phone.phone] = max(counts.get(phone.phone, 0), phone.count)
    order = sorted(rows, key=lambda phone: (-counts[phone], phone))
    return {
        "labels": [label for label, one in details.items() if one.phones],
        "rows": [(p, counts[p], rows[p]) for p in order],
    }


def _shown(
    result: Evaluation, corpus: Corpus, face: PointFace, wish: Wish, colours: Mapping[str, str]
) -> Iterator[dict[str, str]]:
    """What is drawn of chosen utterances, of the rows that have a colour."""
    labels = [row.label for row in result.comparison.rows if row.label in colours]
    order = sorted(labels, key=lambda label: SHOWN_LAST.index(label) if label in SHOWN_LAST else -1)
    worst = worst_shown(np.concatenate([one.points for one in result.details.values()]))
    for utterance_id in track(wish.shown or typical(result), "pictures"):
        utterance = corpus[utterance_id]
        motions = {label: made for label in order if (made := result.sources.motion(corpus, label, utterance_id))}
        faces = {label: made for label, made in motions.items() if len(result.details[label].points)}
        drawn = {label: faces[label] for label in labels if label in islice(faces, MOST_SHOWN)}
        yield {
            "id": utterance_id,
            "text": utterance.speech.text,
            "emotion": utterance.emotion,
            "trajectories": trajectory_figure(utterance, drawn, colours),
            "heads": _heads(utterance, motions),
            "video": _video(utterance_id, corpus, dict(islice(faces.items(), MOST_PANELS)), face, worst) if wish.videos else "",
        }


def _heads(utterance: Utterance, motions: Mapping[str, Motion]) -> str:
    """The heads of an utterance; nothing where nobody recorded one, or no method moves one."""
    recorded = utterance.motion.head
    moved = {label: one.head for label, one in motions.items() if one.head is not None and not is_recorded(label)}
    if recorded is None or not moved:
        return ""
    heads = {RECORDED: recorded, **dict(islice(moved.items(), MOST_SHOWN))}
    return head_figure(utterance.motion.fps, {label: np.nan_to_num(head).astype(np.float64) for label, head in heads.items()})


def _video(utterance_id: str, corpus: Corpus, motions: Mapping[str, Motion], face: PointFace, worst: float) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "side_by_side.mp4"
        write_side_by_side(path, corpus[utterance_id], motions, face, worst)
        return figures.data_uri("video/mp4", path.read_bytes())


def typical(result: Evaluation) -> tuple[str, ...]:
    """The utterances at the median and at the top of the first method's lip error."""
    comparison = result.comparison
    first = next((row for row in comparison.rows if not is_recorded(row.label)), comparison.rows[0])
    values = np.asarray(first.values.get("lve", first.values.get("marker_error", ())), np.float64)
    known = np.flatnonzero(~np.isnan(values))
    if not len(known):
        return comparison.utterances[:1]
    order = known[np.argsort(values[known], kind="stable")]
    return tuple(dict.fromkeys(comparison.utterances[i] for i in (order[len(order) // 2], order[-1])))


def _some_frames(corpus: Corpus, ids: Sequence[str]) -> Array:
    """[T, C] recorded frames of a few of the tested utterances."""
    found: list[Array] = []
    for utterance_id in ids[:: max(1, len(ids) // 12)]:
        found.append(corpus[utterance_id].motion.frames.astype(np.float64))
        if sum(map(len, found)) > SHAPE_FRAMES:
            break
    return np.concatenate(found)
