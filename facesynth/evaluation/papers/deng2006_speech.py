"""Deng 2006, §5.2: co-articulation curves, their trajectories, and the expression eigenspace."""

from itertools import product

import numpy as np

from facesynth.corpus import Corpus
from facesynth.evaluation.drawing import lines_figure, variance_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2008 import trajectories
from facesynth.evaluation.papers.figure import Figure
from facesynth.evaluation.papers.finding import Finding
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import NEUTRAL
from facesynth.methods.coarticulation.method import Coarticulation, displacement_basis
from facesynth.methods.coarticulation.recordings import track_of, transitions_of, usable
from facesynth.methods.coarticulation.transitions import PENALTIES, fitting_cost
from facesynth.methods.expression.differences import whole_runs
from facesynth.methods.expression.method import differences_of, expressions_of
from facesynth.motion.pca import Pca

COMPONENTS = 5
DEGREES = (1, 2, 3, 4, 5, 6)
PUBLISHED = {"components": 5, "stiffness": 0, "pull": 0.0, "triphones": 1, "shrink": 1e9, "context": 0}
"""One shape for each viseme class, least squares without a prior, every triphone."""
DRAWN = 12
"""Dimensions of the expression eigenspace whose variance is drawn."""


def degree(material: Material) -> list[Finding]:
    """Fig. 5.8: which degree of polynomial costs the least, for each penalty."""
    costs = fitting_costs(material.train)
    best = [min(DEGREES, key=lambda n, p=penalty: costs[p, n]) for penalty in PENALTIES]  # type: ignore[misc]
    ours = " / ".join(map(str, best))
    what = f"degree of the least fitting cost, for λ = {' / '.join(f'{p:g}' for p in PENALTIES)}"
    why = f"{material.unlike}; without a penalty the cost can only fall with the degree"
    curves = {f"λ = {p:g}": (DEGREES, [costs[p, n] for n in DEGREES]) for p in PENALTIES}
    picture = lines_figure(curves, "degree", "fitting cost of a frame", yscale="log")
    return [Finding("fig. 5.8", what, "3", ours, False, why, figure=picture)]


def fitting_costs(corpus: Corpus) -> dict[tuple[float, int], float]:
    """C of eq. 5.9 by penalty and degree, over all diphones and triphones of the neutral recordings, each for one frame."""
    chosen = usable(corpus, NEUTRAL) or list(corpus)
    rest, basis = displacement_basis(chosen, corpus, COMPONENTS)
    tracks = [track_of((u.motion.frames.astype(np.float64) - rest) @ basis, u.speech.phones, corpus.fps) for u in chosen]
    kinds = [transitions_of(tracks, over, 0.0) for over in (2, 3)]
    frames = sum(len(kind.times) for kind in kinds)
    if not frames:
        raise FacesynthError(f"in {corpus.path} no phone follows another")
    return {(p, n): fitting_cost(kinds, n, p) / frames for p, n in product(PENALTIES, DEGREES)}


def shown_trajectories(material: Material) -> list[Finding]:
    """Fig. 5.18: neutral sentences that were not learned from."""
    neutral = usable(material.test, NEUTRAL)
    if not neutral:
        raise FacesynthError("no neutral sentence is tested")
    model = Coarticulation.from_config(PUBLISHED).fit(material.train)
    return trajectories([(u, model.synthesize(u.speech)) for u in neutral], "fig. 5.18", "co-articulation")


def eigenspace(material: Material) -> list[Finding]:
    """§5.2.2: how much of expressive motion three dimensions hold."""
    differences, unlike = differences_of(material.train)
    emotions, _ = expressions_of(differences, material.train, unlike)
    frames = np.concatenate([run for d in differences if d.emotion in emotions for run in whole_runs(d.frames)])
    shares = Pca.fit(frames, DRAWN).variance_ratio.numpy()
    ours = f"{shares[:3].sum():.1%}"
    what = "variance of the expression eigenspace in 3 dimensions"
    return [Finding("§5.2.2", what, "86.5 %", ours, False, material.unlike, figure=variance_figure(shares, 3))]


SPEECH: tuple[Figure, ...] = (
    Figure("fig. 5.8", "degree of polynomial of the least fitting cost", "3", degree),
    Figure("fig. 5.18", "trajectories of the co-articulation model", "pictures", shown_trajectories),
    Figure("§5.2.2", "variance of the expression eigenspace in 3 dimensions", "86.5 %", eigenspace),
)
"""The chapter's figures."""
