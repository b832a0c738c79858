"""The speaker's face on synthesised shapes: warped training pictures over the speaker's own video, with a soft border."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch import Tensor

from facesynth.face.texture.mesh import Mesh, ringed_mesh
from facesynth.face.texture.speaker import Speaker, within
from facesynth.face.texture.warp import PiecewiseAffineWarp, places_in, sample
from facesynth.inference.errors import FacesynthError
from facesynth.motion.planar import HeadMaps
from facesynth.motion.search.cheapest import cheapest
from facesynth.motion.search.pictures import PictureSteps

CANDIDATES = 48
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
    jump_weight: float = 0.1,
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
    """Triangles turned over, summed over frames: the picture is torn there."""
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
    matched to the background's, since light and camera drift between clips.
    """

    def __init__(self, speaker: Speaker, device: str | torch.device = "cpu") -> None:
        self.speaker = speaker
        self.device = torch.device(device)
        self.mesh: Mesh = ringed_mesh(speaker.shapes.mean(axis=0))
        self.height, self.width = speaker.backgrounds.shape[1:3]
        self._opacity = torch.from_numpy(self.mesh.opacity).float().to(self.device)
        self._looks = speaker.looks

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
        sources = self.choose(shapes, choice)
        following = (np.diff(sources) == 0) | ((np.diff(sources) == 1) & ~self.speaker.clip_starts[sources[1:]])
        report.jumps, report.fps = int((~following).sum()), self.speaker.fps
        for first in range(0, len(shapes), BATCH):
            began = time.perf_counter()
            part = slice(first, first + BATCH)
            pictures, folded = self._drawn(shapes[part], sources[part], background[part])
            report.folded_triangles += folded
            report.frames += len(pictures)
            report.seconds += time.perf_counter() - began
            yield from pictures

    def choose(self, shapes: NDArray[np.float64], choice: Choice) -> NDArray[np.int64]:
        """[T] number of the training picture for each shape."""
        if choice == "nearest":
            return nearest(shapes, self.speaker.shapes)
        return coherent(shapes, self.speaker.shapes, self._looks, self.speaker.clip_starts)

    @torch.no_grad()
    def _drawn(
        self, shapes: NDArray[np.float64], sources: NDArray[np.int64], background: NDArray[np.int64]
    ) -> tuple[NDArray[np.uint8], int]:
        target = self._on_head(self.speaker.background_head.at(background), shapes)
        source = self._on_head(self.speaker.head.at(sources), self.speaker.shapes[sources]) - self.speaker.corner
        folded = int(self.mesh.folded(target).sum())
        left, top, right, bottom = within(target, self.height, self.width)
        behind = self.speaker.backgrounds[background]
        box = torch.from_numpy(behind[:, top:bottom, left:right]).to(self.device).permute(0, 3, 1, 2).float()
        pictures = torch.from_numpy(self.speaker.pictures[sources]).to(self.device).permute(0, 3, 1, 2).float()
        warp = PiecewiseAffineWarp(torch.from_numpy(self.mesh.triangles), bottom - top, right - left).to(self.device)
        corner = torch.tensor([left, top], device=self.device)
        wanted = torch.from_numpy(target).float().to(self.device) - corner
        there = torch.from_numpy(source).float().to(self.device)
        values = torch.cat([places_in(pictures, there), self._opacity.expand(len(wanted), -1)[:, :, None]], dim=2)
        drawn = warp.interpolate(wanted, values)
        opacity = drawn[..., 2].clamp(0, 1)
        warped = sample(pictures, drawn[..., :2], "bicubic")
        blended = _over(box, matched(warped, box, opacity), _smooth(opacity))
        out = behind.copy()
        out[:, top:bottom, left:right] = blended.clamp(0, 255).round().byte().permute(0, 2, 3, 1).cpu().numpy()
        return out, folded

    def _on_head(self, head: HeadMaps, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertices [T, V, 2] px of head-fixed shapes [T, K, 2] on heads in a picture."""
        return head.to_picture(self.mesh.vertices(shapes))


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
