"""Sound of whatever FFmpeg opens, at its time stamps.

Packets of sound carry times. Where a recorder lost some, or a stream was cut, they jump; strung together, all that comes after
would be early or late against the pictures. So each block is laid where its time says, and what is between is silence.

Sample 0 is where the first picture or the first sound lies, whichever is earlier: the same moment from which
`facesynth.capture.video` counts. Encoders put silence in front of the sound, their priming. MP4, Matroska and Ogg can say how
much, and FFmpeg takes it off; MPEG-TS and FLV begin the sound as much before the pictures; raw streams and AVI say nothing, nor
does an MP4 or Matroska without that entry. Of these it is taken off as far as any encoder puts it there, and told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from facesynth.inference.errors import FacesynthError
from facesynth.speech.interleaving import lost_sound
from facesynth.speech.one_channel import Floats, one_channel

if TYPE_CHECKING:
    from av.container import InputContainer

LOWEST_HZ = 1000
"""A rate below it is no rate of speech."""
JUMP_S = 0.008
"""Time stamps may be off by so much: they are rounded (to 1 ms in Matroska), and clocks of sound drift."""
AROUND = 9
"""Blocks over whose median a jump must last; a single stamp that is off moves nothing."""
TOLD_S = 0.02
"""Silence in front that is longer is told."""
LONGEST_SILENCE_S = 3600.0
"""Of all jumps together; what claims more has damaged time stamps."""
LARGEST_OVERLAP_S = 1.0
"""Time stamps that go back further begin another recording."""
PRIMED = {"aac": 1024, "mp3": 1105, "mp2": 481, "ac3": 256, "eac3": 256}
"""Samples that any encoder puts in front at least, as the transform asks; those of LAME and its decoder for MP3."""
LATEST = {"aac": 2112, "mp3": 1682}
"""Samples that some encoder puts in front."""
BESIDE_PICTURES = frozenset({"aac", "mp3"})
"""Codecs whose containers show by the pictures' time stamps whether they leave that in."""
LAYER, LAYER_2 = 0b110, 0b100
"""Bits of the second byte of MPEG audio, and what they are in MP2."""
SKIPPED = "skip_samples"
"""What FFmpeg notes on the first packet of a sound whose file says how much priming there is."""
LINKED = "ogg"
"""A format in which one recording may follow another, each with times of its own."""
COUNTING = "avi"
"""A format without time stamps."""
STAMP_S = 1e-3
LONGEST_PRIMING_S = 0.1
FIRST_PACKETS = 200
"""A stream whose first frame does not come within so many packets is damaged."""
ATTACHED_PICTURE = 0x400
"""FFmpeg's mark of a title picture, which is no video."""


@dataclass(frozen=True)
class Beginning:
    """When the streams of a file begin, on the container's clock."""

    sound_s: float | None
    """First sample that is decoded; None without sound."""
    picture_s: float | None
    """None without pictures."""
    priming: int
    """Samples in front of the sound that are the encoder's, as far as the container leaves them in."""
    rate: int
    codec: str
    counted: bool = False
    """Whether the container states no times, but counts samples and pictures."""
    later_s: float = 0.0
    """By how much the sound lies later than by its own count, on the count of the pictures."""
    linked: bool = False
    """Whether the container may hold one recording after the other."""
    sounds: int = 1
    """How many sounds the file holds."""

    @property
    def zero_s(self) -> float:
        """What counts as 0 s: the earlier of sound and pictures, priming taken off."""
        if self.sound_s is None or self.picture_s is None:
            return (self.sound_s or 0.0) + self.priming / max(self.rate, 1) if self.picture_s is None else self.picture_s
        if self.priming and 0 < self.picture_s - self.sound_s <= LONGEST_PRIMING_S:
            return self.picture_s
        return min(self.sound_s, self.picture_s)

    def _shows_priming(self) -> bool:
        """Whether the sound begins as much before the pictures as its encoder puts in front."""
        if self.sound_s is None or self.picture_s is None or self.counted:
            return False
        return abs(self.picture_s - self.sound_s - self.priming / self.rate) <= 2 * STAMP_S

    def remarks(self) -> Iterator[str]:
        """What a person should know of it."""
        if self.sound_s is None:
            return
        if self.sounds > 1:
            yield f"the file holds {self.sounds} sounds; the first of them is used"
        if self.priming and not self._shows_priming():
            taken_off = self.priming if self.picture_s is None or self.counted else 0
            yield from unstated_priming(self.codec, taken_off, self.rate)
        if self.sound_s - self.zero_s > TOLD_S:
            yield f"the sound begins {self.sound_s - self.zero_s:.2f} s after the pictures; until then it is silent"
        if self.sound_s < -TOLD_S and not self.counted:
            yield f"the sound's time stamps begin at {self.sound_s:.2f} s; its first sample counts as 0 s" + (
                "" if self.picture_s is None else f", the first picture as {self.picture_s - self.zero_s:.2f} s"
            )


def unstated_priming(codec: str, taken_off: int, rate: int) -> Iterator[str]:
    """What a person should know of a sound whose file does not say how much silence is in front of it."""
    said = f"the file does not say how much silence its {codec.upper()} encoder put in front of the sound"
    if codec not in LATEST:
        yield f"{said}: {taken_off} samples were taken off, as such encoders need"
        return
    late_ms = 1000 * (LATEST[codec] - taken_off) / rate
    done = f"{taken_off} samples were taken off, with some encoders it still" if taken_off else "with some it"
    yield f"{said}: {done} comes {late_ms:.0f} ms late"


def read_container(path: Path) -> tuple[Floats, int, tuple[str, ...]]:
    """Mono samples [S] of the first sound stream of anything that FFmpeg opens, their rate, and what was noticed."""
    import av

    try:
        begin = beginning(path)
        if begin.sound_s is None:
            raise FacesynthError(f"{path} has no sound in it; give a file with an audio track")
        decoded = _Decoded()
        strung = one_channel(partial(_blocks, path, decoded))
    except FacesynthError:
        raise
    except (av.FFmpegError, ValueError) as error:  # damaged titles are no Unicode, damaged streams no layout that is known
        reason = getattr(error, "strerror", "") or error
        raise FacesynthError(f"{path} cannot be read as sound or video ({reason}); is it damaged?") from None
    decoded.require_most_whole(path)
    if not decoded.lengths:
        return strung, begin.rate, ()
    times_s, lengths = np.array(decoded.times_s), decoded.lengths
    links: tuple[str, ...] = ()
    if begin.linked:
        times_s, links = one_after_the_other(times_s, lengths, begin.rate)
    lost = lost_sound(path, begin.later_s) if begin.counted else ()
    counted_s = _later(times_s, lost) + begin.later_s
    audio, remarks = laid(path, strung, lengths, counted_s - begin.zero_s, begin.rate)
    of_times = _said_of_lost(lost) if lost else remarks
    return audio, begin.rate, (*begin.remarks(), *links, *decoded.remarks(begin.zero_s), *of_times)


def one_after_the_other(
    times_s: NDArray[np.float64], lengths: Sequence[int], rate: int
) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Times [N] of blocks of several recordings in one file, each of which counts from its own 0, as if they were one."""
    ends_s = times_s + np.array(lengths) / rate
    back = np.flatnonzero(np.diff(times_s) < -LARGEST_OVERLAP_S) + 1
    whole = times_s.copy()
    for start in back:
        whole[start:] += whole[start - 1] + ends_s[start - 1] - times_s[start - 1] - whole[start]
    said = f"the file holds {len(back) + 1} recordings one after the other; they were strung together"
    return whole, (said,) if len(back) else ()


def _later(times_s: NDArray[np.float64], lost: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    """Times [N] of blocks of a sound that counts its samples alone, moved by what was lost before them."""
    return times_s + sum((length_s * (times_s > when_s - STAMP_S) for when_s, length_s in lost), np.zeros(len(times_s)))


def _said_of_lost(lost: Sequence[tuple[float, float]]) -> Iterator[str]:
    told = ", ".join(f"{length_s:.2f} s at {when_s:.2f} s" for when_s, length_s in lost)
    yield (
        f"AVI states no times, and some of the sound was lost: silence was put in, {told} of the sound,"
        " to about 20 ms, by the pictures that lie beside it"
    )


def beginning(path: Path) -> Beginning:
    """When sound and pictures of a file begin; av.FFmpegError where it is none that FFmpeg opens."""
    import av

    with av.open(str(path)) as container:
        picture, _ = _first_frame(container, video_streams(container))
    with av.open(str(path)) as container:
        if not container.streams.audio:
            return Beginning(None, _time_s(picture), 0, 0, "")
        stream = container.streams.audio[0]
        rate, codec = int(getattr(stream, "rate", 0) or 0), str(getattr(stream.codec_context, "name", ""))
        if rate < LOWEST_HZ:
            raise FacesynthError(f"{path} states a sound of {rate} Hz, or one of a kind that is not known; is it damaged?")
        codec = next((name for name in PRIMED if codec.startswith(name)), codec)
        codec = "mp2" if codec == "mp3" and _is_layer_2(path) else codec
        name, sounds = container.format.name, len(container.streams.audio)
        if name == COUNTING and picture is not None:
            return replace(_counted(container, PRIMED.get(codec, 0), rate, codec), sounds=sounds)
        sound, is_stated = _first_frame(container, [stream])
        known = not is_stated and (picture is None or codec in BESIDE_PICTURES)
        priming = PRIMED.get(codec, 0) if known else 0
        begins_s, seen_s = _time_s(sound) or 0.0, _time_s(picture)
        return Beginning(begins_s, seen_s, priming, rate, codec, name == COUNTING, linked=name == LINKED, sounds=sounds)


def video_streams(container: InputContainer) -> list[Any]:
    """The streams of moving pictures: a title picture is none."""
    return [stream for stream in container.streams.video if not stream.disposition.value & ATTACHED_PICTURE]


# AVI counts: sound and pictures both begin at 0, so that the sound is late by its priming. Writers that know of it (FFmpeg) leave
# as many places empty, in whole pictures, before the first picture or behind it: where as many are there, all that follow belong
# to the sound after the priming, to the sample.
def _counted(container: InputContainer, priming: int, rate: int, codec: str) -> Beginning:
    """When sound and pictures of an AVI begin, on the count of its pictures."""
    stream = video_streams(container)[0]
    places = islice((packet.dts for packet in container.demux(stream) if packet.size and packet.dts is not None), 2)
    first, second = (*places, 0, 0)[:2]
    unit_s, late_s = float(stream.time_base or 0), priming / rate
    empty = second - 1
    held_back = empty > 0 and abs(empty * unit_s - late_s) < unit_s
    seen_s = unit_s * (empty if held_back else first)
    sound_s = seen_s - late_s if held_back else -late_s
    return Beginning(sound_s, seen_s, priming, rate, codec, counted=True, later_s=sound_s)


def _is_layer_2(path: Path) -> bool:
    """Whether the first packet's header names layer II: MPEG-TS calls the sound of all layers alike, its decoder takes all."""
    import av

    with av.open(str(path)) as container:
        head = next((bytes(packet)[:2] for packet in container.demux(audio=0) if packet.size), b"")
    return len(head) == 2 and head[0] == 0xFF and head[1] & LAYER == LAYER_2


def _first_frame(container: InputContainer, streams: Sequence[Any]) -> tuple[Any, bool]:
    """The first frame of a stream, or None where none can be decoded; and whether the file says how much priming it has."""
    import av

    is_stated = False
    for number, packet in enumerate(container.demux(streams[0]) if streams else ()):
        is_stated = is_stated or packet.has_sidedata(SKIPPED)
        with suppress(av.FFmpegError, ValueError):
            for frame in packet.decode():
                return frame, is_stated
        if number > FIRST_PACKETS:
            break
    return None, is_stated


def _time_s(frame: Any) -> float | None:
    return None if frame is None or frame.pts is None else float(frame.pts * frame.time_base)


@dataclass
class _Decoded:
    """What came of the packets of a sound."""

    times_s: list[float] = field(default_factory=list)
    """When each block begins, NaN where it has no time."""
    lengths: list[int] = field(default_factory=list)
    """Samples of each block."""
    damaged_s: list[float] = field(default_factory=list)
    """Times of the packets that cannot be decoded."""
    packets: int = 0

    def require_most_whole(self, path: Path) -> None:
        """FacesynthError where most of the sound is damaged."""
        if 2 * len(self.damaged_s) > self.packets or (self.damaged_s and not self.lengths):
            raise FacesynthError(
                f"{path} cannot be read as sound or video ({len(self.damaged_s)} of {self.packets} packets of its sound are"
                " damaged); copy it again"
            )

    def remarks(self, zero_s: float) -> Iterator[str]:
        """What a person should know of it."""
        if self.damaged_s:
            yield (
                f"{len(self.damaged_s)} of {self.packets} packets of the sound are damaged, the first at"
                f" {self.damaged_s[0] - zero_s:.2f} s; they are silent"
            )


def _blocks(path: Path, found: _Decoded) -> Iterator[Floats]:
    """The decoded sound in blocks [n, channels], as many in all as the first has; `found` becomes what came of it."""
    import av

    found.times_s, found.lengths, found.damaged_s, found.packets = [], [], [], 0
    with av.open(str(path)) as container:
        rate, kind, layout, resampler = int(container.streams.audio[0].rate), None, None, None
        for frame in _frames(container, found):
            if (frame.format.name, frame.layout.name, frame.sample_rate) != kind:  # it may change within a broadcast
                yield from _resampled(resampler, None, found)
                kind, layout = (frame.format.name, frame.layout.name, frame.sample_rate), layout or frame.layout
                resampler = av.AudioResampler(format="flt", layout=layout, rate=rate)  # PyAV reads 8 separate planes at most
            yield from _resampled(resampler, frame, found)
        yield from _resampled(resampler, None, found)


def _resampled(resampler: Any, frame: Any, found: _Decoded) -> Iterator[Floats]:
    for block in resampler.resample(frame) if resampler is not None else ():
        time_s = _time_s(block)
        found.times_s.append(np.nan if time_s is None else time_s)
        found.lengths.append(block.samples)
        yield block.to_ndarray().reshape(block.samples, -1).astype(np.float32)


def _frames(container: InputContainer, found: _Decoded) -> Iterator[Any]:
    """The frames of the first sound; packets that are damaged are noted and passed over."""
    import av

    for packet in container.demux(audio=0):
        found.packets += bool(packet.size)
        try:
            yield from packet.decode()
        except av.InvalidDataError:
            if packet.size:
                found.damaged_s.append(np.nan if packet.pts is None else float(packet.pts * packet.time_base))


def laid(
    path: Path, sound: Floats, lengths: Sequence[int], times_s: NDArray[np.float64], rate: int
) -> tuple[Floats, tuple[str, ...]]:
    """Blocks of sound where their times say [S], silence between them; and what was noticed.

    sound: the blocks strung together, lengths: [N] their samples; times_s: [N] when each begins, NaN where the file does not
    say: right after the one before. What lies before 0 is left out. Where blocks overlap, the later one is kept.
    """
    strung = np.concatenate([[0], np.cumsum(lengths)])
    moved = _moved(times_s * rate - strung[:-1], rate)
    jumps = np.diff(moved, prepend=moved[0])
    if np.abs(jumps).sum() + max(moved[0], 0) > LONGEST_SILENCE_S * rate:
        raise FacesynthError(f"{path}: the time stamps of its sound jump by hours; export it again")
    places = strung[:-1] + moved
    if jumps.min() < -LARGEST_OVERLAP_S * rate:
        place_s, back_s = strung[jumps.argmin()] / rate, -jumps.min() / rate
        raise FacesynthError(
            f"{path}: at {place_s:.2f} s of its sound the time stamps go back by {back_s:.2f} s, as where two recordings were"
            " strung together; cut it there"
        )
    if not moved.any():
        return sound, ()
    audio = np.zeros(max(int((places + np.diff(strung)).max()), 0), np.float32)
    for place, first, stop in zip(places, strung[:-1], strung[1:], strict=True):
        kept = sound[min(first + max(-place, 0), stop) : stop]
        audio[max(place, 0) : max(place, 0) + len(kept)] = kept
    return audio, tuple(_said(jumps, places / rate, rate))


def _said(jumps: NDArray[np.int64], places_s: NDArray[np.float64], rate: int) -> Iterator[str]:
    told = ((jumps > 0, "gaps", "by its time stamps; they are silent"), (jumps < 0, "overlaps", "where the later part is kept"))
    for jumped, what, done in told:
        if jumped.any():
            first_s = float((places_s - np.maximum(jumps, 0) / rate)[jumped][0])
            long_s = float(np.abs(jumps[jumped]).sum()) / rate
            count = np.count_nonzero(jumped)
            yield f"{what} in the sound: {count}, {long_s:.2f} s in all, the first at {first_s:.2f} s, {done}"


# Where each block would lie if all were strung together is subtracted from where its time stamp puts it. What remains is constant
# but for jumps and for the rounding of the stamps. A running median keeps jumps where they are and drops single stamps that are
# off; between two jumps the median of the stretch is what the blocks are moved by.
def _moved(apart: NDArray[np.float64], rate: int) -> NDArray[np.int64]:
    """[N] samples by which each block is moved from where it would lie if all were strung together."""
    known = np.isfinite(apart)
    if not known.any():
        return np.zeros(len(apart), np.int64)
    last = np.maximum.accumulate(np.where(known, np.arange(len(apart)), -1))
    apart = np.where(last >= 0, apart[last], apart[known][0])
    smooth = median_filter(apart, size=AROUND, mode="nearest")
    moved, start = np.zeros(len(apart), np.int64), 0
    for stop in range(1, len(apart) + 1):
        if stop == len(apart) or abs(smooth[stop] - smooth[start]) > JUMP_S * rate:
            moved[start:stop] = _whole(float(np.median(apart[start:stop])), rate)
            start = stop
    return moved


def _whole(samples: float, rate: int) -> int:
    """Nothing where it is no more than the rounding of time stamps."""
    return 0 if abs(samples) <= JUMP_S / 4 * rate else round(samples)
