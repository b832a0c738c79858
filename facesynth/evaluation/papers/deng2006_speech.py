"""Deng 2006, §5.2: co-articulation curves, their trajectories, and the expression eigenspace."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from facesynth.corpus import Corpus
from facesynth.evaluation.figures import as_uri, new_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2008 import trajectories
from facesynth.evaluation.papers.finding import Finding, not_available
from facesynth.evaluation.trajectories import trajectory_figure
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import NEUTRAL
from facesynth.methods.coarticulation.method import Coarticulation, displacement_basis
from facesynth.methods.coarticulation.recordings import track_of, transitions_of, usable
from facesynth.methods.coarticulation.transitions import PENALTIES, fitting_cost
from facesynth.methods.expression.method import Expression

COMPONENTS = 5
DEGREES = (1, 2, 3, 4, 5, 6)
PUBLISHED = {"components": 5, "stiffness": 0, "pull": 0.0, "triphones": 1, "shrink": 1e9, "context": 0}
"""One shape for each viseme class, least squares without a prior, every triphone."""
COLOUR = "#b3541e"


def coarticulation(material: Material) -> list[Finding]:
    """Figures 5.8 and 5.18."""
    return [degree(material), *shown_trajectories(material)]


def degree(material: Material) -> Finding:
    """Fig. 5.8: which degree of polynomial costs the least, for each penalty."""
    costs = fitting_costs(material.train)
    best = [min(DEGREES, key=lambda n, p=penalty: costs[p, n]) for penalty in PENALTIES]  # type: ignore[misc]
    ours = " / ".join(map(str, best))
    what = f"degree of the least fitting cost, for λ = {' / '.join(f'{p:g}' for p in PENALTIES)}"
    why = f"{material.unlike}; without a penalty the cost can only fall with the degree"
    return Finding("fig. 5.8", what, "3", ours, False, why, figure=cost_figure(costs))


def fitting_costs(corpus: Corpus) -> dict[tuple[float, int], float]:
    """C of eq. 5.9 by penalty and degree, over all diphones and triphones of the neutral recordings, each for one frame."""
    chosen = usable(corpus, NEUTRAL) or list(corpus)
    rest, basis = displacement_basis(chosen, corpus, COMPONENTS)
    tracks = [track_of((u.motion.frames.astype(np.float64) - rest) @ basis, u.speech.phones, corpus.fps) for u in chosen]
    kinds = [transitions_of(tracks, over, 0.0) for over in (2, 3)]
    frames = sum(len(kind.times) for kind in kinds)
    return {(p, n): fitting_cost(kinds, n, p) / max(frames, 1) for p, n in product(PENALTIES, DEGREES)}


def cost_figure(costs: Mapping[tuple[float, int], float]) -> str:
    """A curve for each penalty over the degree."""
    figure, axes = new_figure(6, 4, 1, 1)
    for penalty in PENALTIES:
        axes[0][0].plot(DEGREES, [costs[penalty, n] for n in DEGREES], "o-", label=f"λ = {penalty:g}", linewidth=1)
    axes[0][0].set(xlabel="degree", ylabel="fitting cost of a frame", yscale="log")
    axes[0][0].legend(fontsize=8, frameon=False)
    return as_uri(figure)


def shown_trajectories(material: Material) -> list[Finding]:
    """Fig. 5.18: neutral sentences that were not learned from."""
    neutral = usable(material.test, NEUTRAL)
    if not neutral:
        return [
            not_available("fig. 5.18", "trajectories of the co-articulation model", "pictures", "no neutral sentence is tested")
        ]
    model = Coarticulation.from_config(PUBLISHED).fit(material.train)
    spoken = [(u, model.synthesize(u.speech)) for u in neutral]
    utterance, motion = spoken[0]
    name = "co-articulation"
    picture = trajectory_figure(utterance, {name: motion}, {name: COLOUR})
    first, *others = trajectories(spoken, "fig. 5.18")
    return [replace(first, figure=picture), *others]


def eigenspace(material: Material) -> Finding:
    """§5.2.2: how much of expressive motion three dimensions hold."""
    what = "variance of the expression eigenspace in 3 dimensions"
    try:
        model = Expression(components=3).fit(material.train)
    except FacesynthError as reason:
        return not_available("§5.2.2", what, "86.5 %", str(reason))
    return Finding("§5.2.2", what, "86.5 %", f"{model.facts['variance']:.1%}", False, material.unlike)
