"""Cao, Tien, Faloutsos and Pighin 2005."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from facesynth.evaluation.cost import stopwatch
from facesynth.evaluation.drawing import RECORDED, bars_figure, lines_figure, tracks_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2008 import Stated, trajectories
from facesynth.evaluation.papers.figure import Figure, absent
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.evaluation.papers.joined import joined, phones_until
from facesynth.evaluation.trajectories import shown_channels
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.parallel import take_of
from facesynth.methods.anime_graph.report import MapTrial, learner
from facesynth.methods.emotion.clips import clips_of_corpus
from facesynth.methods.emotion.tables import COEFFICIENTS, Recognition, Split, table_one

TABLE: dict[tuple[Split, str], tuple[float, ...]] = {
    ("train = test", "linear"): (94.06, 99.17, 100.0, 100.0),
    ("train = test", "radial"): (91.29, 96.40, 95.71, 96.27),
    ("random halves", "linear"): (88.95, 94.75, 96.96, 99.17),
    ("random halves", "radial"): (85.63, 91.43, 90.88, 91.16),
}
"""Table I: per cent recognised by 50, 100, 500, 1000 coefficients."""
MAP_ERROR = 0.0117
MAPPED = "emotion map on a sentence left out, unit-cube RMS"
PAIR = ("neutral", "happy")
LONGEST_S = 62


@lru_cache(maxsize=1)
def learned(material: Material) -> AnimeGraph:
    """The paper's model, which several figures share."""
    return AnimeGraph().fit(material.train, seed=material.seed)


def recognition(material: Material) -> list[Finding]:
    """Table I, and the same by sentence, which the paper does not report."""
    what = f"emotions recognised from speech by {values(COEFFICIENTS, '{:.0f}')} coefficients"
    emotions = {record.emotion for record in material.train.usable_records}
    if len(emotions) < 2:
        raise FacesynthError("the recordings have a single emotion")
    rows = table_one(clips_of_corpus(material.train))
    found = [_recognition(rows, split, kernel, what, len(emotions)) for split, kernel in _kinds(rows)]
    lines = {f"{kernel}, {split}": (COEFFICIENTS, _accuracies(rows, split, kernel)) for split, kernel in _kinds(rows)}
    picture = lines_figure(lines, "coefficients", "recognised, %", ylim=(0, 102))
    return [replace(found[0], figure=picture), *found[1:]]


def _kinds(rows: list[Recognition]) -> list[tuple[Split, str]]:
    return list(dict.fromkeys((row.split, row.settings.kernel) for row in rows))


def _accuracies(rows: list[Recognition], split: Split, kernel: str) -> list[float]:
    """Per cent, by the number of coefficients."""
    return [row.accuracy * 100 for row in rows if (row.split, row.settings.kernel) == (split, kernel)]


def _recognition(rows: list[Recognition], split: Split, kernel: str, what: str, emotions: int) -> Finding:
    mine = _accuracies(rows, split, kernel)
    known = TABLE.get((split, kernel))
    why = f"another voice, {emotions} emotions in place of 5" + ("" if known else "; the paper does not report it")
    paper = values(known, "{:.1f} %") if known else "—"
    return Finding("table I", f"{what}, {kernel} kernel, {split}", paper, values(mine, "{:.1f} %"), False, why)


def mapping(material: Material) -> list[Finding]:
    """§5.2: neutral to happy, each sentence left out in turn or in ten groups; by kernel and width."""
    model, layout = learned(material), material.corpus.layout
    takes = [take for u in material.train if (take := take_of(u, model.components)) is not None]
    trial = MapTrial(takes, layout, learner(layout, variance=model.config["variance"], seed=material.seed))
    score = trial.score(*PAIR, seed=material.seed)
    why = f"one sentence there, mean of {score.sentences} here; {material.unlike}; what doing nothing scores is not said there"
    rows = {"unchanged motion": score.unchanged, "mean difference": score.mean_difference, **score.mapped}
    paper = {name: str(MAP_ERROR) for name in score.mapped}
    found = [
        Finding("§5.2", f"{MAPPED}, {name}", paper.get(name, "—"), f"{error:.4f}", False, why) for name, error in rows.items()
    ]
    pictures = bars_figure(rows, "unit-cube RMS"), _mapped_picture(trial, score.best, layout, material)
    shown = Finding("fig. 7", f"the first sentence, mapped by {score.best}", "frames", "drawn", False, why, figure=pictures[1])
    return [replace(found[0], figure=pictures[0]), *found[1:], shown]


def _mapped_picture(trial: MapTrial, name: str, layout: Layout, material: Material) -> str:
    """Two lip points of a sentence that was left out: said in neutral, mapped to happy, and recorded in happy."""
    neutral, recorded, mapped = trial.left_out(*PAIR, name, seed=material.seed)
    tracks = {"said in neutral": neutral, RECORDED: recorded, "mapped": mapped}
    panels = {
        label: {kind: frames[:, channel] for kind, frames in tracks.items()}
        for label, channel in shown_channels(layout, recorded)
    }
    return tracks_figure(material.corpus.fps, panels)


def graph(material: Material) -> list[Finding]:
    """§3 and §4.1: sizes."""
    minutes = sum(material.train.duration_s(i) for i in material.train.ids) / 60
    phones = sum(label != "pau" for u in material.train for label in u.speech.phones.labels)
    return [
        Finding("§3", "minutes of recordings", "53", f"{minutes:.1f}", False, "another corpus"),
        Finding("§4.1", "nodes of the graph", "about 10,000", str(phones), False, "another corpus"),
    ]


def longest(material: Material) -> list[Finding]:
    """§8: as long a speech as theirs, tested utterances one after the other."""
    model = learned(material)
    said = [utterance.speech for utterance in material.test]
    speech = joined(said, phones_until(said, LONGEST_S))
    model.synthesize(said[0])
    with stopwatch() as spent:
        motion = model.synthesize(speech)
    ours = f"{motion.duration_s:.0f} ({len(speech.phones)} phones), made in {spent.processor_s:.1f} s of the processor"
    why = "tested utterances one after the other; the paper tells no time"
    label, channel = shown_channels(motion.layout, motion.frames.astype(np.float64))[0]
    picture = tracks_figure(motion.fps, {label: {"anime graph": motion.frames[:, channel].astype(np.float64)}}, LONGEST_S)
    return [Finding("§8", "longest speech synthesised, s", f"{LONGEST_S}", ours, False, why, figure=picture)]


def spoken(material: Material) -> list[Finding]:
    """Lips of tested sentences over time, which the paper shows as frames."""
    model = learned(material)
    made = [(u, model.synthesize(u.speech, seed=material.seed)) for u in material.test]
    return trajectories(made, "fig. 1", "anime graph", Stated("frames", "not shown", "the paper shows frames alone"))


FIGURES: tuple[Figure, ...] = (
    Figure("fig. 1", "synthesised speech", "frames", spoken),
    Figure("§3", "minutes of recordings; nodes of the graph", "53; about 10,000", graph),
    Figure("§5.2", MAPPED, str(MAP_ERROR), mapping),
    Figure("table I", "emotions recognised from speech", "95 to 100 %", recognition),
    absent("figs 8, 9", "frames of a face", "pictures", "no number is given; `facesynth speak` makes such frames"),
    Figure("§8", "longest speech synthesised, s", f"{LONGEST_S}", longest),
)
"""What the page shows, in the paper's order."""
