"""Animation files that other programs read: Live Link Face, glTF, npz, BVH."""

from facesynth.face.files.write import SUFFIXES, write_animation

__all__ = ["SUFFIXES", "write_animation"]
