"""Truth and methods side by side, with the sound, small enough to lie inside a page."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Utterance
from facesynth.evaluation.pair import Array
from facesynth.evaluation.point_face import PAPER, PointFace
from facesynth.face.draw.video import frame_count, write_video
from facesynth.inference.motion import Motion

PANEL = (240, 280)
TITLE_PX = 22
FPS = 25.0
LONGEST_S = 8.0


def write_side_by_side(path: Path, utterance: Utterance, motions: Mapping[str, Motion], face: PointFace, worst: float) -> None:
    """A panel for the recording, grey, and one for each method, reddened where it is off by up to `worst`."""
    duration_s = min(LONGEST_S, utterance.motion.duration_s)
    count = frame_count(duration_s, FPS)
    rate = utterance.speech.sample_rate
    sound = utterance.speech.audio[: round(count / FPS * rate)]
    write_video(path, _frames(utterance.motion, motions, face, worst, count), FPS, sound, rate)


def panels(truth: Motion, motions: Mapping[str, Motion], face: PointFace, worst: float, k: int) -> NDArray[np.uint8]:
    """Frame k of the recording and of each method, side by side."""
    truth_frame = truth.frames[k].astype(np.float64)
    drawn = [_titled("recorded", face.picture(truth_frame, PANEL))]
    for label, motion in motions.items():
        frame = motion.frames[k].astype(np.float64)
        apart = np.nan_to_num(np.linalg.norm(face.layout.points(frame) - face.layout.points(truth_frame), axis=1))
        drawn.append(_titled(label, face.picture(frame, PANEL, apart, worst)))
    return np.concatenate(drawn, axis=1)


def _frames(
    truth: Motion, motions: Mapping[str, Motion], face: PointFace, worst: float, count: int
) -> Iterator[NDArray[np.uint8]]:
    for i in range(count):
        yield panels(truth, motions, face, worst, min(round(i / FPS * truth.fps), len(truth) - 1))


def _titled(label: str, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    from PIL import Image, ImageDraw, ImageFont

    band = Image.new("RGB", (picture.shape[1], TITLE_PX), PAPER)
    ImageDraw.Draw(band).text((8, 3), label, fill=(40, 40, 46), font=ImageFont.load_default(14))
    return np.concatenate([np.asarray(band), picture], axis=0)


def worst_shown(errors: Array) -> float:
    """Error that is drawn darkest: the largest mean error of a point of any method shown."""
    present = errors[np.isfinite(errors)]
    return float(present.max()) if present.size and present.max() > 0 else 1.0
