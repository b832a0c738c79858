"""Deng and Neumann 2008."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation.cost import stopwatch
from facesynth.evaluation.drawing import lines_figure, variance_figure
from facesynth.evaluation.figures import COLOURS
from facesynth.evaluation.geometry import deng_error, deng_errors
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.figure import Figure, absent
from facesynth.evaluation.papers.finding import Finding, not_available, values
from facesynth.evaluation.papers.joined import joined
from facesynth.evaluation.papers.phone_maps import maps
from facesynth.evaluation.trajectories import shown_channels, trajectory_figure
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning import PUBLISHED

Spoken = list[tuple[Utterance, Motion]]
"""Tested utterances, each with what was made for it."""

PHONES = (14, 24, 53, 63)
SECONDS = (221.391, 333.171, 815.719, 942.609)
SECONDS_GPU = (50.828, 90.891, 232.078, 256.484)


NAME = "eFASE"
EMOTIONS = ("neutral", "angry", "sad")
"""Of figure 10."""


@lru_cache(maxsize=1)
def published(material: Material) -> Efase:
    """The paper's model, which several figures share."""
    return Efase.from_config(PUBLISHED).fit(material.train, seed=material.seed)


@lru_cache(maxsize=1)
def spoken(material: Material) -> Spoken:
    """What that model says."""
    return [(u, published(material).synthesize(u.speech, seed=material.seed)) for u in material.test]


def database(material: Material, where: str) -> list[Finding]:
    """PCA and the count of nodes."""
    model = published(material)
    shares = model.pca.variance_ratio.cpu().numpy()
    share = float(model.pca.variance_ratio.sum())
    dimension = material.corpus.layout.channels
    what = f"variance in 25 of {dimension} dimensions (paper: of 270)"
    return [
        Finding(where, what, "98.53 %", f"{share:.2%}", False, material.unlike, figure=variance_figure(shares, len(shares))),
        Finding(where, "motion nodes", "5556", str(len(model.facts["names"])), False, "another amount of recordings"),
    ]


def times(material: Material, where: str, phones: tuple[int, ...], seconds: tuple[float, ...], hardware: str) -> list[Finding]:
    """Time of synthesis of as many phones as the paper's phrases have: tested utterances one after the other, cut there."""
    model = published(material)
    said = [utterance.speech for utterance in material.test]
    speeches = [joined(said, count) for count in phones]
    model.synthesize(speeches[0])
    took = [_seconds(model, speech) for speech in speeches]
    what = f"synthesis of {values(phones, '{:.0f}')} phones, s (ours: of the processor)"
    nodes = len(model.facts["names"])
    why = f"other hardware (paper: {hardware}), {nodes} nodes in place of 5556, another search of the same optimum"
    lines = {f"paper ({hardware})": (phones, seconds), "ours": (phones, took)}
    picture = lines_figure(lines, "phones", "s", yscale="log")
    return [Finding(where, what, values(seconds), values(took), False, why, figure=picture)]


def errors(material: Material) -> list[Finding]:
    """Eq. 13 of sentences in the emotions of figure 10; the picture shows the first of each."""
    made, unit = spoken(material), material.corpus.layout.unit
    found, lines = [], {}
    for emotion in EMOTIONS:
        pairs = [(motion, u.motion) for u, motion in made if u.emotion == emotion]
        what = f"error per frame (eq. 13), {emotion}, {unit}²"
        if not pairs:
            found.append(not_available("fig. 10", what, "a curve", f"the tested recordings have no {emotion} sentence"))
            continue
        ours = f"{np.mean([deng_error(*pair) for pair in pairs]):.3g} (mean of {len(pairs)} sentences)"
        found.append(
            Finding("fig. 10", what, "a curve for one sentence", ours, False, "the curve's scale cannot be read as a number")
        )
        lines[emotion] = (np.arange(len(pairs[0][0])), deng_errors(*pairs[0]))
    if lines:
        picture = lines_figure(lines, "frame", f"error, {unit}²", style="-")
        first = next(i for i, one in enumerate(found) if one.status == "measured")
        found[first] = replace(found[first], figure=picture)
    return found


@dataclass(frozen=True)
class Stated:
    """What a paper says of trajectories."""

    place: str = "quite close"
    velocity: str = "deviates more"
    why: str = "the paper shows one sentence, as a picture, and says that velocities deviate more"


def trajectories(made: Spoken, where: str, name: str = NAME, stated: Stated = Stated(), *, cheek: bool = False) -> list[Finding]:
    """How far a lip point's trajectory and velocity follow the recorded ones, as correlations; the first utterance is drawn.

    cheek: those of a cheek too, where the layout names one.
    """
    utterance, motion = made[0]
    try:
        channels = drawn_channels(utterance.motion, cheek=cheek)
    except UnavailableError as reason:
        return [not_available(where, "lip trajectory", "a picture", str(reason))]
    found = []
    for label, channel in channels:
        pairs = [(u.motion.frames[:, channel], motion.frames[:, channel]) for u, motion in made]
        place = np.mean([_correlation(truth, made) for truth, made in pairs])
        speed = np.mean([_correlation(np.diff(truth), np.diff(made)) for truth, made in pairs])
        slower = f"correlation of its velocity: {'lower' if speed < place else 'not lower'}"
        found.append(Finding(where, f"correlation of the trajectory of {label}", stated.place, f"{place:.2f}", False, stated.why))
        found.append(Finding(where, slower, stated.velocity, f"{speed:.2f}", False, stated.why))
    picture = trajectory_figure(utterance, {name: motion}, {name: COLOURS[1]}, channels)
    return [replace(found[0], figure=picture), *found[1:]]


def drawn_channels(motion: Motion, *, cheek: bool) -> list[tuple[str, int]]:
    """(name, channel) of the lower lip, and of a cheek, as in the papers."""
    layout = motion.layout
    cheeks = [k for k, name in enumerate(layout.names) if cheek and name.startswith("cheek_r")]
    lip = shown_channels(layout, motion.frames.astype(np.float64))[:1]
    return lip + [(f"{layout.names[k]}, height", k * layout.dimension + 1) for k in cheeks[:1]]


def _seconds(model: Efase, speech: Speech) -> float:
    with stopwatch() as spent:
        model.synthesize(speech)
    return spent.processor_s


def _correlation(truth: np.ndarray, made: np.ndarray) -> float:
    seen = ~np.isnan(truth)
    if seen.sum() < 3 or truth[seen].std() == 0 or made[seen].std() == 0:
        return 0.0
    return float(np.corrcoef(truth[seen], made[seen])[0, 1])


FIGURES: tuple[Figure, ...] = (
    Figure("§3", "variance in 25 dimensions; motion nodes", "98.53 %; 5556", lambda material: database(material, "§3")),
    Figure(
        "figs 5 to 9",
        "phoneme Isomap maps beside PCA maps",
        "pictures",
        lambda material: maps(published(material), material, "figs 5 to 9"),
    ),
    Figure("fig. 10", "error per frame (eq. 13)", "curves for three sentences", errors),
    absent("fig. 12", "mesh distances", "a picture", "no number is given; see `facesynth.face.deform.mesh_distance`"),
    Figure(
        "figs 15, 16", "trajectory of a lip marker", "a picture", lambda material: trajectories(spoken(material), "figs 15, 16")
    ),
    Figure(
        "table 5",
        "seconds of synthesis",
        values(SECONDS),
        lambda material: times(material, "table 5", PHONES, SECONDS, "Athlon 64 X2, 2008"),
    ),
    absent("table 5", "the same on a graphics card, s", values(SECONDS_GPU), "measured on the processor alone"),
)
"""What the page shows, in the paper's order."""
