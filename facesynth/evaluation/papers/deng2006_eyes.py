"""Chapter 3 of the dissertation: eyes by patches of recorded ones."""

from functools import lru_cache

import numpy as np

from facesynth.evaluation.drawing import RECORDED, tracks_figure
from facesynth.evaluation.eyes import distances
from facesynth.evaluation.figures import as_uri, new_figure
from facesynth.evaluation.pair import Array
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.figure import Figure, absent
from facesynth.evaluation.papers.finding import Finding, values
from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import ANYWHERE
from facesynth.methods.eyes.method import Eyes
from facesynth.methods.eyes.patch_size import PatchSize, patch_size

PAPERS_PATCH_S, COVERED = 20 / 120, "55.68 %"
"""20 frames; the rate is that of the chapter on facial motion, which this one does not state."""
GROWN_S = 60.0


SHOWN_S = 15.0
SIGNALS = ("opening", "gaze to the left, °", "gaze up, °")


@lru_cache(maxsize=1)
def learned(material: Material) -> Eyes:
    """The model of all recordings with eyes."""
    return Eyes(joins=ANYWHERE).fit(material.corpus, seed=material.seed)


def signals(material: Material) -> list[Finding]:
    """Figs 3.4 and 3.5: opening and gaze, recorded and grown for a head that is still."""
    model = learned(material)
    frames, starts = model.frames.cpu().numpy().astype(np.float64), model.starts.cpu().numpy()
    longest = max(np.split(frames, starts[1:]), key=len)
    grown = model.runtime().grow(GROWN_S, material.seed).frames.astype(np.float64)
    apart = distances(_named(grown), _named(frames))
    picture = tracks_figure(
        model.fps, {name: {RECORDED: _named(longest)[name], "grown": _named(grown)[name]} for name in SIGNALS}, longest_s=SHOWN_S
    )
    what = f"Kolmogorov-Smirnov distance of {GROWN_S:g} s that are grown from the recorded signals: lids, sideways, up"
    ours = values([apart[name] for name in SIGNALS], "{:.2f}")
    return [Finding("figs 3.4, 3.5", what, "pictures", ours, False, "the dissertation shows the signals alone", figure=picture)]


def _named(frames: Array) -> dict[str, Array]:
    """Signals of eyes [T, 3] by name."""
    return dict(zip(SIGNALS, (frames * np.array([1.0, *np.degrees([1.0, 1.0])])).T, strict=True))


def sizes(material: Material) -> list[Finding]:
    """Fig. 3.6, and what the model makes of its patches."""
    model = learned(material)
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


EYES: tuple[Figure, ...] = (
    Figure("figs 3.4, 3.5", "eye signals, recorded and grown", "pictures", signals),
    Figure("fig. 3.6", "eye movements covered by patches of 20 frames", COVERED, sizes),
    absent("fig. 3.7", "frames of eyes", "a picture", "no number is given; `facesynth speak` makes such frames"),
    absent("fig. 3.8", "user ratings, ANOVA", "p = 2.4e-10", "nobody was asked to watch and rate"),
)
"""The chapter's figures."""
