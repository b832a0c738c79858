"""What OpenFace writes of a head that turns while its mouth opens, at 30 pictures a second."""

import numpy as np
from scipy.spatial.transform import Rotation

COUNT = 120


def changed(path, change, sign=",", encoding="utf-8"):
    """An OpenFace table again after change(names, rows) gave other names and rows of text."""
    names, *rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    names, rows = change(names, rows)
    path.write_bytes(("\n".join(sign.join(row) for row in [names, *rows]) + "\n").encode(encoding))


def without(*gone):
    """A change that leaves columns out."""

    def change(names, rows):
        kept = [k for k, name in enumerate(names) if name.strip() not in gone]
        return [names[k] for k in kept], [[row[k] for k in kept] for row in rows]

    return change


def openface(path, faces=1, flat=False):
    """A head that turns, with a face whose mouth opens; returns the face [T, 68, 3] in our axes and the head [T, 6]."""
    rng = np.random.default_rng(0)
    rest = rng.normal(0, 40, (68, 3))
    face = rest + np.sin(np.arange(COUNT) / 9)[:, None, None] * rng.normal(0, 2, (68, 3))
    turn = Rotation.from_euler("XYZ", np.stack([0.1 * np.sin(np.arange(COUNT) / 20 + k) for k in range(3)], axis=1))
    shift = np.array([10.0, -20.0, 600.0]) + rng.normal(0, 1, (COUNT, 3))
    camera = np.einsum("tij,tkj->tki", turn.as_matrix(), face * [1, -1, -1]) + shift[:, None]
    names = ["frame", " face_id", " timestamp", " confidence", " success", " gaze_angle_x", " gaze_angle_y"]
    names += [f" pose_{what}{axis}" for what in "TR" for axis in "xyz"]
    names += [f" {axis}_{k}" for axis in ("xy" if flat else "XYZ") for k in range(68)] + [" AU45_r"]
    rows = [",".join(names)]
    for t in range(COUNT):
        for who in range(faces):
            success = int(not 30 <= t < 40) if who == 0 else int(t < 20)
            cells = [t + 1, who, t / 30, 0.9, success, 0.1, 0.2, *shift[t], *turn[t].as_euler("XYZ")]
            rows.append(",".join(f"{v:.6f}" for v in [*cells, *camera[t, :, : 2 if flat else 3].T.ravel(), 1.0]))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return face
