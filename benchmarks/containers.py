"""The largest time between a click that is heard and the closure that is seen with it, in every container.

python benchmarks/containers.py

First by how pictures and sound lie, at 30 fps; then by rate, where they are steady and where a gap is in the sound.
"""

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "reports"))

from closing_clips import CONTAINERS, Clip, at_30_fps, largest_error_s, write

CLIPS = {
    "steady": Clip(),
    "gap of 0.8 s in the sound": Clip((0.35, 1.6, 2.1), 2.6, at_30_fps(2.6), moved=((0.5, 0.8),)),
    "sound begins 0.5 s late": Clip((0.7, 1.2, 1.6), 2.4, at_30_fps(2.0), moved=((-1.0, 0.5),)),
    "overlaps": Clip((0.4, 1.4, 1.8), 2.2, at_30_fps(2.1), overlapping=9),
    "15, then 30 fps": Clip((0.4, 0.8, 1.7, 2.5), 3.0, (*(k / 15 for k in range(15)), *(1 + k / 30 for k in range(60)))),
}
UNTIMED = {"overlaps", "15, then 30 fps"}
"""AVI has no time stamps of its own: these cannot be written to it."""
RATES = {"24": 24.0, "25": 25.0, "29.97": 30000 / 1001, "50": 50.0, "60": 60.0}
"""Of pictures, Hz."""
AT_RATES = ("steady", "gap of 0.8 s in the sound")
ROWS = [
    *CONTAINERS.items(),
    *(("avi", codecs) for codecs in (("mpeg4", "aac"), ("mpeg4", "pcm_s16le"))),
    *(("avi", ("libx264", sound)) for sound in ("libmp3lame", "aac", "ac3", "pcm_s16le")),
    ("ts", ("libx264", "libmp3lame")),
    ("mkv", ("libx264", "libmp3lame")),
]


def main() -> None:
    table(CLIPS)
    clips = {f"{fps} fps, {name}": at_rate(CLIPS[name], rate) for name in AT_RATES for fps, rate in RATES.items()}
    print()
    table(clips)


def table(clips: Mapping[str, Clip]) -> None:
    """A row for each container and its codecs, a column for each clip."""
    print("| container | codecs | " + " | ".join(clips) + " |")
    print("|---|---|" + "---|" * len(clips))
    with tempfile.TemporaryDirectory() as folder:
        for suffix, codecs in ROWS:
            cells = []
            for name, clip in clips.items():
                if suffix == "avi" and name in UNTIMED:
                    cells.append("")
                    continue
                played = as_long(clip) if suffix == "avi" else clip
                path = write(Path(folder) / f"clip.{suffix}", played, codecs)
                cells.append(f"{1000 * largest_error_s(path, played):.1f}")
            print(f"| {suffix} | {' + '.join(codecs)} | " + " | ".join(cells) + " |", flush=True)


def at_rate(clip: Clip, fps: float) -> Clip:
    """With as many pictures a second."""
    return with_pictures(replace(clip, fps=fps), clip.duration_s)


def as_long(clip: Clip) -> Clip:
    """With pictures up to the end of the sound: what outlasts them looks like a recorder that lays its sound down late."""
    return with_pictures(clip, clip.duration_s + sum(by for _, by in clip.moved))


def with_pictures(clip: Clip, duration_s: float) -> Clip:
    """With pictures at its rate, for so long."""
    return replace(clip, pictures_s=tuple(np.arange(round(clip.fps * duration_s)) / clip.fps))


if __name__ == "__main__":
    main()
