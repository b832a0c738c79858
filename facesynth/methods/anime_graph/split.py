"""Which components carry speech, and which emotion (Cao 2005, §5.1.3).

Decided by evidence: that emotions change a component more than another take of the same emotion does is tested by
permutation, and of the components that pass, as many as are wrong by chance are expected to be a twentieth (false discovery
rate, Benjamini and Hochberg 1995). What share of the change is the emotion's, 1 - (takes' / emotions')², says whether
such a component carries emotion and little else. Where these do not hold nearly all of what emotions change, because the
others carry both, all are mapped, each by its share, so that the speech ones change little more than on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import false_discovery_control

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.methods.anime_graph.components import FaceComponents, block_columns
from facesynth.methods.anime_graph.parallel import Take, aligned, emotion_pairs, retakes

SHARE = 0.75
"""A component is emotional when this share of its squared change between emotions is not found between takes of one: when
emotions change it twice as much (RMS) …"""
DISCOVERY = 0.05
"""… and it is among components of which so many are expected to be found by chance."""
HELD = 0.9
"""Emotional components are told from speech when they hold this share of what emotions change (mm², beyond what takes do);
where they hold less, speech and emotion are mixed."""
MOUTH_SHARE = 0.02
"""A component is speech when it explains this share of the mouth's motion within sentences."""
MOSTLY_SPEECH = 0.25
"""A component that explains more than this share of it is never counted as emotional: it would carry the words along."""
SHUFFLES = 999
MOST_PAIRS = 60
"""Pairs of one kind that are compared."""


@dataclass(frozen=True, eq=False)
class Split:
    """Scores of the D components, and what they are taken for."""

    ratio: Floats
    """[D] RMS difference between emotions over that between takes of one emotion."""
    chance: Floats
    """[D] p-value of that by permutation …"""
    discovery: Floats
    """[D] … and the share of false ones among all components that are as unlikely."""
    mouth_share: Floats
    """[D] share of the mouth's motion that each component explains alone."""
    emotional: NDArray[np.int64]
    """The components that maps change, in ascending order: all of them where `mixed`."""
    speech: NDArray[np.int64]
    yardstick: str
    """`takes`, or, in corpora without second takes, `sentences`."""
    held: float = 0.0
    """Share of what emotions change beyond takes, in the layout's unit squared, that the emotional components hold."""
    mixed: bool = False
    """Whether emotions change components, but those that are emotional and little else do not hold nearly all of it."""

    @cached_property
    def emotion_share(self) -> Floats:
        """[D] share of the squared difference between emotions that is the emotion's: 0 where takes differ as much."""
        return np.maximum(0.0, 1 - 1 / np.maximum(self.ratio, 1.0) ** 2)

    @property
    def weights(self) -> Floats:
        """[E] how much of what the pose says of a change is taken: all, or where components are mixed the emotion's share."""
        return self.emotion_share[self.emotional] if self.mixed else np.ones(len(self.emotional))

    def summary(self) -> str:
        """One sentence that says what was found."""
        if not len(self.ratio):
            return "no sentence was recorded in two emotions: there are no emotion maps"
        count, changed = len(self.ratio), int((self.discovery < DISCOVERY).sum())
        than = "another take does" if self.yardstick == "takes" else "by chance from sentence to sentence"
        evidence = (
            f"{changed} of {count} components change with emotion more than {than} (false discovery rate below {DISCOVERY:g})"
        )
        if self.mixed:
            return (
                f"{evidence}, but those that are emotional and little else hold {self.held:.0%} of what emotions change: speech "
                "and emotion are mixed, so all components are mapped, those of speech weighted down"
            )
        if not len(self.emotional):
            return f"{evidence}: there is nothing to map"
        names = ", ".join(map(str, self.emotional.tolist()))
        return (
            f"{evidence}; {len(self.emotional)} of them ({names}) are emotional and hold {self.held:.0%} of what emotions "
            "change: maps change these, and shift the others by the mean"
        )

    def report(self, blocks: Sequence[str], block: Sequence[int]) -> list[dict[str, Any]]:
        """One row for each component, for people and for JSON."""
        emotional = [] if self.mixed else self.emotional.tolist()
        kinds = {**dict.fromkeys(self.speech.tolist(), "speech"), **dict.fromkeys(emotional, "emotion")}
        return [
            {
                "component": n,
                "block": blocks[block[n]],
                "is": kinds.get(n, "neither"),
                "emotion_ratio": round(float(self.ratio[n]), 3),
                "emotion_share": round(float(self.emotion_share[n]), 3),
                "chance": round(float(self.chance[n]), 4),
                "false_discovery": round(float(self.discovery[n]), 4),
                "mouth_share": round(float(self.mouth_share[n]), 4),
                "yardstick": self.yardstick,
            }
            for n in range(len(self.ratio))
        ]


_NO_SCORES, _NONE = np.zeros(0), np.zeros(0, np.int64)
NOTHING_SPLIT = Split(_NO_SCORES, _NO_SCORES, _NO_SCORES, _NO_SCORES, _NONE, _NONE, "none")
"""Of a corpus in which no sentence was recorded in two emotions."""


def split_components(
    takes: Sequence[Take], components: FaceComponents, layout: Layout, override: Sequence[int] | None, *, seed: int
) -> Split:
    """Score every component and split; `override` names the emotional ones and leaves the scores a report.

    In a corpus without second takes the yardstick is how much the emotional difference itself varies from sentence
    to sentence: what is constant over sentences is emotion.
    """
    share = mouth_shares(takes, components, layout)
    by = np.flatnonzero(share >= MOUTH_SHARE)
    by = by if len(by) else np.array([int(share.argmax())])
    between = _differences(_some([p for a, b in _emotion_names(takes) for p in emotion_pairs(takes, a, b)]), by)
    within = _differences(_some(retakes(takes)), by)
    rng = np.random.default_rng(seed)
    offsets = np.array([d.mean(axis=0) for d in between])
    if len(within) >= 2:
        ratio, chance = _against_takes(_squares(between), _squares(within), rng)
    else:
        ratio, chance = _against_sentences(offsets, rng)
    discovery = false_discovery_control(chance)
    scored = Split(ratio, chance, discovery, share, _NONE, by, "takes" if len(within) >= 2 else "sentences")
    pure = _pure(scored) if override is None else _named(override, components.count)
    changes = scored.emotion_share * (_squares(between) if len(within) >= 2 else np.square(offsets)).mean(axis=0)
    changes = changes * np.square(components.mixing.numpy()).sum(axis=0)
    held = float(changes[pure].sum() / max(changes.sum(), 1e-12))
    mixed = override is None and held < HELD and bool((discovery < DISCOVERY).any())
    emotional = np.arange(components.count) if mixed else pure
    speech = by if mixed else np.setdiff1d(by, emotional)
    if not len(speech):
        speech = np.setdiff1d(np.arange(components.count), emotional)[:1]
    return replace(scored, emotional=emotional, speech=speech, held=held, mixed=mixed)


def _pure(scored: Split) -> NDArray[np.int64]:
    """The components that are emotional and little else."""
    clear = (scored.discovery < DISCOVERY) & (scored.emotion_share >= SHARE)
    return np.flatnonzero(clear & (scored.mouth_share <= MOSTLY_SPEECH))


def _named(override: Sequence[int], count: int) -> NDArray[np.int64]:
    emotional = np.unique(np.asarray(override, np.int64))
    if len(emotional) and not 0 <= emotional[0] <= emotional[-1] < count:
        raise FacesynthError(f"emotional components must be 0 to {count - 1}; got {list(override)}")
    return emotional


def mouth_shares(takes: Sequence[Take], components: FaceComponents, layout: Layout) -> Floats:
    """[D] share of the mouth's motion within sentences that eq. 9, the motion rebuilt from one component, explains."""
    group = next((g for g in ("mouth", "lips_inner", "lips_outer", "jaw") if g in layout.groups), None)
    columns = layout.columns(group) if group else block_columns(layout)[0]
    mixing = components.mixing.numpy()[columns]
    total, left = 0.0, np.zeros(components.count)
    for take in takes:
        moved = take.frames[:, columns] - take.frames[:, columns].mean(axis=0)
        u = take.components - take.components.mean(axis=0)
        total += float(np.square(moved).sum())
        explained = 2 * (u * (moved @ mixing)).sum(axis=0) - np.square(u).sum(axis=0) * np.square(mixing).sum(axis=0)
        left += explained
    return left / max(total, np.finfo(float).tiny)


def _emotion_names(takes: Sequence[Take]) -> list[tuple[str, str]]:
    return list(combinations(sorted({t.emotion for t in takes}), 2))


def _some(pairs: Sequence[tuple[Take, Take]]) -> Sequence[tuple[Take, Take]]:
    return pairs[:: max(1, -(-len(pairs) // MOST_PAIRS))]


def _differences(pairs: Sequence[tuple[Take, Take]], by: NDArray[np.int64]) -> list[Floats]:
    """[T, D] aligned difference of each pair."""
    return [a.components - b.components[aligned(a, b, by)] for a, b in pairs]


def _squares(differences: Sequence[Floats]) -> Floats:
    return np.array([np.square(d).mean(axis=0) for d in differences])


def _against_takes(between: Floats, within: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Ratio [D] of RMS differences, and how often shuffled pairs [n, D] reach it."""

    def ratio(values: Floats) -> Floats:
        return np.sqrt(values[: len(between)].mean(axis=0) / np.maximum(values[len(between) :].mean(axis=0), 1e-12))

    values = np.concatenate([between, within])
    found = ratio(values)
    reached = np.sum([ratio(rng.permutation(values)) >= found for _ in range(SHUFFLES)], axis=0)
    return found, (reached + 1) / (SHUFFLES + 1)


def _against_sentences(offsets: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Ratio [D] of the size of offsets [n, D] to their spread, and how often random signs reach their mean."""
    spread = np.maximum(offsets.std(axis=0), 1e-6)
    found = np.abs(offsets.mean(axis=0))
    signs = rng.choice([-1.0, 1.0], (SHUFFLES, len(offsets)))
    reached = (np.abs(signs @ offsets / len(offsets)) >= found).sum(axis=0)
    return np.sqrt(np.square(offsets).mean(axis=0)) / spread, (reached + 1) / (SHUFFLES + 1)
