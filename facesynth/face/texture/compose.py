"""The speaker's face on synthesised shapes: warped training pictures over the speaker's own video, with a soft border."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

from facesynth.face.texture.interior import Interior, Sources
from facesynth.face.texture.mesh import Mesh, mesh_without_folds
from facesynth.face.texture.speaker import Speaker, within
from facesynth.face.texture.warp import PiecewiseAffineWarp, places_in, sample
from facesynth.inference.errors import FacesynthError
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.pictures import PictureSteps

JUMP_WEIGHT = 6.0
"""How much a jump between training pictures costs, of a typical distance of shapes; see `coherent`."""
FADE_S = 0.12
"""How long one picture fades into the other where they jump."""
CANDIDATES = 96
"""Nearest training shapes that are considered for each frame."""


def nearest(targets: NDArray[np.float64], shapes: NDArray[np.float64]) -> NDArray[np.int64]:
    """[T] the training shape [N, K, 2] nearest (L2) to each target [T, K, 2] (Saisan 2004, §5)."""
    _check(targets, shapes)
    return cKDTree(_flat(shapes)).query(_flat(targets))[1].astype(np.int64)


def coherent(
    targets: NDArray[np.float64],
    shapes: NDArray[np.float64],
    looks: NDArray[np.float64],
    clip_starts: NDArray[np.bool_],
    jump_weight: float = JUMP_WEIGHT,
) -> NDArray[np.int64]:
    """[T] training pictures near the targets whose sequence does not flicker.

    The least sum of (mean squared distance of shapes) + `jump_weight` times (mean squared difference of looks, in units of the
    median difference between recorded neighbours) over all sequences of candidates, as `PictureSteps` has it. Staying on
    a picture, or going on to the one recorded after it, costs nothing.

    targets [T, K, 2] and shapes [N, K, 2] px; looks [N, Q] what the mouth looks like; clip_starts [N] marks the first
    picture of each clip.
    """
    _check(targets, shapes)
    distance, index = cKDTree(_flat(shapes)).query(_flat(targets), k=np.arange(1, min(CANDIDATES, len(shapes)) + 1))
    unary = distance**2 / targets.shape[1]
    natural = np.median(_squared(looks[1:], looks[:-1])[~clip_starts[1:]]) if len(looks) > 1 else 1.0
    scale = jump_weight * np.median(unary[:, 0]) / max(natural, np.finfo(float).tiny)
    steps = PictureSteps(torch.from_numpy(looks), torch.from_numpy(clip_starts), torch.from_numpy(index), scale)
    path = cheapest([target[None] for target in torch.from_numpy(unary)], steps).path[0].numpy()
    return np.take_along_axis(index, path[:, None], axis=1)[:, 0].astype(np.int64)


def _squared(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return ((a - b) ** 2).mean(axis=-1)


def _flat(shapes: NDArray[np.float64]) -> NDArray[np.float64]:
    return shapes.reshape(len(shapes), -1)


def _check(targets: NDArray[np.float64], shapes: NDArray[np.float64]) -> None:
    if targets.ndim != 3 or shapes.ndim != 3 or targets.shape[1:] != shapes.shape[1:] or not len(shapes) or not len(targets):
        raise FacesynthError(
            f"targets [T, K, 2] and training shapes [N, K, 2] do not fit; got {targets.shape} and {shapes.shape}"
        )


BATCH = 4
LARGEST_GAIN = 1.3

Choice = Literal["coherent", "nearest"]


@dataclass
class Report:
    """What drawing took and how it went; complete when the last picture is drawn."""

    frames: int = 0
    seconds: float = 0.0
    folded_triangles: int = 0
    """Triangles turned over, summed over frames: the picture would be torn there."""
    relaxed_frames: int = 0
    """Frames whose shape would have turned triangles over: some of its points were drawn elsewhere, see `Mesh.unfolded`."""
    jumps: int = 0
    """How often the next picture was not the one recorded next."""
    fps: float = field(default=25.0)

    @property
    def real_time_factor(self) -> float:
        """Seconds of drawing for a second of video."""
        return self.seconds * self.fps / max(self.frames, 1)


class TexturedFace:
    """Draws shapes as pictures of the speaker.

    Each frame takes a background from the speaker's video, with the head as it was there, and a training picture whose
    shape is near the wanted one. The training picture is warped so that its points come to lie where the wanted
    shape has them, on the background's head, and faded in over the ring around the points. Its brightness is
    matched to the background's, since light and camera drift between clips. Where the next training picture is not the one
    that was recorded next, both are shown for a moment, one fading into the other. Where the lips are known, what is between
    them is drawn apart, see `interior`.
    """

    def __init__(
        self,
        speaker: Speaker,
        device: str | torch.device = "cpu",
        *,
        jump_weight: float = JUMP_WEIGHT,
        fade_s: float = FADE_S,
    ) -> None:
        self._meeting = speaker.meeting
        self.speaker = speaker = replace(speaker, shapes=speaker.meeting(speaker.shapes))
        self.jump_weight, self.fade = jump_weight, round(fade_s * speaker.fps)
        self.device = torch.device(device)
        self.mesh: Mesh = mesh_without_folds(speaker.shapes, speaker.inner_lips)
        self.height, self.width = speaker.backgrounds.shape[1:3]
        self._opacity = torch.from_numpy(self.mesh.opacity).float().to(self.device)
        self._looks = speaker.looks
        self._sources = self.mesh.unfolded(self.mesh.vertices(speaker.shapes))
        self._interior = Interior(speaker) if speaker.knows_lips else None

    def draw(
        self,
        shapes: NDArray[np.float64],
        background: NDArray[np.int64],
        report: Report,
        choice: Choice = "coherent",
    ) -> Iterator[NDArray[np.uint8]]:
        """Pictures [H, W, 3] for shapes [T, K, 2] (head-fixed px) over the whole pictures number `background` [T]."""
        if len(shapes) != len(background):
            raise FacesynthError(f"every shape needs a background; got {len(shapes)} shapes and {len(background)} backgrounds")
        shapes = self._meeting(shapes)
        sources = self._chosen(shapes, choice)
        following = self._following(sources)
        report.jumps, report.fps = int((~following).sum()), self.speaker.fps
        drawn_from = self._fades(sources, following, self.speaker.shut_share(shapes))
        for first in range(0, len(shapes), BATCH):
            began = time.perf_counter()
            part = slice(first, first + BATCH)
            vertices = self.mesh.vertices(shapes[part])
            drawn = self.mesh.unfolded(vertices)
            report.relaxed_frames += int((drawn != vertices).any(axis=(1, 2)).sum())
            report.folded_triangles += int(self.mesh.folded(drawn).sum())
            pictures = self._drawn(drawn, shapes[part], drawn_from.at(part), background[part])
            report.frames += len(pictures)
            report.seconds += time.perf_counter() - began
            yield from pictures

    def _following(self, sources: NDArray[np.int64]) -> NDArray[np.bool_]:
        """[T - 1] whether the next picture is the same one, or the one recorded next."""
        return (np.diff(sources) == 0) | ((np.diff(sources) == 1) & ~self.speaker.clip_starts[sources[1:]])

    def _fades(self, sources: NDArray[np.int64], following: NDArray[np.bool_], shut: NDArray[np.float64]) -> Sources:
        """Pictures `sources` [T], those that the ones before jumps would have gone on to, and how much of these is still seen.

        The less, the more the lips are `shut` [T]: a closure takes two or three pictures, and an open mouth in it, warped shut,
        is a slit.
        """
        before, share = sources.copy(), np.zeros(len(sources))
        for jump in np.flatnonzero(~following) + 1:
            old = sources[jump - 1]
            for k in range(min(self.fade, len(sources) - int(jump))):
                onward = min(old + k + 1, len(self.speaker.shapes) - 1)
                old_goes_on = not self.speaker.clip_starts[old + 1 : onward + 1].any()
                before[jump + k] = onward if old_goes_on else before[jump + k - 1] if k else old
                share[jump + k] = 1 - (k + 1) / (self.fade + 1)
        return Sources(sources, before, share * (1 - shut))

    def choose(self, shapes: NDArray[np.float64], choice: Choice) -> NDArray[np.int64]:
        """[T] number of the training picture for each shape [T, K, 2]."""
        return self._chosen(self._meeting(shapes), choice)

    def _chosen(self, shapes: NDArray[np.float64], choice: Choice) -> NDArray[np.int64]:
        """The same for shapes whose lips meet where they are shut."""
        wanted, known = self.speaker.compared(shapes), self.speaker.known
        if choice == "nearest":
            return nearest(wanted, known)
        return coherent(wanted, known, self._looks, self.speaker.clip_starts, self.jump_weight)

    @torch.no_grad()
    def _drawn(
        self,
        vertices: NDArray[np.float64],
        shapes: NDArray[np.float64],
        sources: Sources,
        background: NDArray[np.int64],
    ) -> NDArray[np.uint8]:
        head = self.speaker.background_head.at(background)
        target = head.to_picture(vertices)
        left, top, right, bottom = within(target, self.height, self.width)
        behind = self.speaker.backgrounds[background]
        box = torch.from_numpy(behind[:, top:bottom, left:right]).to(self.device).permute(0, 3, 1, 2).float()
        warp = PiecewiseAffineWarp(torch.from_numpy(self.mesh.triangles), bottom - top, right - left).to(self.device)
        wanted = torch.from_numpy(target).float().to(self.device) - torch.tensor([left, top], device=self.device)
        warped, opacity = self._warped(warp, wanted, sources.now, box)
        if (fading := np.flatnonzero(sources.fading)).size:
            old, _ = self._warped(warp, wanted[fading], sources.before[fading], box[fading])
            kept = torch.from_numpy(sources.fading[fading]).float().to(self.device)[:, None, None, None]
            warped[fading] += kept * (old - warped[fading])
        blended = _over(box, warped, _smooth(opacity))
        if self._interior is not None:
            blended = self._interior.over(blended, (left, top), head, shapes, sources)
        out = behind.copy()
        out[:, top:bottom, left:right] = blended.clamp(0, 255).round().byte().permute(0, 2, 3, 1).cpu().numpy()
        return out

    def _warped(
        self, warp: PiecewiseAffineWarp, wanted: Tensor, sources: NDArray[np.int64], box: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Training pictures with their vertices at `wanted` [N, V, 2], as bright as `box` [N, 3, h, w]; and opacity [N, h, w]."""
        pictures = torch.from_numpy(self.speaker.pictures[sources]).to(self.device).permute(0, 3, 1, 2).float()
        source = self.speaker.head.at(sources).to_picture(self._sources[sources]) - self.speaker.corner
        there = torch.from_numpy(source).float().to(self.device)
        values = torch.cat([places_in(pictures, there), self._opacity.expand(len(wanted), -1)[:, :, None]], dim=2)
        drawn = warp.interpolate(wanted, values)
        opacity = drawn[..., 2].clamp(0, 1)
        return matched(sample(pictures, drawn[..., :2], "bicubic"), box, opacity), opacity


def matched(warped: Tensor, behind: Tensor, opacity: Tensor) -> Tensor:
    """`warped` [N, 3, h, w] with each channel's brightness scaled to that of `behind` in the border, where both are seen."""
    border = ((opacity > 0.02) & (opacity < 0.98))[:, None].float()
    gain = (behind * border).sum(dim=(2, 3)) / (warped * border).sum(dim=(2, 3)).clamp(min=1.0)
    return warped * gain.clamp(1 / LARGEST_GAIN, LARGEST_GAIN)[:, :, None, None]


def ping_pong(first: int, stop: int, count: int) -> NDArray[np.int64]:
    """[count] pictures first … stop - 1 forwards and backwards, as long as needed: a background without a jump."""
    there = np.arange(first, stop)
    loop = np.concatenate([there, there[-2:0:-1]]) if len(there) > 2 else there
    return loop[np.arange(count) % len(loop)].astype(np.int64)


def _smooth(opacity: Tensor) -> Tensor:
    return opacity * opacity * (3 - 2 * opacity)


def _over(behind: Tensor, drawn: Tensor, opacity: Tensor) -> Tensor:
    return behind + opacity[:, None] * (drawn - behind)
