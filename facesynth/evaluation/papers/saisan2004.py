"""Saisan, Bissacco, Chiuso and Soatto 2004."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from facesynth.evaluation.drawing import lines_figure
from facesynth.evaluation.figures import as_uri
from facesynth.evaluation.pair import distances, paired_points
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2008 import Spoken, Stated, trajectories
from facesynth.evaluation.papers.figure import Figure, absent
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.evaluation.papers.saisan2004_checks import assumptions, halves
from facesynth.evaluation.trajectories import shown_channels
from facesynth.inference.motion import Motion
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.plots import innovations_figure
from facesynth.methods.registry import create

SHOWN = Stated("a curve", "not shown", "the paper shows the error of one point, in pixels of its video")
SETTINGS = {
    "hears": "periodogram",
    "scale": "linear",
    "context_ms": 0.0,
    "features": 4,
    "lead_ms": 0.0,
    "fitted_to": "steps",
    "own_means": False,
    "noise_by_state": False,
    "close_lips": False,
}
OWN = "today's default, deterministic part"
PAPERS = "the paper's features, deterministic part"


@lru_cache(maxsize=1)
def learned(material: Material) -> LDS:
    """The system by the paper's features."""
    return LDS(**SETTINGS).fit(material.train, seed=material.seed)  # type: ignore[arg-type]


@lru_cache(maxsize=1)
def made(material: Material) -> dict[str, Spoken]:
    """By row of the experiment: the tested utterances with what was made for them."""
    paper, own = learned(material), LDS().fit(material.train, seed=material.seed)
    still = create("mean_face").fit(material.train, seed=material.seed)
    rows = {
        "mean pose": (still, {}),
        PAPERS: (paper, {"noise": 0.0}),
        "the paper's features, with noise": (paper, {"noise": 1.0}),
        OWN: (own, {"noise": 0.0}),
        "the same with noise": (own, {"noise": 1.0}),
    }
    return {
        name: [(u, method.synthesize(u.speech, seed=material.seed, **options)) for u in material.test]
        for name, (method, options) in rows.items()
    }


def errors(material: Material) -> list[Finding]:
    """Fig. 3: learn from one part, drive with the sound of another; the picture is of the first tested utterance."""
    unit, rows = material.corpus.layout.unit, made(material)
    why = f"the paper shows the error of one point over time, in pixels of its video; {material.unlike}"
    found = [
        Finding("fig. 3", f"RMS error per coordinate, {name}, {unit}", "a curve", f"{_rms(spoken):.3g}", False, why)
        for name, spoken in rows.items()
    ]
    point, lines = _errors_of_a_point(rows)
    picture = lines_figure(lines, "s", f"error of {point}, {unit}", style="-")
    return [replace(found[0], figure=picture), *found[1:], *trajectories(rows[OWN], "fig. 3", "LDS, no noise", SHOWN)]


def noise(material: Material) -> list[Finding]:
    """Fig. 1: whether the residuals are normal."""
    model = learned(material)
    what = "excess kurtosis of the residuals' independent components (0: Gaussian)"
    paper, why = "“non-Gaussian nature is clear”", "the paper prints a histogram"
    picture = as_uri(innovations_figure(model))
    return [Finding("fig. 1", what, paper, values(model.facts["kurtosis"]), False, why, figure=picture)]


def poles(material: Material) -> list[Finding]:
    """§4: stability."""
    moduli = [modulus for part in learned(material).facts["poles"].values() for modulus in part]
    what = "largest modulus of an eigenvalue (below 1: stable)"
    return [Finding("§4", what, "below 1", f"{max(moduli):.6f}", True, "a property, not a measurement")]


def _errors_of_a_point(rows: dict[str, Spoken]) -> tuple[str, dict[str, tuple[list[float], list[float]]]]:
    """Name of a lip point, and by row its error over the first tested utterance."""
    truth = next(iter(rows.values()))[0][0].motion
    label, channel = shown_channels(truth.layout, truth.frames.astype(np.float64))[0]
    point = channel // truth.layout.dimension
    lines = {name: (truth.times_s.tolist(), _apart(spoken[0][1], truth, point)) for name, spoken in rows.items()}
    return label.removesuffix(", height"), lines


def _apart(motion: Motion, truth: Motion, point: int) -> list[float]:
    errors: list[float] = distances(*paired_points(motion, truth))[:, point].tolist()
    return errors


def _rms(spoken: Spoken) -> float:
    squared = [np.nanmean((motion.frames - u.motion.frames) ** 2) for u, motion in spoken]
    return float(np.sqrt(np.mean(squared)))


FIGURES: tuple[Figure, ...] = (
    Figure("fig. 1", "histogram of the residuals", "“non-Gaussian nature is clear”", noise),
    absent("fig. 2", "points followed in a video", "a picture", "no number is given; `facesynth corpus add` follows such points"),
    Figure("fig. 3", "error of one point over time", "a curve", errors),
    absent(
        "fig. 4", "a synthesised video of the speaker", "pictures", "needs the speaker's video; `facesynth speak` makes one of it"
    ),
    Figure("§6", "half of a recording to learn from, half to drive", "a curve", lambda material: halves(material, SETTINGS)),
    Figure("§3", "white and independent residuals", "assumed", lambda material: assumptions(learned(material), material)),
    Figure("§4", "largest modulus of an eigenvalue", "below 1", poles),
)
"""What the page shows, in the paper's order."""
