"""One call for every animation file; the suffix says which."""

from __future__ import annotations

from pathlib import Path

from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.arkit import ARKIT_NAMES
from facesynth.face.rig.arkit_rig import Rig
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.motion import Motion

SUFFIXES: tuple[str, ...] = (".csv", ".glb", ".npz", ".bvh")


def write_animation(path: str | Path, animation: FaceAnimation, rig: Rig, motion: Motion | None = None) -> None:
    """Write `animation` as `.csv` (Live Link Face), `.glb`, `.npz` (with `motion` beside it) or `.bvh` (the head).

    Curves none of which has an ARKit name are written under their own, as `.csv` or `.npz`. The same animation gives
    the same bytes. A file appears whole or not at all.
    """
    suffix = Path(path).suffix.lower()
    if not set(animation.names) & set(ARKIT_NAMES) and suffix in (".csv", ".glb"):
        _write_plain(path, animation, motion)
    elif suffix == ".csv":
        from facesynth.face.files.livelink import take_of, write_livelink

        write_livelink(path, take_of(animation, motion))
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


def require_arkit(animation: FaceAnimation, path: str | Path) -> None:
    """FacesynthError where the built-in head cannot show the curves of an animation."""
    if not set(animation.names) & set(ARKIT_NAMES):
        raise FacesynthError(
            f"{path} shows the built-in head, but the curves {', '.join(animation.names[:3])} … are not ARKit's; give a mapping"
            " file (--mapping), or write .csv or .npz"
        )


def _write_plain(path: str | Path, animation: FaceAnimation, motion: Motion | None) -> None:
    """Curves by their own names, in whatever range the method made them."""
    from facesynth.face.files.curves import write_curves
    from facesynth.motion.resample import resample

    if Path(path).suffix.lower() != ".csv":
        require_arkit(animation, path)
    if motion is None or motion.layout.names != animation.names:
        write_curves(path, animation.names, animation.weights, animation.fps)
    else:
        shown = motion if motion.fps == animation.fps else resample(motion, animation.fps)
        write_curves(path, animation.names, shown.frames, animation.fps)
