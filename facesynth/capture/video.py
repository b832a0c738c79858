"""Pictures of a video file, upright, each with its time on the clock of the file's sound."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from facesynth.capture.square import Image
from facesynth.inference.errors import FacesynthError

if TYPE_CHECKING:
    from av.container import InputContainer

LARGEST_PX = 8192
"""Longest side of a picture; what claims to be larger is damaged."""
RATES = (5.0, 500.0)
"""Frames per second that a camera may have."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """The pictures of a video."""

    fps: float
    """Mean rate, Hz."""
    images: Iterator[tuple[float, Image]]
    """Time since the sound began (s; since the first picture where there is no sound) and picture."""
    damaged: list[float]
    """Times of the pictures read so far that the file holds damaged, so that parts of them are made up."""


@contextmanager
def open_video(path: Path) -> Iterator[Pictures]:
    """The pictures of a file, to be read while it is open; FacesynthError for what is no video, or a damaged one."""
    import av

    if not path.is_file() or path.stat().st_size == 0:
        raise FacesynthError(f"{path} is empty or does not exist; copy it from the camera again")
    try:
        with av.open(str(path)) as container:
            stream = _stream(container, path)
            damaged: list[float] = []
            yield Pictures(_rate(stream, path), _decoded(container, stream, path, damaged), damaged)
    except FacesynthError:
        raise
    except (av.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", "") or error
        raise FacesynthError(f"{path} cannot be read as video ({reason}); is it damaged?") from None


def _stream(container: InputContainer, path: Path) -> Any:
    if not container.streams.video:
        raise FacesynthError(f"{path} has no pictures in it; give a video, or a motion file beside the sound")
    stream = container.streams.video[0]
    width, height = (getattr(stream.codec_context, side, 0) for side in ("width", "height"))
    if not 0 < max(width, height) <= LARGEST_PX:
        raise FacesynthError(f"{path} has pictures of {width} × {height} in a form that is not known; is it damaged?")
    stream.thread_type = "NONE"
    return stream


def _rate(stream: Any, path: Path) -> float:
    rate = stream.average_rate or stream.guessed_rate or stream.base_rate
    if rate is None or not RATES[0] <= float(rate) <= RATES[1]:
        raise FacesynthError(f"{path} states {rate or 'no'} pictures a second; wanted {RATES[0]:g} to {RATES[1]:g}")
    return float(rate)


def _decoded(container: InputContainer, stream: Any, path: Path, damaged: list[float]) -> Iterator[tuple[float, Image]]:
    begin_s = _sound_start_s(container)
    number = 0
    for frame in container.decode(stream):
        if frame.pts is None:
            continue
        time_s = float(frame.pts * frame.time_base)
        begin_s = time_s if begin_s is None else begin_s
        if frame.is_corrupt:
            damaged.append(time_s - begin_s)
        yield time_s - begin_s, _upright(frame)
        number += 1
    if not number:
        raise FacesynthError(f"{path} holds no picture that can be read; is it damaged?")


def _sound_start_s(container: InputContainer) -> float | None:
    for stream in container.streams.audio:
        if stream.time_base is not None:
            return float((stream.start_time or 0) * stream.time_base)
    return None


def _upright(frame: Any) -> Image:
    """The picture as a player shows it: a telephone that was held upright only notes how it was held."""
    quarters = round(getattr(frame, "rotation", 0) / 90) % 4
    return np.ascontiguousarray(np.rot90(frame.to_ndarray(format="rgb24"), quarters))
