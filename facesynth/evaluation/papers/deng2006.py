"""Deng 2006, the dissertation."""

import numpy as np

from facesynth.evaluation.drawing import variance_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.deng2006_eyes import EYES
from facesynth.evaluation.papers.deng2006_head import HEAD
from facesynth.evaluation.papers.deng2006_speech import SPEECH
from facesynth.evaluation.papers.deng2008 import database, published, spoken, times, trajectories
from facesynth.evaluation.papers.figure import Figure
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.evaluation.papers.phone_maps import maps
from facesynth.evaluation.regions import lip_points
from facesynth.inference.errors import FacesynthError
from facesynth.motion.pca import Pca

PHONES = (14, 24, 33, 63)
SECONDS = (137.67, 192.86, 371.50, 518.34)


def mouth(material: Material) -> list[Finding]:
    """PCA of the mouth markers in neutral recordings."""
    neutral = material.train.subset(r.id for r in material.train.usable_records if r.emotion == "neutral")
    lips = lip_points(material.corpus.layout)
    if not len(neutral):
        raise FacesynthError("there are no neutral recordings")
    dimension = material.corpus.layout.dimension
    columns = (lips[:, None] * dimension + np.arange(dimension)).ravel()
    frames = neutral.arrays().frames[:, columns]
    shares = Pca.fit(frames[np.isfinite(frames).all(axis=1)][::4], 15).variance_ratio.numpy()
    what = f"variance of the mouth's markers in 5 dimensions (paper: 10 markers; ours: {len(lips)})"
    picture = variance_figure(shares, 5)
    return [Finding("§5.2", what, "97.5 %", f"{shares[:5].sum():.1%}", False, material.unlike, figure=picture)]


FIGURES: tuple[Figure, ...] = (
    *EYES,
    *HEAD,
    Figure("§5.2", "variance of the mouth's markers in 5 dimensions", "97.5 %", mouth),
    *SPEECH,
    Figure("§5.3", "variance in 25 dimensions; motion nodes", "98.53 %; 5556", lambda material: database(material, "§5.3")),
    Figure(
        "figs 5.22 to 5.26",
        "phoneme Isomap maps beside PCA maps",
        "pictures",
        lambda material: maps(published(material), material, "figs 5.22 to 5.26"),
    ),
    Figure(
        "table 5.2",
        "seconds of synthesis",
        values(SECONDS),
        lambda material: times(material, "table 5.2", PHONES, SECONDS, "2.66 GHz, 2006"),
    ),
    Figure(
        "figs 5.30, 5.31",
        "trajectories of a cheek and a lip marker",
        "pictures",
        lambda material: trajectories(spoken(material), "figs 5.30, 5.31", cheek=True),
    ),
)
"""What the page shows, in the dissertation's order."""
