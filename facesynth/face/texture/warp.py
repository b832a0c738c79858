"""The piecewise-affine backward warp (Saisan 2004, §5), on any torch device.

Pixel centres are at whole numbers: pixel (row i, column j) is the point x = j, y = i, and a picture of W columns
reaches from -0.5 to W - 0.5. kornia reads the pixels, at places from -1 (the first pixel) to 1 (the last one). Where to
read is linear in each triangle; kornia, whose maps are affine, perspective or thin-plate, has none of this kind, so
that the triangles are filled here. Places are brought to -1 … 1 at the vertices: done by `remap` itself, pixel by pixel,
that took twice as long as the reading.
"""

from typing import Literal

import torch
from kornia.geometry import create_meshgrid, normalize_pixel_coordinates
from kornia.geometry.transform import remap
from torch import Tensor, nn

from facesynth.face.texture.filling import EDGE, fill

Mode = Literal["bilinear", "bicubic"]


class PiecewiseAffineWarp(nn.Module):
    """Pictures whose mesh vertices lie at `source`, redrawn with those vertices at `target`."""

    triangles: Tensor
    """[F, 3] vertex numbers."""
    places: Tensor
    """[H, W, 2] where each pixel is, -1 … 1: what is outside the mesh is read from there."""

    def __init__(self, triangles: Tensor, height: int, width: int) -> None:
        super().__init__()
        self.height, self.width = height, width
        self.register_buffer("triangles", triangles.long())
        self.register_buffer("places", create_meshgrid(height, width)[0].contiguous(), persistent=False)

    def forward(self, pictures: Tensor, source: Tensor, target: Tensor) -> Tensor:
        """Pictures [N, channels, H, W] with vertices source [N, V, 2] moved to target [N, V, 2] px: [N, channels, H, W].

        Outside the target mesh the picture stays as it is.
        """
        return sample(pictures, self.interpolate(target, places_in(pictures, source), self.places))

    def interpolate(self, vertices: Tensor, values: Tensor, outside: Tensor | None = None) -> Tensor:
        """Values [N, V, D] at vertices [N, V, 2], linear in each triangle, at every pixel: [N, H, W, D].

        Outside the mesh they are `outside` [H, W, D], or 0. On a processor a compiled loop fills the triangles; on other
        devices, and where gradients are wanted, torch does.
        """
        if vertices.device.type != "cpu" or vertices.requires_grad or values.requires_grad:
            return self.interpolate_by_spans(vertices, values, outside)
        drawn = self._undrawn(values, outside)
        fill(vertices.numpy(), values.numpy(), self.triangles.numpy(), drawn.numpy())
        return drawn

    def _undrawn(self, values: Tensor, outside: Tensor | None) -> Tensor:
        """[N, H, W, D] what is seen where there is no mesh."""
        if outside is None:
            return values.new_zeros(len(values), self.height, self.width, values.shape[2])
        return outside.repeat(len(values), 1, 1, 1)

    def interpolate_by_spans(self, vertices: Tensor, values: Tensor, outside: Tensor | None = None) -> Tensor:
        """What `interpolate` gives, in operations of torch alone.

        Each triangle is cut into spans of pixels, row by row; a value is linear along a span, so that a pixel costs
        one multiplication and one addition and no search for its triangle.
        """
        corners = vertices.double()[:, self.triangles].flatten(0, 1)
        gradient, offset = _plane(corners, values.double()[:, self.triangles].flatten(0, 1))
        face, row, first, length = self._spans(corners)
        slope = gradient[:, :, 0].index_select(0, face)
        start = slope * first[:, None] + gradient[:, :, 1].index_select(0, face) * row[:, None] + offset.index_select(0, face)
        pixel = (face // len(self.triangles) * self.height + row) * self.width + first
        span = torch.repeat_interleave(length)
        along = torch.arange(len(span), device=span.device) - (length.cumsum(0) - length).index_select(0, span)
        line = torch.cat([start, slope], dim=1).to(values.dtype).index_select(0, span)
        width = values.shape[-1]
        drawn = torch.addcmul(line[:, :width], line[:, width:], along[:, None].to(values.dtype))
        out = self._undrawn(values, outside)
        out.view(-1, width).index_copy_(0, pixel.index_select(0, span) + along, drawn)
        return out

    def _spans(self, corners: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Of all triangles [F, 3, 2]: the spans' triangle, row, first column and length, each [S]."""
        top = corners[:, :, 1].amin(dim=1).sub(EDGE).ceil().clamp(min=0).long()
        bottom = corners[:, :, 1].amax(dim=1).add(EDGE).floor().clamp(max=self.height - 1).long()
        rows = (bottom - top + 1).clamp(min=0)
        face = torch.repeat_interleave(torch.arange(len(rows), device=rows.device), rows)
        row = top[face] + torch.arange(len(face), device=rows.device) - (rows.cumsum(0) - rows)[face]
        left, right = _crossings(corners[face], row.double())
        first = left.sub(EDGE).ceil().clamp(min=0).long()
        length = (right.add(EDGE).floor().clamp(max=self.width - 1).long() - first + 1).clamp(min=0)
        return face, row, first, length


def places_in(pictures: Tensor, points: Tensor) -> Tensor:
    """Points [..., 2] px in pictures [N, channels, H, W] as places, -1 … 1 from the first pixel's centre to the last one's."""
    return normalize_pixel_coordinates(points, *pictures.shape[-2:])


def sample(pictures: Tensor, places: Tensor, mode: Mode = "bilinear") -> Tensor:
    """Pictures [N, channels, H, W] read at places [N, h, w, 2], -1 … 1: [N, channels, h, w].

    Outside a picture its nearest border pixel counts. Bicubic reading keeps more of what is sharp, and may overshoot
    the range of the picture.
    """
    x, y = places.unbind(-1)
    return remap(pictures, x, y, mode=mode, padding_mode="border", align_corners=True, normalized_coordinates=True)


def _plane(corners: Tensor, values: Tensor) -> tuple[Tensor, Tensor]:
    """Gradient [F, D, 2] and offset [F, D] of the plane through values [F, 3, D] at corners [F, 3, 2].

    Triangles without area get a constant.
    """
    edges = corners[:, 1:] - corners[:, :1]
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    flat = area.abs() < 1e-12
    steps = (values[:, 1:] - values[:, :1]) / torch.where(flat, torch.inf, area)[:, None, None]
    x = steps[:, 0] * edges[:, 1, 1, None] - steps[:, 1] * edges[:, 0, 1, None]
    y = steps[:, 1] * edges[:, 0, 0, None] - steps[:, 0] * edges[:, 1, 0, None]
    return torch.stack([x, y], dim=2), values[:, 0] - x * corners[:, 0, 0, None] - y * corners[:, 0, 1, None]


def _crossings(corners: Tensor, row: Tensor) -> tuple[Tensor, Tensor]:
    """Leftmost and rightmost x [S] where triangles [S, 3, 2] meet the lines y = row [S].

    Each edge that reaches the line gives one crossing; a level edge gives its ends through its two neighbours.
    """
    other = corners.roll(-1, dims=1)
    rise = other[:, :, 1] - corners[:, :, 1]
    above = row[:, None] - corners[:, :, 1]
    reached = (above >= rise.clamp(max=0) - EDGE) & (above <= rise.clamp(min=0) + EDGE)
    share = (above / torch.where(rise == 0, 1.0, rise)).clamp(0, 1)
    x = corners[:, :, 0] + share * (other[:, :, 0] - corners[:, :, 0])
    return torch.where(reached, x, torch.inf).amin(dim=1), torch.where(reached, x, -torch.inf).amax(dim=1)
