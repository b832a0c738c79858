"""A real clip beside the built-in head that says the same: a video of both, and a plate of pictures with the lips' opening.

    python examples/side_by_side.py clip.mpg said.mp4 said.npz actor/ -o folder/

`said.mp4` and `said.npz` are what `facesynth speak … -o said.mp4 -o said.npz` wrote for the clip's sound; `actor/` is the corpus
that was learned from. Writes `beside.mp4` (real left, head right, with the sound) and `plate.png`. `walk.py` does this as well.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.kept_tracks import kept_track
from facesynth.capture.motion import motion_of
from facesynth.capture.points.footage import read_footage
from facesynth.corpus import Corpus
from facesynth.face.draw.video import read_video, write_video
from facesynth.face.files.npz import read_npz
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import LipGap
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion
from facesynth.speech.audio import load_audio

Picture = NDArray[np.uint8]

COLUMNS, TILE, PLOT, MARGIN = 8, 200, 240, 40
TALKER, HEAD, GREY = "#c2452d", "#2d6fc2", "#8a9096"


def side_by_side(clip: Path, said: Path, weights: Path, actor: Path, folder: Path) -> tuple[Path, Path]:
    """Write `beside.mp4` and `plate.png` into a folder."""
    video, footage = read_video(said), read_footage(clip)
    real = [footage.frames[k] for k in _at(len(video.frames), float(video.fps), footage.fps, len(footage.frames))]
    pairs = [np.concatenate([_tall(left, right.shape[0]), right], axis=1) for left, right in zip(real, video.frames, strict=True)]
    write_video(folder / "beside.mp4", pairs, video.fps, *load_audio(clip))
    talker_mm, head_mm = openings(clip, weights, actor)
    _plate(pairs, float(video.fps), talker_mm, head_mm).save(folder / "plate.png")
    return folder / "beside.mp4", folder / "plate.png"


def openings(
    clip: Path, weights: Path, actor: Path
) -> tuple[tuple[NDArray[np.float64], float], tuple[NDArray[np.float64], float]]:
    """Opening of the lips (mm) and its rate (Hz): the talker's over the rest pose, as seen in the clip, and the head's."""
    layout = Corpus.open(actor).layout
    seen = motion_of(kept_track(clip), layout)
    shut = lip_gap(Motion(np.array([layout.neutral]), seen.fps, layout))[0]
    animation, _ = read_npz(weights)
    rig = load_head()
    return (np.maximum(lip_gap(seen) - shut, 0), seen.fps), (
        LipGap.of(rig).opening_mm(animation.weights_for(rig.names)),
        animation.fps,
    )


def _at(count: int, fps: float, other_fps: float, others: int) -> NDArray[np.int64]:
    """[count] pictures of the other video at the times of these."""
    return np.minimum(np.rint(np.arange(count) / fps * other_fps).astype(np.int64), others - 1)


def _tall(picture: Picture, height: int) -> Picture:
    from PIL import Image

    width = round(picture.shape[1] * height / picture.shape[0] / 2) * 2
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BICUBIC))


def _plate(
    pairs: list[Picture], fps: float, talker: tuple[NDArray[np.float64], float], head: tuple[NDArray[np.float64], float]
) -> object:
    """Real pictures above, the head's below them, at the times that the grey lines mark in the two trajectories."""
    from PIL import Image, ImageDraw

    chosen = np.linspace(0, len(pairs) - 1, COLUMNS + 2).astype(int)[1:-1]
    plate = Image.new("RGB", (COLUMNS * TILE, 2 * TILE + PLOT), "white")
    pen = ImageDraw.Draw(plate)
    height = pairs[0].shape[0]
    for column, k in enumerate(chosen.tolist()):
        real, drawn = pairs[k][:, :-height], pairs[k][:, -height:]
        edge = (real.shape[1] - height) // 2
        for row, picture in enumerate((real[:, edge : edge + height], drawn)):
            plate.paste(Image.fromarray(picture).resize((TILE, TILE)), (column * TILE, row * TILE))
    top, bottom = 2 * TILE + MARGIN, plate.height - MARGIN // 2
    most = float(max(np.nanmax(talker[0]), head[0].max(), 1.0))
    per_s = (plate.width - 2 * MARGIN) * fps / len(pairs)
    for k in chosen.tolist():
        x = MARGIN + k / fps * per_s
        pen.line([(x, top), (x, bottom)], fill=GREY)
    for (opening_mm, rate), colour in ((talker, TALKER), (head, HEAD)):
        points = [
            (MARGIN + t / rate * per_s, bottom - mm / most * (bottom - top)) for t, mm in enumerate(opening_mm) if np.isfinite(mm)
        ]
        pen.line(points, fill=colour, width=2)
    pen.text((MARGIN, top - 24), f"opening of the lips, 0 to {most:.1f} mm: the talker's over rest", fill=TALKER)
    pen.text((MARGIN + 420, top - 24), "the head's", fill=HEAD)
    return plate


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for name in ("clip", "said", "weights", "actor"):
        parser.add_argument(name, type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder")
    options = parser.parse_args()
    for path in side_by_side(options.clip, options.said, options.weights, options.actor, options.output):
        print(path)


if __name__ == "__main__":
    main()
