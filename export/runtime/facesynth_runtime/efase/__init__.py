"""eFASE: the cheapest path through recorded motion nodes, and the motion that it makes."""

from facesynth_runtime.efase.model import Efase

__all__ = ["Efase"]
