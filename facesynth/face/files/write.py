"""One call for every animation file; the suffix says which."""

from __future__ import annotations

from pathlib import Path

from facesynth.errors import unknown
from facesynth.face.animation import FaceAnimation
from facesynth.face.rig import Rig
from facesynth.motion.motion import Motion

SUFFIXES: tuple[str, ...] = (".csv", ".glb", ".npz", ".bvh")


def write_animation(path: str | Path, animation: FaceAnimation, rig: Rig, motion: Motion | None = None) -> None:
    """Write `animation` as `.csv` (Live Link Face), `.glb`, `.npz` (with `motion` beside it) or `.bvh` (the head).

    The same animation gives the same bytes. A file appears whole or not at all.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        from facesynth.face.files.livelink import take_of, write_livelink

        write_livelink(path, take_of(animation))
    elif suffix == ".glb":
        from facesynth.face.files.gltf import write_glb

        write_glb(path, animation, rig)
    elif suffix == ".npz":
        from facesynth.face.files.npz import write_npz

        write_npz(path, animation, motion)
    elif suffix == ".bvh":
        from facesynth.face.files.bvh import write_bvh

        write_bvh(path, animation)
    else:
        raise unknown("animation file type", suffix or str(path), SUFFIXES)
