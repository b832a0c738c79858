"""Whether the mouth opens and shuts as much, and when, as the recorded one did.

The opening is `facesynth.inference.lips.lip_gap`: upper minus lower inner lip, vertical, in the unit of the layout (u).
Blendshape curves are posed on the built-in head first: their opening is in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from facesynth.evaluation.pair import Array, UnavailableError, require_alike
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion
from facesynth.inference.phones import BILABIALS, OPEN_VOWELS
from facesynth.inference.speech import PhoneTrack

if TYPE_CHECKING:
    from facesynth.face.rig.markers import LipGap


def lip_gap_corr(synthesised: Motion, truth: Motion) -> float:
    """Pearson correlation of the two lip openings over time, -1..1; 0 where the synthesised mouth stands still."""
    mine, yours = paired_gaps(synthesised, truth)
    return _pearson(mine, yours)


def lip_gap_ccc(synthesised: Motion, truth: Motion) -> float:
    """Concordance correlation 2 cov / (var_x + var_y + (mean_x - mean_y)²) of the two lip openings, -1..1.

    Unlike Pearson's it falls with a wrong size or a wrong rest position.
    """
    mine, yours = paired_gaps(synthesised, truth)
    covariance = float(((mine - mine.mean()) * (yours - yours.mean())).mean())
    return 2 * covariance / float(mine.var() + yours.var() + (mine.mean() - yours.mean()) ** 2)


def closure_threshold(recordings: Iterable[tuple[Motion, PhoneTrack]]) -> float:
    """The opening (u) that counts as shut: 90th percentile of the recorded smallest gaps at p, b and m.

    The smallest recorded value that at least nine tenths of them do not exceed, so that the truth itself
    has a closure rate of 0.9 or just above.
    """
    smallest = [_smallest_gaps(lip_opening(motion), phones, motion.fps) for motion, phones in recordings]
    gaps = np.concatenate([np.zeros(0), *smallest])
    if not gaps.size:
        raise UnavailableError("the recordings have no p, b or m")
    return float(np.percentile(gaps, 90, method="inverted_cdf"))


def require_parting(motions: Iterable[Motion], threshold: float) -> None:
    """UnavailableError where the mean recorded opening is not above a threshold: a face that never moves would seem shut."""
    openings = [lip_opening(motion) for motion in motions]
    if np.nanmean(np.concatenate(openings)) <= threshold:
        raise UnavailableError(
            "the recorded lips are no nearer at p, b and m than on average: a still face would seem to shut them"
        )


def closure_rate(synthesised: Motion, phones: PhoneTrack, threshold: float) -> float:
    """Share of the p, b and m whose smallest lip gap is not above the threshold (0..1)."""
    smallest = _smallest_gaps(lip_opening(synthesised), phones, synthesised.fps)
    if not smallest.size:
        raise UnavailableError("nobody says p, b or m")
    return float((smallest <= _known(threshold)).mean())


def false_closure_rate(synthesised: Motion, phones: PhoneTrack, threshold: float) -> float:
    """Share of the open vowels (aa ae ah ao aw ay) whose median lip gap is not above the threshold (0..1).

    The median, not the smallest gap: a vowel beside p, b or m always starts or ends with shut lips.
    """
    gaps = _gaps_of(lip_opening(synthesised), phones, synthesised.fps, OPEN_VOWELS, lambda gap: float(np.median(gap)))
    if not gaps.size:
        raise UnavailableError("nobody says an open vowel")
    return float((gaps <= _known(threshold)).mean())


def lip_opening(motion: Motion) -> Array:
    """[T] vertical opening of the inner lips (u; mm for curves); UnavailableError where the layout does not tell it."""
    if motion.layout.kind == "curves":
        return _opening_on_head(motion)
    if not motion.layout.lip_pairs:
        raise UnavailableError("the layout has no pairs of inner-lip points")
    return np.asarray(lip_gap(motion), np.float64)


def paired_gaps(synthesised: Motion, truth: Motion) -> tuple[Array, Array]:
    """[T'] openings of both in the frames in which the truth has one; UnavailableError where the truth stands still."""
    require_alike(synthesised, truth)
    mine, yours = lip_opening(synthesised), lip_opening(truth)
    present = ~np.isnan(yours)
    if present.sum() < 3 or not yours[present].std() > 0:
        raise UnavailableError("the recorded mouth stands still or is missing")
    return mine[present], yours[present]


def _opening_on_head(motion: Motion) -> Array:
    """[T] opening (mm) that ARKit curves give the built-in head; curves that the layout lacks are 0."""
    from facesynth.motion.arkit_names import ARKIT_NAMES

    known = [i for i, name in enumerate(motion.layout.names) if name in ARKIT_NAMES]
    if not {"jawOpen", "mouthClose"} & set(motion.layout.names):
        raise UnavailableError("the curves are no ARKit shapes that open the mouth")
    weights = np.zeros((len(motion), len(ARKIT_NAMES)))
    weights[:, [ARKIT_NAMES.index(motion.layout.names[i]) for i in known]] = motion.frames[:, known]
    return np.asarray(_head_gap().opening_mm(weights), np.float64)


@cache
def _head_gap() -> LipGap:
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.face.rig.markers import LipGap

    try:
        return LipGap.of(load_head())
    except FacesynthError as error:
        raise UnavailableError(f"the built-in head is not here ({error})") from None


def _smallest_gaps(gap: Array, phones: PhoneTrack, fps: float) -> Array:
    return _gaps_of(gap, phones, fps, BILABIALS, lambda part: float(part.min()))


def _gaps_of(gap: Array, phones: PhoneTrack, fps: float, wanted: frozenset[str], summary: Callable[[Array], float]) -> Array:
    """One number for each wanted phone that has a frame with a gap; a phone shorter than a frame has its first one."""
    bounds = phones.frame_bounds(fps)
    if bounds[-1] > len(gap) + 1:
        raise FacesynthError(f"the phones last {bounds[-1]} frames, the motion {len(gap)}; give the phones of this motion")
    parts = (gap[start : max(stop, start + 1)] for start, stop in pairwise(bounds))
    chosen = (part[~np.isnan(part)] for part, label in zip(parts, phones.labels, strict=True) if label in wanted)
    return np.array([summary(part) for part in chosen if part.size])


def _known(threshold: float) -> float:
    if np.isnan(threshold):
        raise UnavailableError(
            "there is no threshold: nobody says p, b or m in the recordings, or lips are no nearer there than on average"
        )
    return threshold


def _pearson(mine: Array, yours: Array) -> float:
    spread = mine.std() * yours.std()
    return float(((mine - mine.mean()) * (yours - yours.mean())).mean() / spread) if spread > 1e-12 else 0.0
