"""The version of facesynth, and of the runtime that is built from this folder."""

__version__ = "0.2.0"
