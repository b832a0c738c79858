"""The pictures of a speaker whose real face is shown: taken from a corpus of followed points, kept beside the model."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.points.footage import read_footage
from facesynth.capture.points.shapes import Shapes
from facesynth.corpus import Corpus, Utterance
from facesynth.corpus.importers.points import kept_videos, shapes_beside
from facesynth.face.texture.lips import facing
from facesynth.face.texture.speaker import Speaker, lower_face_window
from facesynth.inference.closures import close_at, closing_direction
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, has_lips
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.trained import TrainedModel
from facesynth.motion.planar import HeadMaps, has_mouth, inner_outline, is_tracked, motion_frames, picture_points
from facesynth.progress import track

LARGEST_PICTURES_BYTES = 300_000_000
"""Of all cut-out pictures together: three minutes of a face 130 pixels wide, some hundred pictures in full HD."""
BACKGROUND_FRAMES = 250
SHORT_FRAMES = 25
OTHER_LIGHT = 15.0
"""Distance (0..255) of the mean colours of the lower face: clips further from the background's show up as seams over it."""
SUFFIX = ".face.npz"
PRESSED_UP_TO = 1.4
"""Of how far lips are apart where p, b and m shut them: in a picture in which they are farther, they are not pressed together."""


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
    behind = behind[: min(BACKGROUND_FRAMES, max(1, LARGEST_PICTURES_BYTES // behind[0].nbytes))]
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
        inner_lips=inner_outline(corpus.layout),
        jaw=corpus.layout.group("jaw") if has_mouth(corpus.layout) else np.zeros(0, np.int64),
        shut=shut_lips(corpus),
        pressed=pressed_pictures(corpus, {name: len(cut) for name, cut in zip(chosen, cuts, strict=True)}),
    )


def shut_lips(corpus: Corpus) -> NDArray[np.float64]:
    """[U] px between facing points of the inner lips where p, b and m are narrowest, the median; none where none is said."""
    if not has_mouth(corpus.layout):
        return np.zeros(0)
    found = [across for utterance in corpus for _, across in _narrowest(utterance)]
    return np.median(found, axis=0) if found else np.zeros(0)


def pressed_pictures(corpus: Corpus, counts: dict[str, int]) -> NDArray[np.bool_]:
    """[N] which pictures, so many of each utterance, are the narrowest of a p, b or m that shuts the lips."""
    shut, out = shut_lips(corpus), []
    for name, count in counts.items():
        pressed = np.zeros(count, np.bool_)
        for frame, across in _narrowest(corpus[name]) if len(shut) else ():
            pressed[frame] = across.mean() <= PRESSED_UP_TO * shut.mean()
        out.append(pressed)
    return np.concatenate(out)


def _narrowest(utterance: Utterance) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The frame in which each p, b and m is narrowest, and px between facing points of the inner lips [U] in it."""
    upper, lower = facing(inner_outline(utterance.motion.layout))
    points = picture_points(utterance.motion.frames)
    across = np.linalg.norm(points[:, lower] - points[:, upper], axis=-1)
    for start, stop in bilabial_spans(utterance.speech.phones, utterance.motion.fps):
        if len(said := across[start:stop]):
            yield start + int(said.mean(axis=1).argmin()), said[said.mean(axis=1).argmin()]


def closed_at_phones(motion: Motion, phones: PhoneTrack, speaker: Speaker) -> Motion:
    """A motion of the speaker's points whose lips are shut at each p, b and m, the jaw and the cheeks along with them.

    So it is for every method: some shut the lips themselves, others leave them open by what they do not hear.
    """
    if not len(speaker.shut) or not has_lips(motion.layout):
        return motion
    upper = facing(speaker.inner_lips)[0].tolist()
    nearest = float(np.mean([speaker.shut[upper.index(above)] for above, _ in motion.layout.lip_pairs]))
    recorded = motion_frames(speaker.shapes).astype(np.float64)
    spans, along = bilabial_spans(phones, motion.fps), closing_direction(recorded, motion.layout)
    closed = close_at(motion.frames.astype(np.float64), motion.layout, spans, nearest, motion.fps, along)
    return replace(motion, frames=closed.astype(np.float32))


def load_face(mouth: TrainedModel) -> Speaker:
    """The pictures beside a model that was loaded from a file; FacesynthError where there are none, or of another speaker."""
    if mouth.path is None:
        raise FacesynthError("the pictures of the real face lie beside the model's file; save the model and load it")
    path = face_path(mouth.path)
    speaker, count = Speaker.load(path), len(mouth.fitted_layout.names)
    if speaker.shapes.shape[1] != count:
        raise FacesynthError(
            f"{path} has {speaker.shapes.shape[1]} points, the model {count}: they are of different speakers; train again"
        )
    return speaker


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
    count = max(1, int(len(names) * min(1.0, LARGEST_PICTURES_BYTES / total)))
    return [names[place] for place in np.unique(np.linspace(0, len(names) - 1, count).round().astype(int))]


def _cut(video: Path, window: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    left, top, right, bottom = window
    return read_footage(video).frames[:, top:bottom, left:right].copy()
