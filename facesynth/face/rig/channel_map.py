"""The names of a head of one's own against ARKit's: which channel does what, how strongly, and within which limits."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from unicodedata import normalize

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.motion.arkit_names import ARKIT_NAMES

_SIDES = {"l": "Left", "r": "Right", "left": "Left", "right": "Right"}
_SIDE_FIRST = re.compile(r"^(?:([LR])[_ .-]|(left|right)[_ .-]?)(?=[A-Za-z])", re.IGNORECASE)
_PART_FIRST = re.compile(r"^(?:head|face|body|mesh|geo)(?=[A-Z])")
_ENDINGS = re.compile(
    r"(?:[_ .-](?:blend_?shapes?|shapes?|morphs?|targets?|div\d|head|face|teeth|mesh|geo|\d{1,2})|blendshape)+$", re.IGNORECASE
)
RIDGE = 1e-4
"""Price of a weight where own channels are turned into ARKit's: it decides only what they leave open."""


@dataclass(frozen=True)
class Channel:
    """How one channel follows the ARKit weights: `clip(gain · Σ share · weight + offset, low, high)`."""

    shares: Mapping[str, float]
    """ARKit name to its share; empty: the channel follows nothing."""
    gain: float = 1.0
    offset: float = 0.0
    low: float = 0.0
    high: float = 1.0
    mute: bool = False
    """The channel stays at 0."""
    turn_deg: tuple[float, float, float] | None = None
    """The channel is a joint that turns so far at 1, about the axes to the head's left, up and out of the face."""


@dataclass(frozen=True, eq=False)
class ChannelMap:
    """N channels of somebody's own beside the 52 of ARKit."""

    names: tuple[str, ...]
    channels: tuple[Channel, ...]

    @classmethod
    def of(cls, names: Sequence[str], given: Mapping[str, Channel] | None = None, *, needs_arkit: bool = True) -> "ChannelMap":
        """The given channels, and for the others what their names mean where those are ARKit's.

        FacesynthError where a given channel does not exist, or where nothing at all follows ARKit's weights although
        something has to (`needs_arkit`).
        """
        given = given or {}
        for name in given:
            if name not in names:
                raise unknown("channel of the mapping", name, names)
        found = tuple(given.get(name) or _by_name(name) for name in names)
        if needs_arkit and not any(channel.shares for channel in found):
            raise FacesynthError(
                f"none of the channels {list(names[:4])} … has a name of ARKit's such as jawOpen, or of a preset;"
                " give a mapping file (--mapping)"
            )
        return cls(tuple(names), found)

    @property
    def idle(self) -> tuple[str, ...]:
        """Channels that follow nothing."""
        return tuple(name for name, channel in zip(self.names, self.channels, strict=True) if not channel.shares)

    def own(self, weights: ArrayLike) -> NDArray[np.float64]:
        """[T, N] values of the channels under ARKit weights [T, 52]."""
        values = np.asarray(weights, np.float64) @ self._mix
        gain, offset, low, high, live = self._columns
        return np.clip(values * gain + offset, low, high) * live

    def arkit(self, values: ArrayLike) -> NDArray[np.float64]:
        """[T, 52] weights 0..1 that come closest to values [T, N] of the channels (bounded least squares).

        Channels that are muted or follow nothing say nothing; of weights that no channel shows the least is taken: 0.
        """
        gain, offset, _, _, live = self._columns
        used = (live > 0) & (np.abs(gain) > 0) & np.array([bool(channel.shares) for channel in self.channels])
        wanted = np.asarray(values, np.float64)[:, used] - offset[used]
        basis = self._mix[:, used] * gain[used]
        weights = wanted @ np.linalg.pinv(basis)
        beyond = ((weights < 0) | (weights > 1)).any(axis=1)
        weights[beyond] = _bounded(basis, wanted[beyond])
        return weights

    @property
    def ranges(self) -> NDArray[np.float64]:
        """[N, 2] lowest and highest value of each channel; a mute one stays at 0."""
        return np.array([(0.0, 0.0) if channel.mute else (channel.low, channel.high) for channel in self.channels])

    @property
    def _mix(self) -> NDArray[np.float64]:
        """[52, N] share of each weight in each channel."""
        mix = np.zeros((len(ARKIT_NAMES), len(self.names)))
        for column, channel in enumerate(self.channels):
            for name, share in channel.shares.items():
                mix[ARKIT_NAMES.index(name), column] = share
        return mix

    @property
    def _columns(self) -> NDArray[np.float64]:
        """[5, N] gain, offset, low, high, and 0 where a channel is mute."""
        return np.array([[c.gain, c.offset, c.low, c.high, not c.mute] for c in self.channels], np.float64).T


def on_channels(animation: FaceAnimation, channel_map: ChannelMap) -> FaceAnimation:
    """An animation in the channels of a map: by their own names where it has those, else from its ARKit weights."""
    names = channel_map.names
    if set(names) <= set(animation.names):
        low, high = (np.array([limit[animation.names.index(name)] for name in names]) for limit in animation.limits)
        return replace(animation, names=names, weights=animation.weights_for(names), ranges=np.stack([low, high], axis=1))
    if not set(animation.names) & set(ARKIT_NAMES):
        odd = ", ".join(animation.names[:3])
        raise FacesynthError(f"the curves {odd} … are neither this head's nor ARKit's; give a mapping file (--mapping)")
    weights = animation.weights_for(ARKIT_NAMES)
    jaw, close = (ARKIT_NAMES.index(name) for name in ("jawOpen", "mouthClose"))
    weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])  # it undoes the jaw at the lips, and nothing else
    values = channel_map.own(weights)
    return replace(animation, names=names, weights=values, ranges=channel_map.ranges)


def _bounded(basis: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights [T, 52] in 0..1 whose channels `weights @ basis` [52, M] come closest to wanted [T, M]."""
    from facesynth.face.solve.bounded import solve

    weights = np.zeros((len(wanted), len(basis)))
    seen = np.abs(basis).sum(axis=1) > 0
    weights[:, seen] = solve(basis[seen], wanted, np.full(int(seen.sum()), RIDGE), fps=1.0, smoothing_s=0.0)
    return weights


def arkit_name(name: str) -> str | None:
    """The ARKit name that a name means, whatever its case, its prefixes and its way to tell the sides apart."""
    plain = list(folded_names(name))
    return next((_FOLDED[one] for one in (*plain, *map(_both_sides, plain)) if one in _FOLDED), None)


def _both_sides(plain: str) -> str:
    """A name without its side, where ARKit has one weight for both: `browInnerUp_L`, `cheekPuffRight`."""
    return re.sub(r"(?:left|right)$", "", plain)


def folded_names(name: str) -> Iterator[str]:
    """What a name may say, small letters and digits (of any script, of one width) alone, the whole first.

    Without Blender's `.001`, without what mesh or exporter put before it (`head_lod0_mesh__`, `Face.`, `A25_`), and `_L`,
    `.R` or `L` as left and right. Then without endings that say no more than what it is: `_1`, `_blendshape`, and the `_r`
    and `_c` of OpenFace's action units, which are intensity and presence, no sides.
    """
    whole = re.sub(r"\.\d{3}$", "", normalize("NFKC", name).strip())
    texts = (whole, _ENDINGS.sub("", whole), _side_last(whole), _PART_FIRST.sub("", whole))
    yield from dict.fromkeys(plain for text in texts for plain in _without_starts(_sided(text)))


def _side_last(text: str) -> str:
    """`L_eyeBlink` and `leftEyeBlink` as eyeBlinkLeft; behind a mesh's name as well."""
    *before, last = re.split(r"(?<=[.:|/])|(?<=__)", text)
    found = _SIDE_FIRST.match(last)
    return "".join(before) + (last[found.end() :] + _SIDES[(found[1] or found[2]).lower()] if found else last)


def _sided(text: str) -> str:
    text = re.sub(r"(?<![A-Za-z])(AU)(?=\d(?!\d))", r"\g<1>0", text, flags=re.IGNORECASE)
    text = re.sub(r"(?<![A-Za-z])(AU\d\d)[_ .-]([LR])$", r"\1\2", re.sub(r"(AU\d\d)_[rc]$", r"\1", text))
    return re.sub(r"(?:[_ .-]([LRlr])|(?<=[a-z])([LR]))$", lambda side: _SIDES[(side[1] or side[2]).lower()], text)


def _without_starts(text: str) -> Iterator[str]:
    starts = [0, *(match.end() for match in re.finditer(r"__|[_:|./ -]", text))]
    yield from (plain for start in starts if (plain := re.sub(r"[\W_]", "", text[start:].lower())))


def _by_name(name: str) -> Channel:
    found = arkit_name(name)
    return Channel({found: 1.0} if found else {})


def _folded(names: Iterable[str]) -> dict[str, str]:
    return {name.lower(): name for name in names}


_FOLDED = _folded(ARKIT_NAMES)
