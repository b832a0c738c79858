"""Talking, feeling faces driven by speech, learned from recordings of one performer."""

from facesynth.inference.version import __version__

__all__ = ["__version__"]
