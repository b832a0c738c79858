"""What an outside judge sees in the built-in performer's faces: python benchmarks/judged_emotions.py PERFORMER EMONET [sheet.png]

EMONET is emotions8.pth of the wheel fae 0.2 (EmoNet, Toisoul et al. 2021); faces are found by dlib (`pip install dlib-bin`), as
fae does. Three recordings of each emotion, three frames of each, drawn on the built-in head and looked at: sheet.png shows them.
"""

import sys
from collections import Counter
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

NAMES = ("neutral", "happy", "sad", "surprise", "fear", "disgust", "anger", "contempt", "none")
"""Of the judge's classes."""
RECORDINGS, FRAMES, MARGIN_S = 3, 3, 0.5
SIZE, JUDGED_PX = (480, 480), 256


def main(performer: Path, weights: Path, sheet: Path | None) -> None:
    corpus, rig = Corpus.open(performer), load_head()
    judge, finder = torch.jit.load(weights).eval(), dlib.get_frontal_face_detector()
    renderer, rows = Renderer.of(rig, SIZE), []
    for emotion in corpus.emotions:
        names = [record.id for record in corpus.usable_records if record.emotion == emotion and record.take == 1][:RECORDINGS]
        pictures = [picture for name in names for picture in faces(corpus[name].motion, rig, renderer)]
        crops = np.stack([face_of(picture, finder) for picture in pictures])
        with torch.no_grad():
            found = judge(torch.from_numpy(crops).permute(0, 3, 1, 2).float() / 255)["expression"].argmax(dim=1)
        print(f"{emotion}: {dict(Counter(NAMES[k] for k in found.tolist()).most_common())}", flush=True)
        rows.append(np.concatenate([np.asarray(Image.fromarray(picture).resize((160, 160))) for picture in pictures], axis=1))
    if sheet is not None:
        Image.fromarray(np.concatenate(rows)).save(sheet)


def faces(motion: Motion, rig: Rig, renderer: Renderer) -> list[np.ndarray]:
    """Pictures of some frames, gaps filled by what the markers do on the whole."""
    margin = round(MARGIN_S * motion.fps)
    at = np.linspace(margin, len(motion) - margin, FRAMES).astype(int)
    whole = np.where(np.isfinite(motion.frames[at]), motion.frames[at], np.nanmedian(motion.frames, axis=0))
    shown = replace(motion, frames=whole.astype(np.float32), head=motion.head[at], eyes=motion.eyes[at])
    solved = on_head(shown, rig, None)
    weights = gaze_weights(solved.frames.astype(np.float64), shown.eyes[:, 1:].astype(np.float64))
    return [renderer.render(pose(rig, one, turned)) for one, turned in zip(weights, solved.head, strict=True)]


def face_of(picture: np.ndarray, finder: "dlib.fhog_object_detector") -> np.ndarray:
    """[256, 256, 3] where the face is; the whole picture where none is found."""
    found = finder(picture, 1)
    box = (found[0].left(), found[0].top(), found[0].right(), found[0].bottom()) if found else None
    return np.asarray(Image.fromarray(picture).resize((JUDGED_PX, JUDGED_PX), Image.Resampling.BILINEAR, box=box))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]) if len(sys.argv) > 3 else None)
