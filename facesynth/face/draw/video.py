"""Video files with sound: H.264 and AAC in MP4, through PyAV."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.atomic import atomic_path
from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import all_finite, let_go
from facesynth.inference.sound import resample

if TYPE_CHECKING:
    import av.container

_FILE = {"movflags": "+faststart", "fflags": "+bitexact"}
"""What plays comes first; no version and no time of writing in it."""
_H264 = {"crf": "18", "preset": "veryfast", "threads": "1", "x264-params": "cpu-independent=1"}
"""Several threads of x264 give other pictures now and then (1 of 30 files on a loaded machine, and their number is the
machine's); one gives the same bytes for a fifth less processor time, and is faster than anything that draws."""
_SOUND_BLOCK = 1024  # samples: one AAC frame
_SOUND_RATE = 48000  # Hz
_NTSC = (24, 30, 48, 60, 120)


def exact_rate(fps: float | Fraction) -> Fraction:
    """A frame rate as the fraction that is meant: 23.976 is 24000/1001, 29.97 is 30000/1001."""
    rate = Fraction(fps)
    if not 1 <= rate <= 1000:
        raise FacesynthError(f"a video needs 1 to 1000 frames per second; got {float(rate):g}")
    for whole in _NTSC:
        if rate != whole and abs(rate - Fraction(whole * 1000, 1001)) < Fraction(1, 200):
            return Fraction(whole * 1000, 1001)
    return rate.limit_denominator(1001)


def frame_count(duration_s: float, fps: float | Fraction) -> int:
    """Frames of a video of this duration: `round(duration * fps)`, at least one."""
    return max(1, round(duration_s * float(exact_rate(fps))))


def write_video(
    path: str | Path,
    frames: Iterable[NDArray[np.uint8]],
    fps: float | Fraction,
    audio: ArrayLike | None = None,
    sample_rate: int = 16000,
) -> int:
    """Write frames [height, width, 3] as they come, with mono sound [S] in -1..1; returns how many there were.

    The same pictures and sound give the same bytes. The file appears when it is complete, never before. Memory does not
    grow with the number of frames. The sound is written whole, at 48 kHz: give `frame_count(len(audio) / sample_rate, fps)`
    frames for picture and sound to end together.
    """
    import av

    rate = exact_rate(fps)
    sound = None if audio is None else _sound_at_file_rate(audio, sample_rate)
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise FacesynthError("a video needs at least one frame; got none")
    height, width = _checked_frame(first, None).shape[:2]
    if height % 2 or width % 2:
        raise FacesynthError(f"H.264 video needs even width and height; got {width} x {height}")
    with atomic_path(path) as part, av.open(str(part), "w", format="mp4", options=_FILE) as container:
        video = container.add_stream("libx264", rate=rate, options=_H264)
        video.width, video.height, video.pix_fmt = width, height, "yuv420p"
        video.time_base = 1 / rate
        voice = _Voice(container, sound) if sound is not None else None
        count = 0
        for picture in itertools.chain([first], pictures):
            image = av.VideoFrame.from_ndarray(_checked_frame(picture, (height, width)), format="rgb24")
            image.pts, image.time_base = count, 1 / rate
            container.mux(video.encode(image))
            count += 1
            if voice:
                voice.write_until(count / rate)
        container.mux(video.encode(None))
        if voice:
            voice.finish()
    return count


class _Voice:
    """The sound of a file being written, in step with its pictures so that a player need not seek."""

    def __init__(self, container: av.container.OutputContainer, samples: NDArray[np.float32]) -> None:
        self.container, self.samples, self.done = container, samples, 0
        self.stream: Any = container.add_stream("aac", rate=_SOUND_RATE, options={"b": "128k", "flags": "+bitexact"})
        self.stream.layout = "mono"

    def write_until(self, time_s: Fraction) -> None:
        while self.done < min(len(self.samples), int(time_s * _SOUND_RATE)):
            self._block()

    def finish(self) -> None:
        while self.done < len(self.samples):
            self._block()
        self.container.mux(self.stream.encode(None))

    def _block(self) -> None:
        import av

        block = np.clip(self.samples[None, self.done : self.done + _SOUND_BLOCK], -1, 1)
        frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(block), format="fltp", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = _SOUND_RATE, self.done, Fraction(1, _SOUND_RATE)
        self.container.mux(self.stream.encode(frame))
        self.done += block.shape[1]
        let_go(self.samples)


@dataclass(frozen=True, eq=False)
class Video:
    """What `read_video` found."""

    frames: NDArray[np.uint8]
    """[T, height, width, 3]"""
    fps: Fraction
    audio: NDArray[np.float32]
    """[S] mono, empty where there is none."""
    sample_rate: int
    """Hz; 0 without sound."""


def read_video(path: str | Path) -> Video:
    """Read a whole (short) video into memory."""
    import av

    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise FacesynthError(f"{path} holds no video")
            fps = Fraction(container.streams.video[0].average_rate or 0)
            frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        with av.open(str(path)) as container:
            rate, blocks = 0, [np.zeros(0, np.float32)]
            if container.streams.audio:
                rate = container.streams.audio[0].rate
                blocks = list(_mono(container, rate))
    except (av.FFmpegError, OSError) as error:
        raise FacesynthError(f"{path} cannot be read as a video ({error})") from None
    return Video(np.stack(frames), fps, np.concatenate(blocks), rate)


def _mono(container: av.container.InputContainer, rate: int) -> Iterator[NDArray[np.float32]]:
    import av

    mixer = av.AudioResampler("fltp", "mono", rate)
    for frame in itertools.chain(container.decode(audio=0), [None]):
        for block in mixer.resample(frame):
            yield block.to_ndarray()[0]


def _sound_at_file_rate(audio: ArrayLike, sample_rate: int) -> NDArray[np.float32]:
    """[S] at 48 kHz: every player takes it, and the last block of AAC then adds less than a frame of silence."""
    sound = np.asarray(audio, np.float32)
    if sound.ndim != 1 or not len(sound) or not all_finite(sound):
        raise FacesynthError(f"the sound must be finite mono samples [S], S > 0; got shape {sound.shape}")
    if not 1000 <= sample_rate <= 384000:
        raise FacesynthError(f"the sound's rate must be 1000 to 384000 Hz; got {sample_rate}")
    if sample_rate != _SOUND_RATE:
        wanted = round(len(sound) * Fraction(_SOUND_RATE, int(sample_rate)))
        sound = resample(sound, int(sample_rate), _SOUND_RATE)[:wanted]
    return sound


def _checked_frame(frame: NDArray[np.uint8], size: tuple[int, int] | None) -> NDArray[np.uint8]:
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3 or size not in (None, frame.shape[:2]):
        raise FacesynthError(f"video frames must be uint8 [height, width, 3], all of one size; got {frame.dtype} {frame.shape}")
    return np.ascontiguousarray(frame)
