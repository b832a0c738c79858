"""A mouth's motion on the speaker's real face, in video."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.signals import write_motion
from facesynth.face.draw.video import write_video
from facesynth.face.texture.compose import Choice, Report, TexturedFace, ping_pong
from facesynth.face.texture.speaker import Speaker
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.trained import TrainedModel
from facesynth.motion.planar import picture_points
from facesynth.motion.resample import resample
from facesynth.progress import track
from facesynth.stage.cast import Cast
from facesynth.stage.performance import Written
from facesynth.stage.request import Part, Request
from facesynth.stage.speaker_pictures import closed_at_phones, load_face
from facesynth.stage.whole_face import described

OUTPUTS = (".mp4", ".npz")
OF_PICTURES = "as in the speaker's pictures"


def check_picture_output(path: Path) -> None:
    """FacesynthError for a file that a real face cannot be written to."""
    if path.suffix.lower() not in OUTPUTS:
        raise FacesynthError(f"a model of points in a picture has no head for {path.suffix}; write .mp4 (the real face) or .npz")


@dataclass(frozen=True, eq=False)
class Likeness:
    """One utterance, said by the speaker's real face."""

    speech: Speech
    motion: Motion
    """Shapes of the followed points, at the rate of the model."""
    speaker: Speaker
    choice: Choice
    sources: Mapping[str, str]
    """Who moves each part of the face."""

    def write(self, path: Path) -> Written:
        """Write the video, at the rate and size of the speaker's pictures, or the shapes."""
        if path.suffix.lower() == ".npz":
            write_motion(path, self.motion)
            return Written(f"{path}: {self.speech.duration_s:.2f} s at {self.motion.fps:.5g} fps")
        fps, report = self.speaker.fps, Report()
        steps = self.motion if np.isclose(self.motion.fps, fps, rtol=1e-6) else resample(self.motion, fps)
        pictures = likeness(steps, self.speaker, report, self.choice)
        write_video(path, pictures, fps, self.speech.audio, self.speech.sample_rate)
        facts = {name: getattr(report, name) for name in ("real_time_factor", "folded_triangles", "relaxed_frames", "jumps")}
        return Written(
            f"{path}: {self.speech.duration_s:.2f} s at {fps:.5g} fps; real-time factor of the drawing"
            f" {report.real_time_factor:.2f}, folded triangles {report.folded_triangles}, jumps between pictures {report.jumps}",
            facts,
        )


@dataclass(frozen=True, eq=False)
class PictureStage:
    """The pictures of a speaker, ready for motion after motion."""

    speaker: Speaker
    request: Request
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, mouth: TrainedModel, request: Request) -> Self:
        """The speaker of a model; what was asked for that the pictures decide is warned of."""
        idle = [f"--{name}" for name in ("fps", "size") if getattr(request, name) is not None]
        idle += [f"--{name}" for name in ("head", "eyes") if getattr(request, name) != Part()]
        idle += ["--mouth"] if request.mouth != 1 else []
        warning = f"{', '.join(idle)}: a real face keeps the rate, size, mouth, head and eyes of its pictures"
        return cls(load_face(mouth), request, (warning,) if idle else ())

    def perform(self, motion: Motion, speech: Speech, cast: Cast) -> Likeness:
        """Put a motion on the face; its lips are shut at each p, b and m."""
        motion = closed_at_phones(motion, speech.phones, self.speaker)
        sources = {"mouth": described(cast.mouth), "head": OF_PICTURES, "eyes": OF_PICTURES}
        return Likeness(speech, motion, self.speaker, self.request.pictures, sources)


def likeness(motion: Motion, speaker: Speaker, report: Report, choice: Choice = "coherent") -> Iterator[NDArray[np.uint8]]:
    """Pictures [h, w, 3] of the speaker, one for each frame; their sides are even, as H.264 wants them."""
    behind = ping_pong(0, len(speaker.backgrounds), len(motion))
    height, width = (side // 2 * 2 for side in speaker.backgrounds.shape[1:3])
    drawn = TexturedFace(speaker).draw(picture_points(motion.frames), behind, report, choice)
    for picture in track(drawn, "drawing", len(motion)):
        yield picture[:height, :width]
