"""Catmull-Clark subdivision as one sparse matrix, so that refining a posed mesh is one product."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from facesynth.inference.errors import FacesynthError


def catmull_clark(vertex_count: int, quads: ArrayLike) -> tuple[sparse.csr_matrix, NDArray[np.int32]]:
    """One level of subdivision of a quad mesh with borders (Catmull and Clark 1978).

    Parameters
    ----------
    vertex_count : V
    quads : [Q, 4]; a triangle may repeat its last corner

    Returns
    -------
    matrix : [V + E + Q, V], float32; each row adds up to 1. Old vertices come first, then edges, then faces
    fine : [4 Q, 4]; fine quad 4 q + k lies at corner k of quad q: corner, next edge, face centre, previous edge
    """
    faces = np.asarray(quads, np.int64)
    if faces.ndim != 2 or faces.shape[1] != 4:
        raise FacesynthError(f"subdivision needs quads [Q, 4]; got {faces.shape}")
    face_count = len(faces)
    edges, edge_of_corner, sharing = _edges(faces)
    face_points = _average(np.arange(face_count), faces, 0.25, (face_count, vertex_count))
    edge_points = _edge_points(face_points, edges, edge_of_corner, sharing, vertex_count)
    vertex_points = _vertex_points(face_points, faces, edges, sharing, vertex_count)
    matrix = sparse.vstack([vertex_points, edge_points, face_points]).tocsr().astype(np.float32)
    matrix.sort_indices()
    centre = vertex_count + len(edges) + np.repeat(np.arange(face_count)[:, None], 4, axis=1)
    after = vertex_count + edge_of_corner
    fine = np.stack([faces, after, centre, np.roll(after, 1, axis=1)], axis=-1)
    return matrix, fine.reshape(-1, 4).astype(np.int32)


def refine_corners(corners: NDArray[Any]) -> NDArray[Any]:
    """Values per corner [Q, 4, D] (such as texture coordinates) carried to the fine quads [4 Q, 4, D] by bisection."""
    following = np.roll(corners, -1, axis=1)
    middle = (corners + following) / 2
    centre = np.repeat(corners.mean(axis=1, keepdims=True), 4, axis=1)
    return np.stack([corners, middle, centre, np.roll(middle, 1, axis=1)], axis=2).reshape(-1, 4, corners.shape[2])


def _edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Edges [E, 2], the edge from each corner to the next [Q, 4], and how many faces share each edge [E]."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, inverse, sharing = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    return edges, inverse.reshape(faces.shape), sharing


def _average(rows: NDArray[np.int64], columns: NDArray[np.int64], weight: float, shape: tuple[int, int]) -> sparse.csr_matrix:
    rows = np.broadcast_to(rows[:, None], columns.shape)
    return sparse.csr_matrix((np.full(columns.size, weight), (rows.ravel(), columns.ravel())), shape)


def _edge_points(
    face_points: sparse.csr_matrix,
    edges: NDArray[np.int64],
    edge_of_corner: NDArray[np.int64],
    sharing: NDArray[np.int64],
    vertex_count: int,
) -> sparse.csr_matrix:
    """Inside: the mean of both ends and both face points; on a border: the middle of the edge."""
    middle = _average(np.arange(len(edges)), edges, 0.5, (len(edges), vertex_count))
    touching = _average(np.arange(len(edge_of_corner)), edge_of_corner, 1.0, (len(edge_of_corner), len(edges))).T
    inside = sharing == 2
    return sparse.diags(np.where(inside, 0.5, 1.0)) @ middle + sparse.diags(np.where(inside, 0.25, 0.0)) @ touching @ face_points


def _vertex_points(
    face_points: sparse.csr_matrix,
    faces: NDArray[np.int64],
    edges: NDArray[np.int64],
    sharing: NDArray[np.int64],
    vertex_count: int,
) -> sparse.csr_matrix:
    """Inside, with valence n: `(F + 2 R + (n - 3) P) / n`; on a border: `P / 2 + (sum of border edges' middles) / 4`.

    F is the mean of the face points around, R the mean of the middles of the edges around.
    """
    at_face = _average(np.arange(len(faces)), faces, 1.0, (len(faces), vertex_count)).T
    at_edge = _average(np.arange(len(edges)), edges, 1.0, (len(edges), vertex_count)).T
    middle = _average(np.arange(len(edges)), edges, 0.5, (len(edges), vertex_count))
    border_edge = sparse.diags((sharing != 2).astype(float))
    valence = np.asarray(at_edge.sum(axis=1)).ravel()
    around = np.maximum(np.asarray(at_face.sum(axis=1)).ravel(), 1)
    on_border = np.asarray((at_edge @ border_edge).sum(axis=1)).ravel() > 0
    per_valence = 1 / np.maximum(valence, 1)
    inner = (
        sparse.diags(per_valence / around) @ at_face @ face_points
        + sparse.diags(2 * per_valence**2) @ at_edge @ middle
        + sparse.diags((valence - 3) * per_valence)
    )
    border = 0.5 * sparse.identity(vertex_count) + 0.25 * at_edge @ border_edge @ middle
    is_inner = ~on_border & (valence > 0)
    return (
        sparse.diags(is_inner.astype(float)) @ inner
        + sparse.diags(on_border.astype(float)) @ border
        + sparse.diags((valence == 0).astype(float))
    )
