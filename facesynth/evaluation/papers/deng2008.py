"""Deng and Neumann 2008."""

import numpy as np

from facesynth.corpus import Utterance
from facesynth.evaluation.cost import stopwatch
from facesynth.evaluation.geometry import deng_error
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding, not_available, not_implemented, values
from facesynth.evaluation.papers.joined import joined
from facesynth.evaluation.trajectories import shown_channels
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.efase.method import Efase

PUBLISHED = {"alpha": 3.6052, "beta": 5.7814, "eta": 6.8282, "gamma": 0.2903, "delta": 0.315, "phi": 0.109, "penalty": 10.0}
PHONES = (14, 24, 53, 63)
SECONDS = (221.391, 333.171, 815.719, 942.609)
SECONDS_GPU = (50.828, 90.891, 232.078, 256.484)


def findings(material: Material) -> list[Finding]:
    """Tables and figures of the paper."""
    model = Efase.from_config(PUBLISHED).fit(material.train, seed=material.seed)
    spoken = [(u, model.synthesize(u.speech, seed=material.seed)) for u in material.test]
    return [
        *database(model, material, "§3"),
        times(model, material, "table 5", PHONES, SECONDS, "Athlon 64 X2, 2008"),
        *errors(spoken, material),
        *trajectories(spoken, "figs 15, 16"),
        not_available("table 5", "the same on a graphics card, s", values(SECONDS_GPU), "measured on the processor alone"),
        not_implemented("figs 5 to 9", "phoneme Isomap maps beside PCA maps", "pictures", "this version has no such maps"),
        not_available("fig. 12", "mesh distances", "a picture", "no number is given; see `facesynth.face.deform.mesh_distance`"),
    ]


def database(model: Efase, material: Material, where: str) -> list[Finding]:
    """PCA and the count of nodes."""
    share = float(model.pca.variance_ratio.sum())
    dimension = material.corpus.layout.channels
    return [
        Finding(
            where, f"variance in 25 of {dimension} dimensions (paper: of 270)", "98.53 %", f"{share:.2%}", False, material.unlike
        ),
        Finding(where, "motion nodes", "5556", str(len(model.facts["names"])), False, "another amount of recordings"),
    ]


def times(
    model: Efase, material: Material, where: str, phones: tuple[int, ...], seconds: tuple[float, ...], hardware: str
) -> Finding:
    """Time of synthesis of as many phones as the paper's phrases have: tested utterances one after the other, cut there."""
    said = [utterance.speech for utterance in material.test]
    speeches = [joined(said, count) for count in phones]
    model.synthesize(speeches[0])
    took = [_seconds(model, speech) for speech in speeches]
    what = f"synthesis of {values(phones, '{:.0f}')} phones, s"
    nodes = len(model.facts["names"])
    why = f"other hardware (paper: {hardware}), {nodes} nodes in place of 5556, another search of the same optimum"
    return Finding(where, what, values(seconds), values(took), False, why)


def errors(spoken: list[tuple[Utterance, Motion]], material: Material) -> list[Finding]:
    """Eq. 13 of sentences in the emotions of figure 10."""
    unit = material.corpus.layout.unit
    found = []
    for emotion in ("neutral", "angry", "sad"):
        errors = [deng_error(motion, u.motion) for u, motion in spoken if u.emotion == emotion]
        what = f"error per frame (eq. 13), {emotion}, {unit}²"
        if errors:
            ours = f"{np.mean(errors):.3g} (mean of {len(errors)} sentences)"
            found.append(
                Finding("fig. 10", what, "a curve for one sentence", ours, False, "the curve's scale cannot be read as a number")
            )
        else:
            found.append(not_available("fig. 10", what, "a curve", f"the tested recordings have no {emotion} sentence"))
    return found


def trajectories(spoken: list[tuple[Utterance, Motion]], where: str) -> list[Finding]:
    """How far a lip point's trajectory and velocity follow the recorded ones, as correlations."""
    try:
        name, channel = shown_channels(spoken[0][1].layout, spoken[0][0].motion.frames.astype(np.float64))[0]
    except UnavailableError as reason:
        return [not_available(where, "lip trajectory", "a picture", str(reason))]
    pairs = [(u.motion.frames[:, channel], motion.frames[:, channel]) for u, motion in spoken]
    place = np.mean([_correlation(truth, made) for truth, made in pairs])
    speed = np.mean([_correlation(np.diff(truth), np.diff(made)) for truth, made in pairs])
    why = "the paper shows one sentence, as a picture, and says that velocities deviate more"
    return [
        Finding(where, f"correlation of the trajectory of {name}", "quite close", f"{place:.2f}", False, why),
        Finding(
            where,
            f"correlation of its velocity: {'lower' if speed < place else 'not lower'}",
            "deviates more",
            f"{speed:.2f}",
            False,
            why,
        ),
    ]


def _seconds(model: Efase, speech: Speech) -> float:
    with stopwatch() as spent:
        model.synthesize(speech)
    return spent.clock_s


def _correlation(truth: np.ndarray, made: np.ndarray) -> float:
    seen = ~np.isnan(truth)
    if seen.sum() < 3 or truth[seen].std() == 0 or made[seen].std() == 0:
        return 0.0
    return float(np.corrcoef(truth[seen], made[seen])[0, 1])
