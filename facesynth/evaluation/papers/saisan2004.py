"""Saisan, Bissacco, Chiuso and Soatto 2004."""

import numpy as np

from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding, not_available, values
from facesynth.methods.lds.method import LDS
from facesynth.methods.method import Method
from facesynth.methods.registry import create

SETTINGS = {"scale": "linear", "features": 4, "lead_ms": 0.0, "own_means": False}


def findings(material: Material) -> list[Finding]:
    """The experiment: learn from one part, drive with the sound of another. The paper prints pictures, no numbers."""
    unit = material.corpus.layout.unit
    paper = LDS(**SETTINGS).fit(material.train, seed=material.seed)  # type: ignore[arg-type]
    own = LDS().fit(material.train, seed=material.seed)
    still = create("mean_face").fit(material.train, seed=material.seed)
    why = f"the paper shows the error of one point over time, in pixels of its video; {material.unlike}"
    rows = {
        "mean pose": _rms(still, material),
        "the paper's features, deterministic part": _rms(paper, material, noise=0.0),
        "the paper's features, with noise": _rms(paper, material, noise=1.0),
        "logarithmic periodogram and chosen lead, deterministic part": _rms(own, material, noise=0.0),
        "the same with noise": _rms(own, material, noise=1.0),
    }
    found = [
        Finding("fig. 3", f"RMS error per coordinate, {name}, {unit}", "a curve", f"{rms:.3g}", False, why)
        for name, rms in rows.items()
    ]
    kurtosis = paper.facts["kurtosis"]
    what = "excess kurtosis of the residuals' independent components (0: Gaussian)"
    found.append(
        Finding("fig. 1", what, "“non-Gaussian nature is clear”", values(kurtosis), False, "the paper prints a histogram")
    )
    poles = [modulus for moduli in paper.facts["poles"].values() for modulus in moduli]
    found.append(
        Finding(
            "§4",
            "largest modulus of an eigenvalue (below 1: stable)",
            "below 1",
            f"{max(poles):.6f}",
            True,
            "a property, not a measurement",
        )
    )
    found.append(
        not_available(
            "fig. 4", "a synthesised video of the speaker", "pictures", "needs the speaker's video: see `facesynth.face.texture`"
        )
    )
    return found


def _rms(model: Method, material: Material, **options: float) -> float:
    squared = [
        np.nanmean((model.synthesize(u.speech, seed=material.seed, **options).frames - u.motion.frames) ** 2)
        for u in material.test
    ]
    return float(np.sqrt(np.mean(squared)))
