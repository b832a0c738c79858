"""A drawn face that chews, whose every point's motion is known."""

import numpy as np
import torch

from facesynth.face.texture.warp import places_in, sample

HEIGHT, WIDTH = 120, 160
BOX = (40, 10, 120, 110)


def skin(seed):
    """[H, W] smooth noise, 0..255."""
    from scipy.ndimage import gaussian_filter

    picture = gaussian_filter(np.random.default_rng(seed).uniform(0, 255, (HEIGHT, WIDTH)), 1.6)
    return (255 * (picture - picture.min()) / np.ptp(picture)).astype(np.float32)


def drawn(texture, motion):
    """[T, H, W] the texture with motion(t, x, y) px, the displacement of the point that is at (x, y) at t = 0."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    frames = []
    for t in range(motion.length):
        back = np.stack([x, y], axis=-1)
        for _ in range(5):  # the point that comes to lie here: a fixed point, since the motion is gentle
            back = np.stack([x, y], axis=-1) - motion(t, back[..., 0], back[..., 1])
        picture = torch.from_numpy(texture)[None, None]
        frames.append(sample(picture, places_in(picture, torch.from_numpy(back).float()[None]))[0, 0].numpy())
    return np.stack(frames).round().clip(0, 255).astype(np.uint8)


class Chewing:
    """The head wanders and turns; below the middle, the face moves down by `opening_px` [T], up to 4 px where none is given."""

    def __init__(self, length, phase=0.0, opening_px=None):
        self.length, self.phase = length, phase
        self.opening_px = 4 * np.sin(0.4 * np.arange(length)) ** 2 if opening_px is None else opening_px

    def head(self, t):
        return 0.04 * np.sin(0.2 * t + self.phase), np.array(
            [3 * np.sin(0.15 * t + self.phase), 2 * np.sin(0.1 * t + self.phase)]
        )

    def face(self, t, x, y):
        return np.stack([0 * x, self.opening_px[t] / (1 + np.exp(-(y - 85) / 6))], axis=-1)

    def __call__(self, t, x, y):
        angle, shift = self.head(t)
        moved = np.stack([x, y], axis=-1) + self.face(t, x, y) - np.array([80, 60])
        turned = moved @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return turned + np.array([80, 60]) + shift - np.stack([x, y], axis=-1)
