"""A folder of graphs without a method: audio features, or what moves a face."""

from .folder import Folder, stated_by_manifest
from .graphs import Graph


class Parts:
    """`parts["rasta_plp"](audio=sound)` runs one of the graphs."""

    def __init__(self, folder: Folder, threads: int) -> None:
        self.manifest, self._folder, self._threads = folder.manifest, folder, threads
        self._loaded: dict[str, Graph] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Of the graphs."""
        return tuple(self.manifest["graphs"])

    def __getitem__(self, name: str) -> Graph:
        """A graph, loaded when it is first asked for."""
        if name not in self._loaded:
            with stated_by_manifest(self._folder.path):
                self._loaded[name] = Graph(self._folder, name, self._threads)
        return self._loaded[name]
