"""A synthetic talker in any container: lips that close with clicks in the sound."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from facesynth.capture.track import at_regular_times
from facesynth.capture.video import open_video
from facesynth.motion.irregular import steady_rate
from facesynth.speech.audio import read_sound

RATE = 48000
SIZE = 64
CLOSING_S = 0.06
"""The lips come together and part again about so quickly."""
CONTAINERS = {
    "mp4": ("libx264", "aac"),
    "mov": ("libx264", "aac"),
    "mkv": ("libx264", "aac"),
    "webm": ("libvpx", "libopus"),
    "avi": ("mpeg4", "libmp3lame"),
    "ts": ("libx264", "aac"),
    "flv": ("libx264", "aac"),
}
"""Codecs of pictures and sound that each container usually holds."""


def at_30_fps(duration_s):
    """Times of pictures, s."""
    return tuple(np.arange(round(30 * duration_s)) / 30)


@dataclass(frozen=True)
class Clip:
    """What is played."""

    closures_s: tuple[float, ...] = (0.25, 0.7, 1.1, 1.55)
    duration_s: float = 2.0
    pictures_s: tuple[float, ...] = at_30_fps(2.0)
    """When pictures are taken."""
    moved: tuple[tuple[float, float], ...] = ()
    """(from, by) s: packets of sound from one time on carry later stamps. Clicks are laid so that they sound at the closures."""
    fps: float = 30.0
    """Rate of an AVI, Hz, which counts pictures; others note when each is taken."""
    overlapping: int = 0
    """So many packets of sound, from 1 s on, come after half a packet's time each."""


def opening(clip, times_s):
    """How far the lips are apart, 0 to 1."""
    shut = [np.exp(-0.5 * ((np.asarray(times_s) - closure) / CLOSING_S) ** 2) for closure in clip.closures_s]
    return 1 - np.clip(np.sum(shut, axis=0), 0, 1)


def picture(opened):
    """[H, W, 3] a face whose mouth is as high as the lips are apart."""
    image = np.full((SIZE, SIZE, 3), 200, np.uint8)
    level = np.clip(opened * 30 - np.arange(30), 0, 1)[:, None, None]
    image[25:55, 20:44] = np.round(200 - 170 * level).astype(np.uint8)
    return image


def sound(clip):
    """[S] a click at each closure, in the sound as it is before its packets are moved."""
    samples = np.zeros(round(clip.duration_s * RATE), np.float32)
    for closure in clip.closures_s:
        start_s = closure - sum(by for since, by in clip.moved if closure >= since + by)
        start_s += clip.overlapping * 512 / RATE if closure > 1.2 else 0
        samples[round(start_s * RATE) : round(start_s * RATE) + 48] = 0.9
    return samples


def write(path: Path, clip=Clip(), codecs=None, pictures=True) -> Path:
    """Pictures and sound, or the sound alone, in the container that the suffix says."""
    for_pictures, for_sound = codecs or CONTAINERS[path.suffix[1:]]
    with av.open(str(path), "w") as container:
        counting = path.suffix == ".avi"
        rate = Fraction(clip.fps).limit_denominator(1001) if counting else 1000
        video = container.add_stream(for_pictures, rate=rate) if pictures else None
        heard = container.add_stream(for_sound, rate=RATE, layout="mono")
        if video is not None:
            video.width = video.height = SIZE
            video.pix_fmt = "yuv420p"
            video.bit_rate = 2_000_000
            for packet in encoded_pictures(video, clip, counting):
                container.mux(packet)
        for packet in encoded_sound(heard, clip):
            container.mux(packet)
    return path


def encoded_pictures(stream, clip, counting):
    for number, time_s in enumerate(clip.pictures_s):
        frame = av.VideoFrame.from_ndarray(picture(opening(clip, time_s)), format="rgb24")
        rate = stream.codec_context.framerate
        frame.pts = number if counting else round(time_s * rate)
        frame.time_base = 1 / Fraction(rate)
        yield from stream.encode(frame)
    yield from stream.encode()


def encoded_sound(stream, clip):
    frame = av.AudioFrame.from_ndarray(sound(clip)[None], format="fltp", layout="mono")
    frame.rate, frame.pts, frame.time_base = RATE, 0, Fraction(1, RATE)
    resampler = av.AudioResampler(format=stream.format.name, layout="mono", rate=RATE)
    packets = [*(p for part in resampler.resample(frame) for p in stream.encode(part)), *stream.encode()]
    for packet in packets if stream.frame_size else in_pieces(stream, clip):
        if packet.pts is not None:
            overlaps = min(max(0, (packet.pts - RATE) // 1024), clip.overlapping) if clip.overlapping else 0
            by_s = -overlaps * 512 / RATE + sum(by for since, by in clip.moved if packet.pts * packet.time_base >= since)
            packet.pts += round(by_s / packet.time_base)
            packet.dts = packet.pts
        yield packet


def in_pieces(stream, clip):
    """Packets of 1,024 samples of 16 bits, as recorders lay them down."""
    samples = (sound(clip) * 32767).astype("<i2")
    for first in range(0, len(samples), 1024):
        packet = av.Packet(samples[first : first + 1024].tobytes())
        packet.stream, packet.pts, packet.time_base = stream, first, Fraction(1, RATE)
        yield packet


def heard_s(path):
    """When clicks are heard, s, in the sound that facesynth reads."""
    found = read_sound(path)
    return clicks_of(found.audio, found.sample_rate)


def clicks_of(audio, rate):
    """When clicks are heard in a sound [S]: where each begins, s."""
    loud = np.flatnonzero(np.abs(audio) > 0.35)
    return loud[np.diff(loud, prepend=-rate) > 0.05 * rate] / rate


def seen_s(path):
    """When the lips are seen to close, s, in the motion that facesynth makes of the pictures; and its rate."""
    with open_video(path) as video:
        found = [(time_s, float(image[25:55, 20:44].mean())) for time_s, image in video.images]
        stated = video.fps
    times_s = np.array([time_s for time_s, _ in found])
    fps, _ = steady_rate(times_s, stated)
    shut = at_regular_times(np.array([[level] for _, level in found], np.float32), times_s, fps)[:, 0]
    return peaks(np.nan_to_num(shut, nan=float(np.nanmin(shut)))) / fps


def peaks(signal):
    """Places of the maxima of a signal [T], between samples by a parabola."""
    high = signal.min() + 0.6 * np.ptp(signal)
    places = [t for t in range(1, len(signal) - 1) if signal[t] > high and signal[t - 1] < signal[t] >= signal[t + 1]]
    curved = [signal[t - 1] - 2 * signal[t] + signal[t + 1] for t in places]
    return np.array([t + 0.5 * (signal[t - 1] - signal[t + 1]) / bend for t, bend in zip(places, curved, strict=True)])


def largest_error_s(path, clip=Clip()):
    """The largest time between a click that is heard and the closure that is seen with it."""
    heard, seen = heard_s(path), seen_s(path)
    assert len(heard) == len(seen) == len(clip.closures_s), (heard, seen)
    return float(np.abs(heard - seen).max())
