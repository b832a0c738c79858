"""Rotations as unit quaternions [..., 4] (w, x, y, z), and curves through them."""

import numpy as np

from .arrays import Floats

TINY = 1e-12


def from_rotvec(rotvec: Floats) -> Floats:
    """Rotation vectors [..., 3] (rad) to quaternions."""
    return exponential(np.asarray(rotvec, np.float64) / 2)


def to_rotvec(quaternion: Floats) -> Floats:
    """Quaternions to rotation vectors [..., 3] (rad) of at most half a turn."""
    return 2 * logarithm(np.where(quaternion[..., :1] < 0, -quaternion, quaternion))


def from_angles(angles: Floats) -> Floats:
    """Pitch, yaw and roll [..., 3] (rad) to quaternions: roll about z first, then pitch about x, then yaw about y."""
    x, y, z = (exponential(angles[..., k, None] / 2 * np.eye(3)[k]) for k in range(3))
    return multiply(multiply(y, x), z)


def to_angles(quaternion: Floats) -> Floats:
    """The inverse of `from_angles`: pitch within a quarter turn, yaw and roll within half a turn."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    pitch = np.arcsin(np.clip(2 * (w * x - y * z), -1, 1))
    yaw = np.arctan2(2 * (w * y + x * z), 1 - 2 * (x * x + y * y))
    roll = np.arctan2(2 * (w * z + x * y), 1 - 2 * (x * x + z * z))
    return np.stack([pitch, yaw, roll], axis=-1)


def exponential(half: Floats) -> Floats:
    """Unit quaternion [..., 4] of a pure one given by its vector [..., 3]."""
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1)


def logarithm(quaternion: Floats) -> Floats:
    """[..., 3] the inverse of `exponential`."""
    vector = quaternion[..., 1:]
    size = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = np.arctan2(size, quaternion[..., :1])
    return np.where(size > TINY, angle / np.maximum(size, TINY), 1.0) * vector


def multiply(a: Floats, b: Floats) -> Floats:
    """Hamilton's product: first b, then a."""
    aw, av, bw, bv = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    real = aw * bw - (av * bv).sum(axis=-1, keepdims=True)
    return np.concatenate([real, aw * bv + bw * av + np.cross(av, bv)], axis=-1)


def inverse(quaternion: Floats) -> Floats:
    """Of a unit quaternion."""
    return quaternion * (1.0, -1.0, -1.0, -1.0)


def one_hemisphere(quaternions: Floats) -> Floats:
    """[n, 4] with signs such that neighbours are near each other; q and -q are the same rotation."""
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=-1) < 0, -1.0, 1.0)
    return quaternions * np.cumprod(np.concatenate([[1.0], signs]))[:, None]


def slerp(a: Floats, b: Floats, share: Floats) -> Floats:
    """The shortest arc from a (share 0) to b (share 1), at constant speed."""
    cosine = (a * b).sum(axis=-1, keepdims=True)
    b, angle = np.where(cosine < 0, -b, b), np.arccos(np.clip(np.abs(cosine), 0, 1))
    share = np.asarray(share)[..., None]
    near = angle < 1e-6
    sine = np.where(near, 1.0, np.sin(angle))
    weight_a = np.where(near, 1 - share, np.sin((1 - share) * angle) / sine)
    weight_b = np.where(near, share, np.sin(share * angle) / sine)
    blend = weight_a * a + weight_b * b
    return np.asarray(blend / np.linalg.norm(blend, axis=-1, keepdims=True))


# Shoemake 1985: between q_i and q_i+1 squad runs slerp(slerp(q_i, q_i+1, u), slerp(s_i, s_i+1, u), 2u(1 - u)) with the inner
# points s_i = q_i exp(-(log(q_i^-1 q_i+1) + log(q_i^-1 q_i-1)) / 4). It passes through the key points and has no corner there.
def squad(keys: Floats, at: Floats) -> Floats:
    """Spherical cubic interpolation of n key rotations [n, 4] at places [T] in 0..n-1."""
    keys = one_hemisphere(keys)
    if len(keys) == 1:
        return np.repeat(keys, len(at), axis=0)
    onward, back = np.concatenate([keys[1:], keys[-1:]]), np.concatenate([keys[:1], keys[:-1]])
    undone = inverse(keys)
    bend = logarithm(multiply(undone, onward)) + logarithm(multiply(undone, back))
    bend[[0, -1]] = 0.0
    inner = multiply(keys, exponential(-bend / 4))
    low = np.clip(at.astype(np.int64), 0, len(keys) - 2)
    u = at - low
    return slerp(slerp(keys[low], keys[low + 1], u), slerp(inner[low], inner[low + 1], u), 2 * u * (1 - u))
