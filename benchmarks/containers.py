"""The largest time between a click that is heard and the closure that is seen with it, in every container.

python benchmarks/containers.py
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

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


def main() -> None:
    print("| container | codecs | " + " | ".join(CLIPS) + " |")
    print("|---|---|" + "---|" * len(CLIPS))
    with tempfile.TemporaryDirectory() as folder:
        for suffix, codecs in CONTAINERS.items():
            cells = []
            for name, clip in CLIPS.items():
                if suffix == "avi" and name in UNTIMED:
                    cells.append("")
                    continue
                played = as_long(clip) if suffix == "avi" else clip
                path = write(Path(folder) / f"clip.{suffix}", played)
                cells.append(f"{1000 * largest_error_s(path, played):.1f}")
            print(f"| {suffix} | {' + '.join(codecs)} | " + " | ".join(cells) + " |")


def as_long(clip: Clip) -> Clip:
    """With pictures up to the end of the sound: what outlasts them looks like a recorder that lays its sound down late."""
    return replace(clip, pictures_s=at_30_fps(clip.duration_s + sum(by for _, by in clip.moved)))


if __name__ == "__main__":
    main()
