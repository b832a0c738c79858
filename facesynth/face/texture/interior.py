"""What is seen between the lips: upper teeth that are fixed to the skull, lower teeth and tongue that are fixed to the jaw.

A warp by the points of the lips would stretch teeth as if they were skin, and a change of training pictures would let them
blink. So the interior is read from training pictures twice, once standing as the head stands and once moving rigidly as
the jaw does; between the lips the upper half is taken from the first reading and the lower half from the second. It comes from
the pictures that the skin is drawn from, while they fade into each other from both. What their lips hide, and the wanted ones
do not, is the mean over the pictures whose lips are nearest to the wanted ones: one comes into the mean with no weight and
grows with it, so that nothing appears from one frame to the next.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

from facesynth.face.texture.lips import Lips
from facesynth.face.texture.speaker import OPENING_WEIGHT, Speaker
from facesynth.face.texture.warp import places_in, sample
from facesynth.inference.arrays import Floats
from facesynth.motion.planar import HeadMaps

MOST_PICTURES = 1500
"""So many training pictures, taken evenly, are read at most."""
AVERAGED = 12
"""Nearest pictures whose mean shows what a picture's own lips hide; the last of them has no weight."""
OF_OTHERS = 0.03
"""Weight of that mean, of the picture's own; where this one shows nothing, the mean is all."""
PER_PX = 2
"""Samples of the interior for each pixel, so that pictures that are put together stay sharp."""
MARGIN_PX = 3.0
FEATHER = 0.03
"""Of the mouth's width: over this distance from where the lips end the interior comes to be seen."""
UNSEEN = 0.3
"""Of that distance: a slit that is narrower is left between lips that meet, see `lips.meeting`, and shows nothing."""
LARGEST_GAIN = 1.3
MIDDLE = (0.35, 0.65)
"""Of the way from the upper lip to the lower one, between which the skull's reading gives way to the jaw's."""
CHUNK = 64


def jaw_maps(jaw: Floats, rest: Floats) -> HeadMaps:
    """The rotations and shifts that bring the jaw's points at rest [M, 2] to those of T shapes [T, M, 2], by least squares.

    As complex numbers a rotation is z -> a z + b with |a| = 1, and a is the direction of the mean of conj(z) w, both centred.
    """
    z, w = rest @ [1, 1j], jaw @ [1, 1j]
    centre, centres = z.mean(), w.mean(axis=1)
    turn = (np.conj(z - centre) * (w - centres[:, None])).sum(axis=1)
    a = np.where(np.abs(turn) > 1e-9, turn / np.maximum(np.abs(turn), 1e-9), 1.0)
    b = centres - a * centre
    linear = np.stack([np.stack([a.real, a.imag], axis=-1), np.stack([-a.imag, a.real], axis=-1)], axis=-2)
    return HeadMaps(linear, np.stack([b.real, b.imag], axis=-1))


@dataclass(frozen=True, eq=False)
class Sources:
    """The training pictures that B frames are drawn from."""

    now: NDArray[np.int64]
    """[B]"""
    before: NDArray[np.int64]
    """[B] what is still seen of the picture that was jumped from …"""
    fading: Floats
    """[B] … by this share."""

    def at(self, part: slice) -> "Sources":
        """Those of some frames."""
        return Sources(self.now[part], self.before[part], self.fading[part])


class Interior:
    """Draws what is between the lips of one speaker."""

    def __init__(self, speaker: Speaker) -> None:
        places = np.unique(np.linspace(0, len(speaker.shapes) - 1, MOST_PICTURES).round().astype(int))
        shapes, self._read = speaker.shapes[places], places
        self._speaker, self._outline, self._jaw = speaker, speaker.inner_lips, speaker.jaw
        self._rest = shapes[:, self._jaw].mean(axis=0)
        self._known = cKDTree(self._lookup(shapes))
        lips = Lips.of(shapes, self._outline)
        self._feather = max(FEATHER * lips.width, 0.5)
        jaw = jaw_maps(shapes[:, self._jaw], self._rest)
        everywhere = np.concatenate([lips.upper, lips.lower], axis=1)
        gains = _gains(speaker)[places]
        self._of_skull = _Layer.read(speaker, places, everywhere, HeadMaps(_units(jaw), 0 * jaw.shift), lips, gains)
        self._of_jaw = _Layer.read(speaker, places, jaw.to_head(everywhere), jaw, lips, gains)

    def over(
        self, picture: Tensor, corner: tuple[int, int], head: HeadMaps, shapes: Floats, sources: "Sources | None" = None
    ) -> Tensor:
        """Pictures [B, 3, h, w], whose first pixel is at `corner` (x, y), with the interior of shapes [B, K, 2] on heads [B].

        Without `sources` it is the mean of the nearest pictures alone.
        """
        lips, jaw = Lips.of(shapes, self._outline), jaw_maps(shapes[:, self._jaw], self._rest)
        weights, chosen = self._weights(shapes)
        if sources is not None:
            weights = np.column_stack([1 - sources.fading, sources.fading, OF_OTHERS * weights])
            chosen = np.column_stack([self._place(sources.now), self._place(sources.before), chosen])
        height, width = picture.shape[-2:]
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(1, -1, 2) + np.array(corner)
        places = head.to_head(np.broadcast_to(pixels.astype(np.float64), (len(shapes), *pixels.shape[1:])))
        seen = [lips.between(t, places[t]) for t in range(len(shapes))]
        opacity = _eased(np.stack([depth for depth, _ in seen]) / self._feather - UNSEEN)
        of_jaw = _eased((np.stack([down for _, down in seen]) - MIDDLE[0]) / (MIDDLE[1] - MIDDLE[0]))
        skull = self._of_skull.at(places, weights, chosen)
        below = self._of_jaw.at(jaw.to_head(places), weights, chosen)
        inside = skull + of_jaw[..., None] * (below - skull)
        share, colours = (torch.from_numpy(a).to(picture) for a in (opacity[:, None], inside.swapaxes(1, 2)))
        flat = picture.flatten(2)
        return (flat + share * (colours - flat)).reshape(picture.shape)

    def _place(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where pictures of the speaker are among those that were read: the nearest of these."""
        return np.abs(numbers[:, None] - self._read).argmin(axis=1)

    def _lookup(self, shapes: Floats) -> Floats:
        """[T, Q] by which shapes are compared: the form of the mouth, its height most, and where the jaw is."""
        apart, jaw = self._speaker.lips_apart(shapes), shapes[:, self._jaw]
        form = shapes[:, self._outline] - shapes[:, self._outline].mean(axis=1, keepdims=True)
        parts = (form, OPENING_WEIGHT * apart, jaw)
        return np.concatenate(parts, axis=1).reshape(len(shapes), -1)

    def _weights(self, shapes: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """[B, A] weights of the nearest pictures, 1 together, and which they are [B, A]; the farthest of them has none."""
        count = min(AVERAGED, self._known.n)
        distance, chosen = self._known.query(self._lookup(shapes), k=np.arange(1, count + 1))
        weights = np.square(1 - np.square(distance / np.maximum(distance[:, -1:], 1e-9))) + 1e-9
        return weights / weights.sum(axis=1, keepdims=True), chosen


@dataclass(frozen=True, eq=False)
class _Layer:
    """The interior in the training pictures, in the coordinates of one rigid part."""

    colours: NDArray[np.uint8]
    """[N, 3, h, w]"""
    seen: NDArray[np.uint8]
    """[N, h, w] how far each sample lies within the lips, 0..255."""
    mean: Floats
    """[3, h, w] over all pictures in which a sample is seen."""
    corner: Floats
    """[2] (x, y) of the first sample, px."""

    @classmethod
    def read(cls, speaker: Speaker, places: NDArray[np.int64], reach: Floats, part: HeadMaps, lips: Lips, gains: Floats) -> Self:
        """From the pictures `places` [N]; `part` [N] is where the part is on the head, its points [N, P, 2] its extent."""
        low, high = reach.min(axis=(0, 1)) - MARGIN_PX, reach.max(axis=(0, 1)) + MARGIN_PX
        width, height = np.ceil((high - low) * PER_PX).astype(int)
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(1, -1, 2) / PER_PX + low
        colours = np.empty((len(places), 3, height, width), np.uint8)
        seen = np.empty((len(places), height, width), np.uint8)
        for first in range(0, len(places), CHUNK):
            some = slice(first, first + CHUNK)
            numbers = places[some]
            on_head = part.at(np.arange(len(places))[some]).to_picture(np.broadcast_to(grid, (len(numbers), *grid.shape[1:])))
            in_picture = speaker.head.at(numbers).to_picture(on_head) - speaker.corner
            pictures = torch.from_numpy(speaker.pictures[numbers]).permute(0, 3, 1, 2).float()
            at = places_in(pictures, torch.from_numpy(in_picture).float()).reshape(len(numbers), height, width, 2)
            lit = sample(pictures, at, "bicubic").numpy() * gains[some, :, None, None]
            colours[some] = lit.round().clip(0, 255).astype(np.uint8)
            depth = np.stack([lips.between(first + n, on_head[n])[0] for n in range(len(numbers))])
            seen[some] = (255 * _eased(depth)).round().reshape(len(numbers), height, width).astype(np.uint8)
        known = seen.astype(np.float32).sum(axis=0)
        total = np.einsum("nhw,nchw->chw", seen.astype(np.float32), colours.astype(np.float32))
        dark = np.percentile(total.sum(axis=0)[known > 0] / known[known > 0], 10) / 3 if known.any() else 0.0
        return cls(colours, seen, (total + dark) / (known + 1), low)

    def at(self, places: Floats, weights: Floats, chosen: NDArray[np.int64]) -> Floats:
        """[B, P, 3] colours at places [B, P, 2] px, the mean of the chosen pictures [B, A] by weights [B, A]."""
        averaged = np.stack([self._mean_of(*one) for one in zip(weights, chosen, strict=True)])
        layer = torch.from_numpy(averaged).float()
        at = places_in(layer, torch.from_numpy((places - self.corner) * PER_PX).float())[:, None]
        return np.asarray(sample(layer, at)[:, :, 0].numpy().swapaxes(1, 2), np.float64)

    def _mean_of(self, weights: Floats, chosen: NDArray[np.int64]) -> Floats:
        share = weights[:, None, None] * self.seen[chosen] / 255 + 0.0
        total = np.einsum("ahw,achw->chw", share, self.colours[chosen].astype(np.float64))
        lacking = 0.1 * OF_OTHERS
        return np.asarray((total + lacking * self.mean) / (share.sum(axis=0) + lacking))


def _gains(speaker: Speaker) -> Floats:
    """[N, 3] what each training picture is multiplied by to be lit as the pictures that it is laid over."""
    x, y = speaker.corner
    height, width = speaker.pictures.shape[1:3]
    behind = speaker.backgrounds[:, y : y + height : 4, x : x + width : 4].mean(axis=(0, 1, 2))
    own = speaker.pictures[:, ::4, ::4].mean(axis=(1, 2))
    return np.clip(behind / np.maximum(own, 1.0), 1 / LARGEST_GAIN, LARGEST_GAIN)


def _units(like: HeadMaps) -> Floats:
    return np.broadcast_to(np.eye(2), like.linear.shape)


def _eased(share: Floats) -> Floats:
    """0 up to 0, 1 from 1 on, smooth between."""
    held = np.clip(share, 0, 1)
    return held * held * (3 - 2 * held)
