"""ONNX graphs whose inputs are checked against the manifest."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError, reject_options
from .folder import Folder

Part = Callable[..., list[NDArray[Any]]]
"""A graph of a folder, or anything else that is called with named arrays and gives its outputs in order."""


def session_of(graph: bytes, threads: int) -> Any:
    """An onnxruntime session of a graph, on so many threads; onnxruntime's own errors for what it does not run."""
    import onnxruntime  # here: models of torch run without it

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads, options.log_severity_level = threads, 1, 3
    # Waiting threads sleep: the processor is seldom ours alone.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])


class Graph:
    """One graph of a folder, called with named arrays: `graph(features=u, state=x)` gives its outputs in order."""

    def __init__(self, folder: Folder, name: str, threads: int) -> None:
        if name not in folder.manifest["graphs"]:
            raise FacesynthError(f"{folder.path}: the manifest lists no graph {name!r}; export the model again")
        entry = folder.manifest["graphs"][name]
        self.name, self.inputs = name, entry["inputs"]
        self.outputs = [port["name"] for port in entry["outputs"]]
        content = folder.bytes_of(entry["file"])
        try:
            self._session = session_of(content, threads)
        except Exception as error:  # onnxruntime raises classes of its own, which share no base but Exception
            raise FacesynthError(f"{folder.path / entry['file']} is no graph that onnxruntime runs ({error})") from None
        held = sorted(port.name for port in self._session.get_inputs())
        given = sorted(port.name for port in self._session.get_outputs())
        if held != sorted(port["name"] for port in self.inputs) or given != sorted(self.outputs):
            raise FacesynthError(
                f"{folder.path / entry['file']} takes {held} and gives {given}, which is not what the manifest states"
            )

    def __call__(self, **arrays: NDArray[Any]) -> list[NDArray[Any]]:
        """Run it; FacesynthError where an input is missing or has another type or shape than the manifest states."""
        names = [port["name"] for port in self.inputs]
        reject_options(f"the graph {self.name}", arrays.keys() - set(names), names)
        sizes: dict[str, int] = {}
        for port in self.inputs:
            array = arrays.get(port["name"])
            shape, wanted = None if array is None else array.shape, port["shape"]
            fits = shape is not None and len(shape) == len(wanted)
            if fits and shape is not None:
                fits = all(
                    n == w if isinstance(w, int) else sizes.setdefault(w, n) == n for n, w in zip(shape, wanted, strict=True)
                )
            if array is None or not fits or str(array.dtype) != port["dtype"]:
                got = "nothing" if array is None else f"{array.dtype} {list(array.shape)}"
                raise FacesynthError(f"{self.name}: input {port['name']} is {got}; wanted {port['dtype']} {wanted}")
        results: list[NDArray[Any]] = self._session.run(
            self.outputs, {name: np.ascontiguousarray(a) for name, a in arrays.items()}
        )
        return results
