"""Hair, eyebrows and lashes: strands grown once on the face at rest and carried by its surface afterwards."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import Delaunay, cKDTree

from facesynth.face.draw.albedo import brow_shade, hairline_mm, noise
from facesynth.face.rig.brows import BROW_LENGTH_MM, BROW_START_MM, over_brow_mm, step

Points = NDArray[np.float64]

_HAIR_COLOUR = np.array([0.060, 0.036, 0.022])
_BROW_COLOUR = np.array([0.038, 0.024, 0.016])
_LASH_COLOUR = np.array([0.020, 0.014, 0.012])


@dataclass(frozen=True, eq=False)
class Strands:
    """P points of strands, bound to N fine vertices, and the M segments between them.

    A point lies at `binding @ vertices + lift_mm * (binding @ normals)`.
    """

    binding: sparse.csr_matrix
    """[P, N]; each row adds up to 1."""
    lift_mm: NDArray[np.float32]
    """[P] height over the surface."""
    segments: NDArray[np.int32]
    """[M, 2] points, root first."""
    width_mm: NDArray[np.float32]
    """[P]"""
    colour: NDArray[np.float32]
    """[P, 3] linear albedo, dimmed where other hair hides the light."""
    horizon: NDArray[np.float32]
    """[P] cosine past the horizon up to which a strand on a turning surface still shows."""
    raised_mm: NDArray[np.float32]
    """[P] how much nearer a point counts than it lies: lashes must not sink into the lid they grow from."""


@dataclass(frozen=True, eq=False)
class Tufts:
    """S strands of the same number K of points."""

    points: Points
    """[S, K, 3] root first, mm, in the rest pose."""
    width_mm: NDArray[np.float64]
    """[S, K]"""
    colour: Points
    """[S, K, 3]"""


@dataclass(frozen=True, eq=False)
class Skin:
    """The skin at rest, as ground for strands: quads [F, 4] over N fine vertices, of which only some are skin."""

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    quads: NDArray[np.int32]

    @cached_property
    def _vertices(self) -> tuple[NDArray[np.int32], cKDTree]:
        used = np.unique(self.quads)
        return used, cKDTree(self.points[used])

    def kept_outside(self, points: Points, height_mm: NDArray[np.float64]) -> Points:
        """Points moved along the nearest normal to at least half of, at most twice, a height over the skin."""
        used, tree = self._vertices
        near = used[tree.query(points)[1]]
        normal = self.normals[near].astype(np.float64)
        height = ((points - self.points[near]) * normal).sum(axis=1)
        return points + normal * (np.clip(height, 0.5 * height_mm, 2.0 * height_mm) - height)[:, None]

    def sample(self, density: Callable[[Points], NDArray], count: int, rng: np.random.Generator) -> tuple[Points, Points]:
        """About `count` places [S, 3] and normals spread by area times density (0..1)."""
        corners = self.points[self.quads].astype(np.float64)
        area = np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1) / 2
        weight = area * density(corners.mean(axis=1))
        quad = rng.choice(len(area), count, p=weight / weight.sum())
        s, t = rng.random((2, count, 1))
        blend = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
        place = (corners[quad] * blend).sum(axis=1)
        keep = rng.random(count) < np.minimum(1, density(place) / np.maximum(density(corners.mean(axis=1))[quad], 1e-3))
        normal = (self.normals[self.quads[quad]] * blend).sum(axis=1)
        return place[keep], _unit(normal[keep])


def grow_all(skin: Skin, lashes: dict[str, tuple[NDArray[np.int64], Points]], seed: int = 5) -> Strands:
    """Hair, brows and lashes of the built-in head.

    Parameters
    ----------
    skin : the fine skin at rest
    lashes : for each lid the vertex indices of its lash card, and the centre of the eye [3]
    """
    rng = np.random.default_rng(seed)
    parts = [_on_skin(skin, tufts) for tufts in (_scalp_hair(skin, rng), _brow_hair(skin, rng))]
    for name, (index, centre) in lashes.items():
        card, normals = skin.points[index].astype(np.float64), skin.normals[index].astype(np.float64)
        parts.append(_lash_row(name, index, card, normals, centre, len(skin.points), rng))
    offsets = np.cumsum([0] + [len(part.lift_mm) for part in parts[:-1]])
    return Strands(
        sparse.vstack([part.binding for part in parts]).tocsr().astype(np.float32),
        np.concatenate([part.lift_mm for part in parts]),
        np.concatenate([part.segments + offset for part, offset in zip(parts, offsets, strict=True)]).astype(np.int32),
        np.concatenate([part.width_mm for part in parts]),
        np.concatenate([part.colour for part in parts]),
        np.concatenate([part.horizon for part in parts]),
        np.concatenate([part.raised_mm for part in parts]),
    )


def _scalp_hair(skin: Skin, rng: np.random.Generator, count: int = 15000, steps: int = 6) -> Tufts:
    """Short at the sides, longer on top and brushed from a parting towards the performer's right."""
    root, normal = skin.sample(lambda p: step(-0.5, 8.0, hairline_mm(p) + 9 * (noise(p * 0.35) - 0.5)), count, rng)
    length = _hair_length(root) * rng.uniform(0.72, 1.15, len(root))
    points = [root]
    heading = _unit(0.55 * normal + 0.9 * _hair_flow(root) + 0.16 * rng.normal(size=root.shape))
    for k in range(1, steps):
        done = k / (steps - 1)
        flow = _hair_flow(points[-1])
        heading = _unit(heading + (0.35 + 0.25 * done) * flow + [0, -0.10 * done, 0] + 0.10 * rng.normal(size=root.shape))
        moved = points[-1] + heading * (length / (steps - 1))[:, None]
        points.append(skin.kept_outside(moved, 0.6 + hair_volume_mm(root) * np.sin(np.pi * min(done + 0.15, 1.0)) ** 0.7))
    strands = _clumped(np.stack(points, axis=1), root, rng)
    along = np.linspace(0, 1, steps)
    deep = step(0.0, 14.0, hairline_mm(root))[:, None]  # at the hairline roots are fine, and nothing shades them
    width = 0.46 * (1 - 0.75 * along**2) * (1 - 0.55 * (1 - deep) * (1 - along)) * rng.uniform(0.7, 1.2, (len(root), 1))
    tint = rng.uniform(0.6, 1.5, (len(root), 1)) * (0.8 + 0.5 * noise(root * 0.4))[:, None]
    shadow = 1 - 0.70 * (0.25 + 0.75 * deep) * (1 - along**0.8)
    colour = _HAIR_COLOUR * (tint * shadow)[..., None] * (1 + 0.35 * along[:, None] * [1.0, 0.85, 0.6])
    return Tufts(strands, width, colour)


def _hair_length(root: Points) -> NDArray[np.float64]:
    x, y, z = root.T
    on_top = step(45, 92, y - 0.15 * np.abs(x))
    fringe = step(70, 110, z) * on_top
    return 9 + 10 * step(-30, 50, y) + 20 * on_top + 10 * fringe


def hair_volume_mm(root: Points) -> NDArray[np.float64]:
    """[S] how high hair stands over the skin, mm."""
    x, y, z = root.T
    full = 1.4 + 3.0 * step(0, 75, y) + 7.0 * step(60, 100, y) * step(-20, 90, z) * step(75, 20, np.abs(x + 8))
    return full * (0.65 + 0.7 * noise(root * 0.09 + 17))


def _hair_flow(place: Points) -> Points:
    """[S, 3] direction in which hair is brushed."""
    x, y, z = place.T
    right_of_parting = step(34, 22, x)
    top = np.stack([-0.95 * right_of_parting + 0.7 * (1 - right_of_parting), -0.1 + 0 * x, 0.30 - 0.55 * step(85, 112, z)], -1)
    side = np.stack([0.12 * np.sign(x), -0.95 + 0 * x, -0.45 + 0 * x], -1)
    back = np.stack([-0.15 * np.sign(x), -1 + 0 * x, 0 * x], -1)
    is_side = step(70, 40, y) * step(45, 62, np.abs(x))
    is_back = step(0, -45, z)
    front = np.stack([-0.75 * right_of_parting + 0.5 * (1 - right_of_parting), 0.5 + 0 * x, -0.45 + 0 * x], -1)
    top = top + (front - top) * (step(72, 104, z) * step(40, 22, np.abs(x + 12)))[:, None]
    blend = top + (side - top) * is_side[:, None]
    return _unit(blend + (back - blend) * is_back[:, None])


def _clumped(strands: Points, root: Points, rng: np.random.Generator) -> Points:
    """Draw each strand's tip towards the strand in the middle of its lock."""
    leaders = rng.choice(len(root), max(1, len(root) // 22), replace=False)
    mine = leaders[cKDTree(root[leaders]).query(root + 0.8 * rng.normal(size=root.shape))[1]]
    along = np.linspace(0, 1, strands.shape[1])[None, :, None]
    pull = 0.75 * along**1.3 * rng.uniform(0.3, 1.0, (len(root), 1, 1))
    return strands + pull * ((strands[mine] + 0.45 * (root - root[mine])[:, None]) - strands)


def _brow_hair(skin: Skin, rng: np.random.Generator, count: int = 1900, steps: int = 4) -> Tufts:
    """Hairs 5-8 mm long: upright by the nose, lying outwards along the arch."""
    root, normal = skin.sample(lambda p: brow_shade(p) ** 1.2, count, rng)
    along_brow = np.clip((np.abs(root[:, 0]) - BROW_START_MM) / BROW_LENGTH_MM, 0, 1)
    outward = np.sign(root[:, 0])
    lean = np.stack(
        [outward * (0.25 + 1.0 * step(0.0, 0.35, along_brow)), 1.0 - 1.75 * step(0.05, 0.75, along_brow), -0.2 + 0 * outward], -1
    )
    middle = np.sign(over_brow_mm(root))  # upper hairs lean down, lower ones up
    lean[:, 1] -= 0.30 * middle * step(0.15, 0.5, along_brow)
    heading = _unit(_unit(lean) + 0.18 * normal + 0.10 * rng.normal(size=root.shape))
    length = rng.uniform(4.0, 7.5, len(root)) * (1 - 0.35 * along_brow)
    points = [root]
    for k in range(1, steps):
        moved = points[-1] + heading * (length / (steps - 1))[:, None]
        points.append(skin.kept_outside(moved, np.full(len(root), 0.35 + 0.25 * k)))
    along = np.linspace(0, 1, steps)
    width = np.broadcast_to(0.28 * (1 - 0.8 * along), (len(root), steps)) * rng.uniform(0.7, 1.2, (len(root), 1))
    colour = _BROW_COLOUR * np.broadcast_to(rng.uniform(0.6, 1.4, (len(root), 1)), (len(root), steps))[..., None]
    return Tufts(np.stack(points, axis=1), width, colour)


def _on_skin(skin: Skin, tufts: Tufts) -> Strands:
    """Bind each point to the triangle of skin nearest to it: barycentric weights and a height along the normal."""
    points = tufts.points.reshape(-1, 3)
    triangles = np.concatenate([skin.quads[:, [0, 1, 2]], skin.quads[:, [0, 2, 3]]]).astype(np.int64)
    corners = skin.points[triangles].astype(np.float64)
    nearest = cKDTree(corners.mean(axis=1)).query(points)[1]
    a, b, c = np.moveaxis(corners[nearest], 1, 0)
    weights = _barycentric(points, a, b, c)
    foot = (weights[:, :, None] * corners[nearest]).sum(axis=1)
    normal = _unit((weights[:, :, None] * skin.normals[triangles[nearest]]).sum(axis=1))
    rows = np.repeat(np.arange(len(points)), 3)
    binding = sparse.csr_matrix((weights.ravel(), (rows, triangles[nearest].ravel())), (len(points), len(skin.points)))
    return _strands(binding, ((points - foot) * normal).sum(axis=1), tufts, 0.35, 0.0)


def _barycentric(p: Points, a: Points, b: Points, c: Points) -> Points:
    """[P, 3] weights of the feet of points p on the planes of triangles, kept within a third outside of them."""
    u, v, w = b - a, c - a, p - a
    uu, uv, vv = (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)
    wu, wv = (w * u).sum(1), (w * v).sum(1)
    scale = 1 / np.maximum(uu * vv - uv * uv, 1e-9)
    wb, wc = np.clip((vv * wu - uv * wv) * scale, -0.33, 1.33), np.clip((uu * wv - uv * wu) * scale, -0.33, 1.33)
    return np.stack([1 - wb - wc, wb, wc], axis=1)


def _lash_row(
    name: str,
    index: NDArray[np.int64],
    card: Points,
    normals: Points,
    centre: Points,
    vertex_count: int,
    rng: np.random.Generator,
) -> Strands:
    """Single lashes on a lash card, in its coordinates: angle around the eye, and distance from the eyeball.

    Each runs from the card's inner edge on and beyond its outer one, and curls away from the eye opening.
    """
    steps, upper = 6, "upper" in name
    out = card - centre
    angle, reach = out[:, 0] / np.maximum(out[:, 2] - 4, 1) * 15, np.linalg.norm(out, axis=1)
    low, high = _edge(angle, reach, np.min), _edge(angle, reach, np.max)
    count = 150 if upper else 70
    at = np.linspace(angle.min() + 0.8, angle.max() - 0.8, count) + rng.uniform(-0.07, 0.07, count)
    at_tip = np.clip(at * 1.06 + rng.normal(0, 0.5, count), angle.min() + 0.4, angle.max() - 0.4)
    flat = np.stack([angle, reach], axis=1)
    root = _interpolation(flat, np.stack([at, low(at) + 0.15], axis=1), index, vertex_count)
    tip = _interpolation(flat, np.stack([at_tip, high(at_tip) - 0.15], axis=1), index, vertex_count)
    along = np.tile(np.linspace(0, 1, steps), count)
    length = np.repeat(rng.uniform(0.8, 1.35, count) * (1.0 if upper else 0.65), steps)
    each = np.repeat(np.arange(count), steps)
    binding = sparse.diags(1 - along * length) @ root[each] + sparse.diags(along * length) @ tip[each]
    upward = np.sign(normals[:, 1].mean()) * (1 if upper else -1)
    lift = upward * (2.4 if upper else 0.8) * length * along**1.8
    width = np.broadcast_to((0.30 if upper else 0.17) * (1 - 0.85 * np.linspace(0, 1, steps) ** 1.5), (count, steps))
    colour = np.broadcast_to(_LASH_COLOUR, (count, steps, 3))
    return _strands(binding, lift, Tufts(np.zeros((count, steps, 3)), width, colour), 2.0, 2.5)


def _edge(angle: NDArray, reach: NDArray, extreme: Callable[[NDArray], float]) -> Callable[[NDArray], NDArray]:
    """The inner or outer edge of a lash card: a smooth curve through the extremes of nine sectors."""
    bounds = np.quantile(angle, np.linspace(0, 1, 10))
    sector = np.clip(np.searchsorted(bounds, angle, side="right") - 1, 0, 8)
    middles = np.array([angle[sector == k].mean() for k in range(9)])
    values = np.array([extreme(reach[sector == k]) for k in range(9)])
    return np.polynomial.Polynomial.fit(middles, values, 3)


def _interpolation(known: Points, wanted: Points, index: NDArray[np.int64], vertex_count: int) -> sparse.csr_matrix:
    """[P, N] weights that interpolate linearly among known places in the plane; outside, the nearest vertex."""
    net = Delaunay(known)
    simplex = net.find_simplex(wanted)
    nearest = cKDTree(known).query(wanted)[1]
    partial = np.einsum("pij,pj->pi", net.transform[simplex, :2], wanted - net.transform[simplex, 2])
    weights = np.concatenate([partial, 1 - partial.sum(axis=1, keepdims=True)], axis=1)
    corners = net.simplices[simplex].copy()
    outside = (simplex < 0) | ~np.isfinite(weights).all(axis=1)
    weights[outside], corners[outside] = [1, 0, 0], nearest[outside, None]
    rows = np.repeat(np.arange(len(wanted)), 3)
    return sparse.csr_matrix((weights.ravel(), (rows, index[corners].ravel())), (len(wanted), vertex_count))


def _strands(binding: sparse.csr_matrix, lift_mm: NDArray, tufts: Tufts, horizon: float, raised_mm: float) -> Strands:
    count, steps = tufts.width_mm.shape
    first = (np.arange(count)[:, None] * steps + np.arange(steps - 1)).ravel()
    return Strands(
        binding,
        lift_mm.astype(np.float32),
        np.stack([first, first + 1], axis=1).astype(np.int32),
        tufts.width_mm.ravel().astype(np.float32),
        np.ascontiguousarray(tufts.colour.reshape(-1, 3), np.float32),
        np.full(count * steps, horizon, np.float32),
        np.full(count * steps, raised_mm, np.float32),
    )


def _unit(vectors: Points) -> Points:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
