"""A corpus of followed points to the speaker's real face: its pictures in one file, and videos drawn from them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.points.footage import read_footage
from facesynth.capture.points.shapes import Shapes
from facesynth.corpus import Corpus
from facesynth.corpus.importers.points import kept_videos, shapes_beside
from facesynth.face.draw.video import write_video
from facesynth.face.texture.compose import Choice, Report, TexturedFace, ping_pong
from facesynth.face.texture.speaker import Speaker, lower_face_window
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.method import Method
from facesynth.motion.planar import HeadMaps, is_tracked, picture_points
from facesynth.motion.resample import resample
from facesynth.progress import track

MOST_BYTES = 300_000_000
"""Of all cut-out pictures together: three minutes of a face 130 pixels wide, some hundred pictures in full HD."""
BACKGROUND_FRAMES = 250
SHORT_FRAMES = 25
OTHER_LIGHT = 15.0
"""Distance (0..255) of the mean colours of the lower face: clips further from the background's show up as seams over it."""
SUFFIX = ".face.npz"


def face_path(model: Path) -> Path:
    """Where the pictures of a model's speaker lie: MODEL.face.npz beside MODEL.safetensors."""
    return model.with_name(model.stem + SUFFIX)


def save_face(corpus: Corpus, model: Path) -> Path | None:
    """Write the speaker's pictures beside a model that learned from followed points; None for any other corpus."""
    if not is_tracked(corpus.layout) or not kept_videos(corpus):
        return None
    path = face_path(model)
    speaker_of(corpus).save(path)
    return path


def speaker_of(corpus: Corpus) -> Speaker:
    """The pictures of a corpus, clips taken evenly as far as they fit, and a calm clip as what they are laid over.

    Clips in another light, or of another white balance, give no pictures; the model learns from their shapes all the same.
    """
    videos = kept_videos(corpus)
    if not videos:
        raise FacesynthError(f"{corpus.path} keeps no video of its utterances; add the videos again with `corpus add --points`")
    shapes = {utterance_id: shapes_beside(video) for utterance_id, video in videos.items()}
    height, width = read_footage(next(iter(videos.values()))).frames.shape[1:3]
    window = lower_face_window(*_joined(list(shapes.values())), height, width)
    chosen = _fitting(shapes, window)
    cuts = [_cut(videos[name], window) for name in track(chosen, "taking pictures")]
    colours = np.array([cut[:, ::4, ::4].mean(axis=(0, 1, 2)) for cut in cuts])
    calm = chosen[_calmest([shapes[name].head for name in chosen], colours)]
    alike = np.linalg.norm(colours - colours[chosen.index(calm)], axis=1) <= OTHER_LIGHT
    chosen = [name for name, kept in zip(chosen, alike, strict=True) if kept]
    cuts = [cut for cut, kept in zip(cuts, alike, strict=True) if kept]
    behind = read_footage(videos[calm]).frames
    behind = behind[: min(BACKGROUND_FRAMES, max(1, MOST_BYTES // behind[0].nbytes))]
    points, head = _joined([shapes[name] for name in chosen])
    background = shapes[calm].head.at(np.arange(len(behind)))
    return Speaker(
        pictures=np.concatenate(cuts),
        corner=np.array(window[:2]),
        shapes=points,
        linear=head.linear,
        shift=head.shift,
        clip_starts=np.concatenate([np.arange(len(cut)) == 0 for cut in cuts]),
        backgrounds=behind,
        background_linear=background.linear,
        background_shift=background.shift,
        fps=shapes[calm].fps,
    )


def load_face(model: Path, method: Method) -> Speaker:
    """The pictures beside a model; FacesynthError where they are missing, or of another speaker."""
    speaker = Speaker.load(face_path(model))
    count = len(method.fitted_layout.names)
    if speaker.shapes.shape[1] != count:
        raise FacesynthError(
            f"{face_path(model)} has {speaker.shapes.shape[1]} points, the model {count}: they are of different speakers; "
            "train again"
        )
    return speaker


def write_likeness(path: Path, motion: Motion, speech: Speech, speaker: Speaker, choice: Choice = "coherent") -> Report:
    """Video of the real face on shapes of followed points, with the sound, at the rate and size of the speaker's pictures."""
    steps = motion if np.isclose(motion.fps, speaker.fps, rtol=1e-6) else resample(motion, speaker.fps)
    report = Report()
    pictures = likeness(steps, speaker, report, choice)
    write_video(path, pictures, speaker.fps, speech.audio, speech.sample_rate)
    return report


def likeness(motion: Motion, speaker: Speaker, report: Report, choice: Choice = "coherent") -> Iterator[NDArray[np.uint8]]:
    """Pictures [h, w, 3] of the speaker, one for each frame; their sides are even, as H.264 wants them."""
    behind = ping_pong(0, len(speaker.backgrounds), len(motion))
    height, width = (side // 2 * 2 for side in speaker.backgrounds.shape[1:3])
    drawn = TexturedFace(speaker).draw(picture_points(motion.frames), behind, report, choice)
    for picture in track(drawn, "drawing", len(motion)):
        yield picture[:height, :width]


def _calmest(heads: list[HeadMaps], colours: NDArray[np.float64]) -> int:
    """The clip in which the head wanders least, of the half that is lit and coloured most like all of them together.

    Very short clips, which would repeat themselves to be seen, come last.
    """
    odd = np.linalg.norm(colours - np.median(colours, axis=0), axis=1)
    wandering = np.array([np.ptp(head.shift, axis=0).sum() for head in heads])
    short = np.array([len(head.shift) < SHORT_FRAMES for head in heads])
    return int(np.lexsort((wandering, odd > np.median(odd), short))[0])


def _joined(shapes: list[Shapes]) -> tuple[NDArray[np.float64], HeadMaps]:
    linear = np.concatenate([shape.head.linear for shape in shapes])
    shift = np.concatenate([shape.head.shift for shape in shapes])
    return np.concatenate([shape.points for shape in shapes]), HeadMaps(linear, shift)


def _fitting(shapes: dict[str, Shapes], window: tuple[int, int, int, int]) -> list[str]:
    """Clips, evenly from all, whose cut-out pictures stay within the bytes."""
    left, top, right, bottom = window
    total = sum(len(shape.points) for shape in shapes.values()) * (right - left) * (bottom - top) * 3
    names = list(shapes)
    count = max(1, int(len(names) * min(1.0, MOST_BYTES / total)))
    return [names[place] for place in np.unique(np.linspace(0, len(names) - 1, count).round().astype(int))]


def _cut(video: Path, window: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    left, top, right, bottom = window
    return read_footage(video).frames[:, top:bottom, left:right].copy()
