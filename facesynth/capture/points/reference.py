"""The points of one speaker: chosen once on a reference picture, found again in every clip."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.capture.points.footage import Footage
from facesynth.capture.points.mouth import follow_mouth, mouth_mask
from facesynth.capture.points.region import FaceRegion
from facesynth.capture.points.shapes import Shapes, mean_shape, shapes_of
from facesynth.capture.points.tracking import Drift, Grey, Points, corners, drift, follow_clip
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.npz import read_arrays
from facesynth.motion.planar import tracked_layout
from facesynth.progress import track

COUNT = 200
"""Points of the lower face that are looked for (Saisan 2004, §5); a quarter of it on the upper face."""
KEPT_SHARE = 0.6
"""Points found in a smaller share of the first clips' frames are given up; a clip in which fewer are found is refused."""
FEWEST_POINTS = 12


@dataclass(frozen=True)
class Following:
    """How well the points of a clip were followed."""

    lost_share: float
    """Share of samples that were lost, and filled from their neighbours in time and place."""
    drift: Drift


@dataclass(frozen=True, eq=False)
class Reference:
    """A picture of the speaker and the points on it."""

    picture: Grey
    """[H, W] brightness."""
    points: Points
    """[K + J, 2] (x, y) px in the picture, the lower face's K first, then J that tell how the head moves."""
    lower: int
    """K"""
    mean: NDArray[np.float64]
    """[K + J, 2] head-fixed mean shape of the clips that the points were chosen on."""
    mouth: bool = False
    """Whether the lips and the chin are found by the face mesh, and follow the K points in every shape."""
    face: int = 0
    """Which face has them, counted from the left; 0: the only one."""

    @classmethod
    def choose(
        cls,
        clips: Sequence[Footage],
        region: FaceRegion,
        count: int = COUNT,
        *,
        mouth: bool = False,
        face: int | None = None,
    ) -> Self:
        """Shi-Tomasi corners of the first clip's first picture that can be followed through all clips.

        With `mouth` the lips and the chin are found by the face mesh, and no corners are looked for on the lips.
        """
        picture = grey(clips[0].frames[:1])[0]
        skin = region.lower & ~_lips(clips[0].frames[:1], clips[0].fps, face) if mouth else region.lower
        lower, upper = corners(picture, skin, count), corners(picture, region.upper, count // 4)
        if len(lower) < FEWEST_POINTS:
            raise FacesynthError(
                f"only {len(lower)} points stand out in the lower face, at least {FEWEST_POINTS} are needed; check the box "
                "or the mask, or give video that is sharper and better lit"
            )
        start = np.concatenate([lower, upper])
        paths = [follow_clip(grey(clip.frames), picture, start) for clip in track(clips, "choosing points")]
        kept = np.mean(np.concatenate([np.isfinite(path[:, :, 0]) for path in paths]), axis=0) >= KEPT_SHARE
        remaining = int(kept[: len(lower)].sum())
        if remaining < FEWEST_POINTS:
            raise FacesynthError(
                f"only {remaining} of {len(lower)} points could be followed through the clips; is it one speaker and one camera, "
                "without cuts?"
            )
        paths = [path[:, kept] for path in paths]
        mean = mean_shape(start[kept], remaining, paths, clips[0].fps)
        return cls(picture, start[kept], remaining, mean, mouth, face or 0)

    @property
    def layout(self) -> Layout:
        """Of the shapes that are found."""
        return tracked_layout(self.lower, mouth=self.mouth)

    def find(self, footage: Footage) -> tuple[Shapes, Following]:
        """The shapes of a clip of the same speaker and camera; FacesynthError where too few points are found again."""
        if footage.frames.shape[1:3] != self.picture.shape:
            sizes = (f"{size[1]}×{size[0]}" for size in (footage.frames.shape[1:3], self.picture.shape))
            raise FacesynthError("its pictures are {} px, those of the first clip {}; give clips of one camera".format(*sizes))
        clip = grey(footage.frames)
        path = follow_clip(clip, self.picture, self.points)
        found = np.isfinite(path[:, : self.lower, 0])
        if found.mean() < KEPT_SHARE:
            raise FacesynthError(
                f"only {found.mean():.0%} of the speaker's points are found in it, at least {KEPT_SHARE:.0%} are needed; "
                "is it another speaker, another camera, or a hidden mouth?"
            )
        shapes = shapes_of(self.points, self.lower, self.mean, footage.at_regular_times(path), footage.fps)
        if self.mouth:
            lips = follow_mouth(footage.frames, footage.fps, self.face or None)
            shapes = shapes.joined(footage.at_regular_times(lips))
        seen = path[0, : self.lower][found[0]]
        return shapes, Following(float(1 - found.mean()), drift(clip, seen if len(seen) else self.points[: self.lower]))

    def save(self, path: str | Path) -> None:
        """Write one .npz, atomically."""
        with atomic_path(path) as part, open(part, "wb") as file:
            np.savez_compressed(file, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; FacesynthError for anything else."""
        added = ("mouth", "face")
        required = [field.name for field in fields(cls) if field.name not in added]
        arrays = read_arrays(path, "a file of the points of a speaker", required, added)
        picture, points, mean = arrays["picture"], arrays["points"], arrays["mean"]
        lower = int(arrays["lower"])
        whole = picture.ndim == 2 and picture.dtype == np.uint8 and points.shape == mean.shape == (len(points), 2)
        if not (whole and 3 <= lower <= len(points) and np.isfinite(points).all() and np.isfinite(mean).all()):
            raise FacesynthError(f"{path} holds no points of a speaker, or is damaged; make the corpus anew")
        has_mouth, face = bool(arrays.get("mouth", False)), int(arrays.get("face", 0))
        return cls(picture, points.astype(np.float32), lower, mean.astype(np.float64), has_mouth, face)


def _lips(first: NDArray[np.uint8], fps: float, face: int | None) -> NDArray[np.bool_]:
    """[H, W] where the lips are in a picture [1, H, W, 3]."""
    return mouth_mask(follow_mouth(first, fps, face)[0], *first.shape[1:3])


def grey(frames: NDArray[np.uint8]) -> Grey:
    """[T, H, W] brightness of pictures [T, H, W, 3]."""
    import torch
    from kornia.color import rgb_to_grayscale

    colours = (torch.from_numpy(frame).permute(2, 0, 1).float() for frame in frames)
    return np.stack([rgb_to_grayscale(picture)[0].round().byte().numpy() for picture in colours])
