"""The anime graph: recorded phones found by sound, joined by example, mapped between emotions."""

from ..anime_graph.model import AnimeGraph

__all__ = ["AnimeGraph"]
