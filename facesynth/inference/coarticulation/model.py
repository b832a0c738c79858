"""Phones in, motion out, from key shapes and polynomials; the sound is not heard."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..closures import close_at, closing_frames
from ..errors import FacesynthError, reject_options
from ..filters import gaussian
from ..folder import Folder
from ..graphs import Graph
from ..layout import Layout
from ..lips import bilabial_spans, has_lips
from ..long_arrays import by_blocks
from ..motion import Motion
from ..phones import BILABIALS, LABIODENTALS, PHONE_INDEX, PHONES, VISEMES, viseme_of
from ..speech import PhoneTrack, Speech
from .blending import KeyShapes, WeightModels, blend_key_shapes

SMOOTHING_S = 0.02
"""Standard deviation of the smoothing over the joints of models, which need not meet."""
CLASS_OF = np.array(VISEMES, np.int64)
"""[N] viseme class of each of PHONES."""
KEY_FIELDS = tuple(field.name for field in fields(KeyShapes))
MODEL_FIELDS = tuple(field.name for field in fields(WeightModels))


@dataclass(frozen=True, eq=False)
class Parts:
    """What a trained model consists of."""

    layout: Layout
    fps: float
    """Hz."""
    emotions: tuple[str, ...]
    keys: KeyShapes
    models: WeightModels
    closed_gap: float
    """How near the performer's lips come at p, b and m, in the layout's unit; infinite where that is not known."""
    decode: Callable[[NDArray[np.float32]], NDArray[np.float32]]
    """Displacements [T, D] to frames [T, C]."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that the model came from, if it came from one."""


class Coarticulation:
    """Key shapes of phones, blended by learned functions of time (Deng 2006, §5.2), trained or made by hand."""

    def __init__(self, parts: Parts) -> None:
        self.parts, self.manifest = parts, parts.manifest
        self.layout, self.fps, self.emotions = parts.layout, parts.fps, parts.emotions

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion from phones alone: emotions are not felt, nothing is random.

        Key shapes of the phones, blended (`blend_key_shapes`), smoothed over joints of models, decoded; then lips close at
        p, b and m as near as in the recordings (`close_at`). Where curves have no points of lips, the key shapes of these
        phones are reached (`hold_keys`).
        """
        reject_options("coarticulation", options, ("seed",))
        phones = speech.phones.told("coarticulation")
        numbers = np.array([PHONE_INDEX[label] for label in phones.labels])
        classes = CLASS_OF[numbers]
        keys = self.parts.keys.of(numbers, classes, phones.ends_s - phones.starts_s)
        times_s = np.arange(max(1, int(phones.frame_bounds(self.fps)[-1]))) / self.fps
        shapes = gaussian(blend_key_shapes(phones, classes, keys, self.parts.models, times_s), SMOOTHING_S * self.fps)
        if not has_lips(self.layout):
            shapes = hold_keys(shapes, keys, phones, self.fps)
        frames = by_blocks(self._decoded, shapes.astype(np.float32), np.float64)
        frames = close_at(frames, self.layout, bilabial_spans(phones, self.fps), self.parts.closed_gap, self.fps)
        return Motion(by_blocks(np.asarray, frames), self.fps, self.layout)

    def _decoded(self, shapes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Displacements [t, D] to frames [t, C]."""
        frames = self.parts.decode(shapes)
        return np.clip(frames, 0, 1) if self.layout.kind == "curves" else frames


def hold_keys(shapes: Floats, keys: Floats, phones: PhoneTrack, fps: float) -> Floats:
    """Shapes [T, D] that reach the key shape [P, D] of each p, b, m, f and v at its middle, as short as it may be.

    They are drawn to it by a cosine that fades as `close_at` does.
    """
    out, bounds = shapes.copy(), phones.frame_bounds(fps).tolist()
    for label, key, start, stop in zip(phones.labels, keys, bounds[:-1], bounds[1:], strict=True):
        if label in BILABIALS | LABIODENTALS and stop > start:
            middle, reach = (start + stop - 1) / 2, closing_frames(start, stop, fps)
            near = np.arange(max(0, int(np.ceil(middle - reach))), min(len(out), int(middle + reach) + 1))
            held = 0.5 + 0.5 * np.cos(np.pi * np.clip((near - np.round(middle)) / reach, -1, 1))
            out[near] += held[:, None] * (key - out[near])
    return out


def load_coarticulation(folder: Folder, threads: int) -> Coarticulation:
    """The model in a folder that `coarticulation_content` filled."""
    return coarticulation_of(folder, folder.arrays(), folder.settings["closed_gap"], threads)


def coarticulation_of(folder: Folder, arrays: Mapping[str, NDArray[Any]], gap: float | None, threads: int) -> Coarticulation:
    """The same of arrays by the names of `KeyShapes` and `WeightModels`, with the folder's graph `decode`."""
    manifest = folder.manifest
    if manifest["phones"] != [[phone, viseme_of(phone)] for phone in PHONES]:
        raise FacesynthError(f"{folder.path} knows other phones than this runtime; export the model again")
    decode = Graph(folder, "decode", threads)
    return Coarticulation(
        Parts(
            layout=folder.layout,
            fps=float(manifest["fps"]),
            emotions=tuple(manifest["emotions"]),
            keys=KeyShapes(**{name: as_doubles(arrays[name]) for name in KEY_FIELDS}),
            models=weight_models({name: arrays[name] for name in MODEL_FIELDS}),
            closed_gap=np.inf if gap is None else float(gap),
            decode=lambda shapes: decode(coordinates=shapes[None])[0][0],
            manifest=manifest,
        )
    )


def weight_models(arrays: Mapping[str, NDArray[Any]]) -> WeightModels:
    """From stored arrays."""
    keys: Ints = arrays["triphone_keys"].astype(np.int64)
    return WeightModels(as_doubles(arrays["diphones"]), keys, as_doubles(arrays["triphones"]))


def as_doubles(array: NDArray[Any]) -> Floats:
    """An array as it is computed with."""
    return array.astype(np.float64)
