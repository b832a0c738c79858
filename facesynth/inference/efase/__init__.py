"""eFASE: the cheapest path through recorded motion nodes, and the motion that it makes."""

from ..efase.model import Efase

__all__ = ["Efase"]
