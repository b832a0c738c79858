"""What an outside judge sees in the built-in performer's faces: python benchmarks/judged_emotions.py PERFORMER EMONET [sheet.png]

EMONET is emotions8.pth of the wheel fae 0.2 (EmoNet, Toisoul et al. 2021). Faces are found by dlib (`pip install dlib-bin`), and
shown to the judge in two frames: `whole` is how EmoNet was trained and is tested by its authors (a square of 10/11 of width plus
height of the box around 68 landmarks: a head with its hair), `tight` is dlib's own box (forehead to chin), which fae cuts.
Ten recordings of each emotion, three frames of each, drawn on the built-in head and to be looked at: sheet.png shows them.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import dlib
import numpy as np
import torch
from PIL import Image

from facesynth.corpus import Corpus
from facesynth.face.draw.render import Renderer
from facesynth.face.rig.arkit import gaze_weights
from facesynth.face.rig.arkit_rig import Rig, load_head, pose
from facesynth.face.solve.animate import on_head
from facesynth.inference.motion import Motion
from facesynth.progress import track

NAMES = ("neutral", "happy", "sad", "surprise", "fear", "disgust", "anger", "contempt", "none")
"""Of the judge's classes."""
RECORDINGS, FRAMES, MARGIN_S = 10, 3, 0.5
SIZE, JUDGED_PX = (480, 480), 256
EDGES = ("whole", "tight")
FOREHEAD = 0.16
"""Share of dlib's box over the uppermost landmark, the top of the brows: measured on this head at rest."""
SQUARE = 10 / 11
"""Of width plus height of the landmarks' box: 200 / 220 in EmoNet's `get_scale_center` and `get_transform`."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, px."""


def main(performer: Path, weights: Path, sheet: Path | None) -> None:
    corpus, rig = Corpus.open(performer), load_head()
    judge, finder = torch.jit.load(weights).eval(), dlib.get_frontal_face_detector()
    renderer, rows = Renderer.of(rig, SIZE), []
    for emotion in corpus.emotions:
        names = [record.id for record in corpus.usable_records if record.emotion == emotion and record.take == 1]
        chosen = [names[k] for k in np.linspace(0, len(names) - 1, RECORDINGS).astype(int)]
        pictures = [picture for name in track(chosen, emotion) for picture in faces(corpus[name].motion, rig, renderer)]
        for edge in EDGES:
            found = named(judge, [face_of(picture, finder, edge) for picture in pictures])
            print(f"{emotion}, {edge}: {dict(Counter(found).most_common())}", flush=True)
        rows += strips(pictures)
    if sheet is not None:
        Image.fromarray(np.concatenate(rows)).save(sheet)


def faces(motion: Motion, rig: Rig, renderer: Renderer) -> list[np.ndarray]:
    """Pictures of some frames of a whole take, which is solved as one; gaps are filled by what the markers do on the whole."""
    margin = round(MARGIN_S * motion.fps)
    at = np.linspace(margin, len(motion) - margin, FRAMES).astype(int)
    whole = np.where(np.isfinite(motion.frames), motion.frames, np.nanmedian(motion.frames, axis=0))
    solved = on_head(replace(motion, frames=whole.astype(np.float32)), rig, None)
    weights = gaze_weights(solved.frames[at].astype(np.float64), motion.eyes[at, 1:].astype(np.float64))
    return [renderer.render(pose(rig, one, turned)) for one, turned in zip(weights, solved.head[at], strict=True)]


def named(judge: torch.nn.Module, crops: Sequence[np.ndarray]) -> list[str]:
    """What the judge calls each of them, one picture at a time."""
    with torch.no_grad():
        shown = (torch.from_numpy(crop).permute(2, 0, 1)[None].float() / 255 for crop in crops)
        return [NAMES[int(judge(picture)["expression"].argmax())] for picture in shown]


def face_of(picture: np.ndarray, finder: "dlib.fhog_object_detector", edge: str) -> np.ndarray:
    """[256, 256, 3] where the face is; the whole picture where none is found."""
    found = finder(picture, 1)
    box = (found[0].left(), found[0].top(), found[0].right(), found[0].bottom()) if found else None
    if box is not None and edge == "whole":
        box = around_landmarks(box, picture.shape[1])
    return np.array(Image.fromarray(picture).resize((JUDGED_PX, JUDGED_PX), Image.Resampling.BILINEAR, box=box))


def around_landmarks(box: Box, size_px: int) -> Box:
    """The square that EmoNet is shown, moved into the picture where it reaches over its edge."""
    left, top, right, bottom = box
    brows = top + FOREHEAD * (bottom - top)
    side = min(SQUARE * (right - left + bottom - brows), size_px)
    x, y = ((low + high - side) / 2 for low, high in ((left, right), (brows, bottom)))
    x, y = (min(max(value, 0.0), size_px - side) for value in (x, y))
    return x, y, x + side, y + side


def strips(pictures: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """Small pictures, fifteen side by side."""
    small = [np.asarray(Image.fromarray(picture[30:450, 60:420]).resize((120, 140))) for picture in pictures]
    for start in range(0, len(small), 15):
        yield np.concatenate(small[start : start + 15], axis=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]) if len(sys.argv) > 3 else None)
