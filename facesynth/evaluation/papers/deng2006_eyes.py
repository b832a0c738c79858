"""Chapter 3 of the dissertation: eyes by patches of recorded ones."""

import numpy as np

from facesynth.evaluation.figures import as_uri, new_figure
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding, not_available
from facesynth.inference.errors import FacesynthError
from facesynth.methods.eyes.method import Eyes
from facesynth.methods.eyes.patch_size import PatchSize, patch_size

PAPERS_PATCH_S, COVERED = 20 / 120, "55.68 %"
"""20 frames; the rate is that of the chapter on facial motion, which this one does not state."""
GROWN_S = 60.0


def eyes(material: Material) -> list[Finding]:
    """All of the chapter that a corpus with eyes gives."""
    watched = not_available("fig. 3.8", "user ratings, ANOVA", "p = 2.4e-10", "nobody was asked to watch and rate")
    try:
        model = Eyes().fit(material.corpus, seed=material.seed)
        return [*_sizes(material, model), watched]
    except FacesynthError as reason:
        return [not_available("fig. 3.6", "eye movements covered by patches of 20 frames", COVERED, str(reason)), watched]


def _sizes(material: Material, model: Eyes) -> list[Finding]:
    frames = model.frames.cpu().numpy().astype(np.float64)
    found = patch_size(np.split(frames, model.starts.cpu().numpy()[1:]), model.fps)
    if found is None:
        raise FacesynthError(f"{material.corpus.path} has no two blinks or large shifts of gaze in a row; record more")
    theirs = round(PAPERS_PATCH_S * model.fps)
    growth = model.runtime().grow(GROWN_S, material.seed)
    return [
        Finding(
            "fig. 3.6",
            f"eye movements covered by patches of 20 frames ({theirs} at {model.fps:g} fps)",
            COVERED,
            f"{found.covered(theirs):.1%}",
            False,
            material.unlike,
            figure=_picture(found, model.fps),
        ),
        Finding(
            "§3.4",
            "patch where the curve of intervals bends, and what it covers",
            "20 frames, 55.68 %",
            f"{found.frames} frames ({found.frames / model.fps:.2f} s), {found.covered(found.frames):.1%}",
            False,
            material.unlike,
        ),
        Finding(
            "§3.3",
            f"patches of {GROWN_S:g} s of eyes for which nothing recorded fitted",
            "not stated",
            f"{growth.stuck} of {len(growth.places)}",
            False,
            material.unlike,
        ),
    ]


def _picture(found: PatchSize, fps: float) -> str:
    """Histogram of the intervals above the share that each limit covers, as in the dissertation."""
    figure, axes = new_figure(6, 5, 2, 1)
    limits_s = np.arange(0, int(found.intervals[-1]) + 1) / fps
    axes[0, 0].hist(found.intervals / fps, bins=40, color="0.5")
    axes[0, 0].set_ylabel("intervals")
    axes[1, 0].plot(limits_s, [100 * found.covered(limit) for limit in range(len(limits_s))])
    axes[1, 0].axvline(found.frames / fps, color="0.6", lw=0.8)
    axes[1, 0].set(xlabel="interval limit between blinks, and between large saccades, s", ylabel="covered, %")
    return as_uri(figure)
