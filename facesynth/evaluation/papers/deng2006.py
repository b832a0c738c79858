"""Deng 2006, the dissertation."""

import numpy as np

from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2006_eyes import eyes
from facesynth.evaluation.papers.deng2006_head import head
from facesynth.evaluation.papers.deng2006_speech import coarticulation, eigenspace
from facesynth.evaluation.papers.deng2008 import PUBLISHED, database, times, trajectories
from facesynth.evaluation.papers.finding import Finding, not_available, not_implemented
from facesynth.evaluation.regions import lip_points
from facesynth.methods.efase.method import Efase
from facesynth.methods.registry import list_methods
from facesynth.motion.pca import Pca

PHONES = (14, 24, 33, 63)
SECONDS = (137.67, 192.86, 371.50, 518.34)
CHAPTERS = (("maps", "figs 5.22 to 5.26", "phoneme Isomap maps beside PCA maps", "pictures"),)
"""Method, place, what, figure: of the dissertation's other chapters."""
MISSING = {
    "maps": "maps of phonemes",
}
"""What a method is called where it does not exist."""


def findings(material: Material) -> list[Finding]:
    """Tables and figures of the dissertation."""
    model = Efase.from_config(PUBLISHED).fit(material.train, seed=material.seed)
    spoken = [(u, model.synthesize(u.speech, seed=material.seed)) for u in material.test]
    return [
        *database(model, material, "§5.3"),
        mouth(material),
        *coarticulation(material),
        eigenspace(material),
        times(model, material, "table 5.2", PHONES, SECONDS, "2.66 GHz, 2006"),
        *trajectories(spoken, "figs 5.30, 5.31"),
        *eyes(material),
        *head(material),
        *missing(),
    ]


def mouth(material: Material) -> Finding:
    """PCA of the mouth markers in neutral recordings."""
    neutral = material.train.subset(r.id for r in material.train.usable_records if r.emotion == "neutral")
    what = "variance of the mouth's markers in 5 dimensions"
    try:
        lips = lip_points(material.corpus.layout)
    except UnavailableError as reason:
        return not_available("§5.2", what, "97.5 %", str(reason))
    if not len(neutral):
        return not_available("§5.2", what, "97.5 %", "there are no neutral recordings")
    dimension = material.corpus.layout.dimension
    columns = (lips[:, None] * dimension + np.arange(dimension)).ravel()
    frames = neutral.arrays().frames[:, columns]
    share = float(Pca.fit(frames[np.isfinite(frames).all(axis=1)][::4], 5).variance_ratio.sum())
    return Finding("§5.2", f"{what} (paper: 10 markers; ours: {len(lips)})", "97.5 %", f"{share:.1%}", False, material.unlike)


def missing() -> list[Finding]:
    """Chapters whose methods this version lacks."""
    known = set(list_methods())
    return [
        not_implemented(where, what, paper, f"this version has no {MISSING[method]}")
        for method, where, what, paper in CHAPTERS
        if method not in known
    ]
