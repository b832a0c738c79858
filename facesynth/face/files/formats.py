"""One call for every animation file; the suffix says which."""

from collections.abc import Callable, Mapping
from pathlib import Path

from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.own_head import OwnHead
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.motion import Motion
from facesynth.motion.arkit_names import ARKIT_NAMES

Head = Rig | OwnHead
Writer = Callable[[Path, FaceAnimation, Head, Motion | None], None]


def write_animation(path: str | Path, animation: FaceAnimation, head: Head, motion: Motion | None = None) -> None:
    """Write an animation of the channels of `head` in one of `SUFFIXES`; `motion` is what it was made from.

    `.csv` is a Live Link Face take of the built-in head, and the channels by name of any other, or of curves none of
    which is ARKit's; `.glb` the head with its shapes; `.npz` all arrays, with the motion beside them; `.bvh` the head's
    movement. The same animation gives the same bytes. A file appears whole or not at all.
    """
    WRITERS[require_suffix(path)](Path(path), animation, head, motion)


def require_suffix(path: str | Path) -> str:
    """The suffix in lower case; FacesynthError where no animation is written so."""
    suffix = Path(path).suffix.lower()
    if suffix not in WRITERS:
        raise unknown("animation file type", suffix or str(path), SUFFIXES)
    return suffix


def require_arkit(animation: FaceAnimation, path: str | Path) -> None:
    """FacesynthError where the built-in head cannot show the curves of an animation."""
    if not _is_arkit(animation):
        raise FacesynthError(
            f"{path} shows the built-in head, but the curves {', '.join(animation.names[:3])} … are not ARKit's; give a mapping"
            " file (--mapping), or write .csv or .npz"
        )


def _is_arkit(animation: FaceAnimation) -> bool:
    return bool(set(animation.names) & set(ARKIT_NAMES))


def _csv(path: Path, animation: FaceAnimation, head: Head, motion: Motion | None) -> None:
    from facesynth.face.files.curves import write_curves
    from facesynth.face.files.livelink import write_as_livelink
    from facesynth.motion.resample import resample

    if not isinstance(head, OwnHead) and _is_arkit(animation):
        write_as_livelink(path, animation, motion)
    elif isinstance(head, OwnHead) or motion is None or motion.layout.names != animation.names:
        write_curves(path, animation.names, animation.weights, animation.fps)
    else:  # in whatever range the method made them
        shown = motion if motion.fps == animation.fps else resample(motion, animation.fps)
        write_curves(path, animation.names, shown.frames, animation.fps)


def _glb(path: Path, animation: FaceAnimation, head: Head, _motion: Motion | None) -> None:
    from facesynth.face.files.gltf.write import write_glb

    if not isinstance(head, OwnHead):
        require_arkit(animation, path)
    write_glb(path, animation, head)


def _npz(path: Path, animation: FaceAnimation, _head: Head, motion: Motion | None) -> None:
    from facesynth.face.files.npz import write_npz

    write_npz(path, animation, motion)


def _bvh(path: Path, animation: FaceAnimation, _head: Head, _motion: Motion | None) -> None:
    from facesynth.face.files.bvh import write_bvh

    write_bvh(path, animation)


WRITERS: Mapping[str, Writer] = {".csv": _csv, ".glb": _glb, ".npz": _npz, ".bvh": _bvh}
SUFFIXES: tuple[str, ...] = tuple(WRITERS)
