"""Pictures of a video file, upright, each with its time on the clock of the file's sound."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice, pairwise
from math import inf
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from facesynth.capture.square import Image
from facesynth.inference.errors import FacesynthError
from facesynth.speech.containers import COUNTING, beginning, video_streams

if TYPE_CHECKING:
    from av.container import InputContainer

LARGEST_PX = 8192
"""Longest side of a picture; what claims to be larger is damaged."""
RATES = (5.0, 500.0)
"""Frames per second that a camera may have."""
FIRST_PICTURES = 300
"""So many tell the rate where none is stated."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """The pictures of a video."""

    fps: float
    """Mean rate, Hz."""
    images: Iterator[tuple[float, Image]]
    """Time on the clock of the sound that `facesynth.speech.audio` reads of the file (s), and picture."""
    damaged: list[float]
    """Times of the pictures read so far that the file holds damaged, so that parts of them are made up."""


@contextmanager
def open_video(path: Path) -> Iterator[Pictures]:
    """The pictures of a file, to be read while it is open; FacesynthError for what is no video, or a damaged one."""
    import av

    if not path.is_file() or path.stat().st_size == 0:
        raise FacesynthError(f"{path} is empty or does not exist; copy it from the camera again")
    try:
        zero_s = beginning(path).zero_s
        with av.open(str(path)) as container:
            stream = _stream(container, path)
            damaged: list[float] = []
            yield Pictures(_rate(stream, path), _decoded(container, stream, path, zero_s, damaged), damaged)
    except FacesynthError:
        raise
    except (av.FFmpegError, ValueError) as error:
        reason = getattr(error, "strerror", "") or error
        raise FacesynthError(f"{path} cannot be read as video ({reason}); is it damaged?") from None


def _stream(container: InputContainer, path: Path) -> Any:
    streams = video_streams(container)
    if not streams:
        raise FacesynthError(f"{path} has no pictures in it; give a video, or a motion file beside the sound")
    stream = streams[0]
    width, height = (getattr(stream.codec_context, side, 0) for side in ("width", "height"))
    if not 0 < max(width, height) <= LARGEST_PX:
        raise FacesynthError(f"{path} has pictures of {width} × {height} in a form that is not known; is it damaged?")
    stream.thread_type = "NONE"
    return stream


def _rate(stream: Any, path: Path) -> float:
    """Pictures a second: as stated, else, where the rate varies and a clock's is stated, as most of the first pictures come."""
    stated = [float(rate) for rate in (stream.average_rate, stream.guessed_rate, stream.base_rate) if rate]
    likely = next((rate for rate in stated if RATES[0] <= rate <= RATES[1]), None) or _typical_rate(path)
    if likely is None:
        raise FacesynthError(
            f"{path} states {stated[0] if stated else 'no'} pictures a second; wanted {RATES[0]:g} to {RATES[1]:g}"
        )
    return likely


def _typical_rate(path: Path) -> float | None:
    """1 over the median step between the first pictures' times; None where it is none that a camera has."""
    import av

    with av.open(str(path)) as container:
        stream = video_streams(container)[0]
        packets = islice(container.demux(stream), FIRST_PICTURES)
        times = sorted(float(packet.pts * packet.time_base) for packet in packets if packet.pts is not None)
    steps = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    rate = 1 / median(steps) if steps else 0.0
    return rate if RATES[0] <= rate <= RATES[1] else None


def _decoded(
    container: InputContainer, stream: Any, path: Path, begin_s: float, damaged: list[float]
) -> Iterator[tuple[float, Image]]:
    number, last_s = 0, -inf
    slots = _slots_s(path) if _reordered_without_times(container, stream) else None
    for frame in container.decode(stream):
        if frame.pts is None:
            continue
        time_s = (float(frame.pts * frame.time_base) if slots is None else next(slots, last_s)) - begin_s
        time_s = time_s if number else max(time_s, 0.0)
        if frame.is_corrupt or time_s <= last_s:
            damaged.append(time_s)
        if time_s <= last_s:
            continue
        yield time_s, _upright(frame)
        number, last_s = number + 1, time_s
    if not number:
        raise FacesynthError(f"{path} holds no picture that can be read; is it damaged?")


# Pictures that are predicted from later ones lie in a file in another order than they are shown in. AVI has no time stamps for
# the latter: the first that is shown belongs to the first place in the file, and so on.
def _reordered_without_times(container: InputContainer, stream: Any) -> bool:
    return container.format.name == COUNTING and bool(stream.codec_context.has_b_frames)


def _slots_s(path: Path) -> Iterator[float]:
    """The times of the places in which the file holds a picture, in order."""
    import av

    with av.open(str(path)) as container:
        stream = video_streams(container)[0]
        unit_s = float(stream.time_base or 0)
        return iter(sorted(packet.dts * unit_s for packet in container.demux(stream) if packet.size and packet.dts is not None))


def _upright(frame: Any) -> Image:
    """The picture as a player shows it: a telephone that was held upright only notes how it was held."""
    quarters = round(getattr(frame, "rotation", 0) / 90) % 4
    return np.ascontiguousarray(np.rot90(frame.to_ndarray(format="rgb24"), quarters))
