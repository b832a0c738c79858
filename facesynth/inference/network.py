"""The network of poses: speech in, frames out, at once or as the sound comes in."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .beside import Beside, exported_beside
from .checks import checked_piece, checked_rate, require_open
from .closures import close_at
from .errors import FacesynthError, reject_options, unknown
from .expectation import BANDS_FPS, BEYOND, EACH, RATE, Expectation, Said, Single, exported_expectation
from .filters import cubic_at, sharpen
from .folder import Folder
from .heard import HOP, Listening, exported_listening
from .layout import Layout
from .lips import bilabial_spans
from .long_arrays import by_blocks
from .motion import Motion
from .openings import Openings
from .residual import ResidualMotion, exported_residual, main_emotion
from .sound import resample
from .speech import NEUTRAL, Speech

AHEAD_S = 0.4
"""How far the windows in which a stream hears with the phone network reach ahead, unless told otherwise, seconds."""


@dataclass(frozen=True, eq=False)
class Network:
    """Everything that a trained network speaks with; its parts are graphs of an exported folder, or modules of torch."""

    layout: Layout
    fps: float
    emotions: tuple[str, ...]
    hear: Listening
    """Sound [S] at RATE to features [F, B]."""
    expectation: Expectation
    """Of frames [C]."""
    sharpening: float = 0.0
    closed_gap: float = np.inf
    """How near the lips come at a p, b or m; infinite where they are left as they are."""
    openings: Openings | None = None
    """How far lips are open between shut and wide, where that is not left as it is."""
    beside: Beside | None = None
    """A model of phones alone, whose motion is averaged with the network's."""
    residual: ResidualMotion | None = None
    """What moves beside the lips, whatever is said."""
    unsaid: bool = False
    """Whether it learned to do without being told what is said."""
    manifest: Mapping[str, Any] = field(default_factory=dict)
    """Of the folder that it comes from."""

    @property
    def needs_phones(self) -> bool:
        """Whether it must be told what is said."""
        return self.expectation.reading.phones

    @property
    def look_ahead_s(self) -> float:
        """In a stream frame t waits for the sound up to t / fps + this, seconds, or less."""
        return self.late_s(AHEAD_S)

    def late_s(self, ahead_s: float) -> float:
        """The same of a stream whose windows reach so far ahead, seconds."""
        later_s = self.expectation.look_ahead_s + BEYOND / self.expectation.reading.rate
        return later_s + self.hear.look_ahead_s(ahead_s) + HOP / RATE

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """What is expected, sharpened, averaged with what phones alone say, openings evened out, lips closed at p, b and m, and
        what moves beside the lips. Nothing is random.
        """
        reject_options("network", options, ("seed",))
        if self.needs_phones and not self.unsaid:
            speech.phones.told("network")
        sound = resample(speech.audio, speech.sample_rate, RATE)
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        frames = self.expectation.poses(self.hear(sound), Said.of(speech, self.emotions), self.fps, count)
        frames = sharpen(frames, self.sharpening, self.fps)
        if self.beside is not None:
            frames = self.beside.mixed(frames, speech)
        if self.openings is not None:
            frames = self.openings.even_out(frames, self.layout)
        frames = close_at(frames, self.layout, bilabial_spans(speech.phones, self.fps), self.closed_gap, self.fps)
        if self.residual is not None:
            frames = self.residual.added(frames, speech, main_emotion(speech, self.emotions), self.fps)
        return Motion(by_blocks(np.asarray, frames), self.fps, self.layout)

    def stream(self, *, emotion: str | None = None, sample_rate: int | None = None, ahead_s: float = AHEAD_S) -> "SoundStream":
        """Sound in pieces of any size at RATE, one emotion throughout (neutral, or the first that the model knows).

        `ahead_s` is how far the windows of the phone network reach ahead, for a model that hears with it: what comes out
        depends on it a little, as it does on how loud the sound was so far. FacesynthError for a model that cannot do without
        being told phones, which a stream does not know. A stream is not sharpened, closes no lips, evens no openings, and adds
        neither what phones alone say nor residual motion.
        """
        if self.expectation.reading.phones and not self.unsaid:
            raise FacesynthError(
                "this network is told what is said and wants whole utterances; train one with phones=false, or with unsaid=0.3"
            )
        felt = (NEUTRAL if NEUTRAL in self.emotions else self.emotions[0]) if emotion is None else emotion
        if felt not in self.emotions:
            raise unknown("emotion", felt, self.emotions)
        checked_rate(RATE if sample_rate is None else sample_rate, RATE)
        return SoundStream(self, self.emotions.index(felt), ahead_s)


class SoundStream:
    """`push` sound, get the frames that became final: those of `synthesize` without sharpening, closing of lips and residual.

    A network that hears with the phone network hears through the windows of the stream, not of the whole. How the sound is cut
    changes nothing.
    """

    def __init__(self, model: Network, emotion: int, ahead_s: float) -> None:
        self.model, reading = model, model.expectation.reading
        self.look_ahead_s = model.late_s(ahead_s)
        """Frame t is final when the sound up to t / fps + this is known, or earlier, seconds."""
        self._said = Said.unknown(emotion, len(model.emotions))
        self._pieces, self._samples = model.hear.pieces(ahead_s), 0
        self._bands, self._first_band = np.zeros((0, len(reading.standard.mean)), np.float32), 0
        self._poses, self._first_pose = np.zeros((0, model.layout.channels)), 0
        self._given = 0
        self._ended = False

    def push(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S] at RATE; the frames [t, C] that became final."""
        require_open(self._ended)
        sound = checked_piece(audio)
        self._hear(sound)
        self._samples += len(sound)
        expectation, ratio = self.model.expectation, self._ratio
        last_s = (self._first_band + len(self._bands) - 1) / BANDS_FPS
        known = int(np.floor(last_s * expectation.reading.rate - (EACH - 1) / (2 * EACH))) - expectation.ahead + 1
        self._expect(known)
        return self._give(int(np.floor((known - 1 - BEYOND) / ratio + 1e-9)) + 1)

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back: after the end there is silence. Of no sound at all, none."""
        require_open(self._ended)
        self._ended = True
        if not self._samples:
            return np.zeros((0, self.model.layout.channels), np.float32)
        self._hear(np.zeros(0, np.float32), ended=True)
        count = max(1, round(self._samples / RATE * self.model.fps))
        self._expect(int(np.floor((count - 1) * self._ratio + 1e-9)) + 1 + BEYOND)
        return self._give(count)

    @property
    def _ratio(self) -> float:
        """Frames of the network for one frame of the motion."""
        return self.model.expectation.reading.rate / self.model.fps

    def _hear(self, sound: Single, *, ended: bool = False) -> None:
        heard = self._pieces.push(sound, ended=ended)
        if len(heard):
            self._bands = np.concatenate([self._bands, heard])

    def _expect(self, stop: int) -> None:
        """Poses up to frame `stop` of the network; bands that no later one needs are forgotten."""
        have, expectation = self._first_pose + len(self._poses), self.model.expectation
        if stop <= have:
            return
        new = expectation.frames(self._bands, self._said, have, stop, self._first_band / BANDS_FPS)
        self._poses = np.concatenate([self._poses, new])
        needed = int((stop - expectation.before - 1) / expectation.reading.rate * BANDS_FPS) - 1
        kept = int(np.clip(needed - self._first_band, 0, max(0, len(self._bands) - 1)))
        self._bands, self._first_band = self._bands[kept:], self._first_band + kept

    def _give(self, stop: int) -> NDArray[np.float32]:
        at = np.arange(self._given, max(self._given, stop), dtype=np.float64) * self._ratio - self._first_pose
        frames = cubic_at(self._poses, at) if len(at) else np.zeros((0, self.model.layout.channels))
        self._given += len(at)
        kept = int(np.clip(np.floor(self._given * self._ratio) - 1 - self._first_pose, 0, len(self._poses)))
        self._poses, self._first_pose = self._poses[kept:], self._first_pose + kept
        return frames.astype(np.float32)


def load_network(folder: Folder, threads: int) -> Network:
    """The model in a folder that `network_content` filled."""
    manifest, settings, arrays = folder.manifest, folder.settings, folder.arrays()
    gap, openings = settings["closed_gap"], settings.get("openings")
    return Network(
        folder.layout,
        float(manifest["fps"]),
        tuple(manifest["emotions"]),
        exported_listening(folder, threads),
        exported_expectation(folder, arrays, threads),
        sharpening=float(settings["sharpening"]),
        closed_gap=np.inf if gap is None else float(gap),
        openings=None if openings is None else Openings(**openings),
        beside=exported_beside(folder, arrays, threads),
        residual=exported_residual(folder, arrays),
        unsaid=bool(settings.get("unsaid")),
        manifest=manifest,
    )
