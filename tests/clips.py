"""Videos that tests make themselves."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np


def write_video(path: Path, images, fps=25, sound_s=0.0, first_pts=0, pts=None, rotation=0, sound=None) -> Path:
    """An MPEG-4 file of images [H, W, 3]; with `sound_s` seconds of a tone, or `sound` [S] at 16 kHz, beside them."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=fps)
        stream.width, stream.height, stream.pix_fmt = images[0].shape[1], images[0].shape[0], "yuv420p"
        stream.bit_rate = 4_000_000
        tone = container.add_stream("aac", rate=16000, layout="mono") if sound_s or sound is not None else None
        for number, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = first_pts + (pts[number] if pts else number)
            frame.time_base = Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
        if tone is not None:
            hum = 0.2 * np.sin(np.arange(int(16000 * sound_s)) * 0.1)
            samples = np.asarray(hum if sound is None else sound, np.float32)[None]
            block = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
            block.rate = 16000
            container.mux(tone.encode(block))
            container.mux(tone.encode())
    return path
