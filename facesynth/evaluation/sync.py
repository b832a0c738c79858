"""Whether lips go with the sound: a small network that learned, from other recordings, to tell what is in step from what is not.

Two short stretches, of the sound and of the lips' movement around the same frame, are each turned into a unit vector; their
product is high where both belong to one moment. A motion is as late as the shift at which the mean product is highest.

Lips that hardly move go with nothing. Their product would depend on the sound alone, and where a recording begins and ends in
silence be highest unshifted, for that is where all of the silence is heard, which goes with lips at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from facesynth.corpus import Corpus
from facesynth.evaluation.lip_shapes import RATE, LipShapes, windows
from facesynth.evaluation.pair import Array, UnavailableError
from facesynth.inference.motion import Motion
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.speech.mel import LogMel, sample_at

MOST_SHIFT = 5
"""Frames either way among which the best shift is looked for: ±0.2 s."""
FURTHEST = 10
"""Frames by which pairs that are out of step are moved apart, at most."""
SOUND_FRAMES, LIP_FRAMES = 9, 7
"""Lengths of the stretches, in frames of RATE."""
SOUND_RATE = 50.0
BANDS, WIDTH, VECTOR = 40, 64, 32
STEPS, BATCH, LEARNING_RATE, SHARPNESS = 200, 256, 3e-3, 8.0
FEWEST_FRAMES = 200
"""Frames of recordings, under which nothing is learned."""
STILL = 0.1
"""Lips whose every component moves less than this share of its recorded deviation stand still."""
NEVER_MOVES = "the lips stand still (a tenth of the recorded movement counts), and no sound goes with that"


@dataclass(frozen=True, eq=False)
class SyncJudge:
    """The trained network."""

    shapes: LipShapes
    sound: nn.Sequential
    lips: nn.Sequential
    mean: Tensor
    deviation: Tensor

    @classmethod
    def learn(cls, recorded: Corpus, *, seed: int = 0) -> Self:
        """From recordings; UnavailableError where they are too short, or their layout names no lips."""
        shapes = LipShapes.learn(recorded)
        sounds = [_bands(utterance.speech) for utterance in recorded]
        everything = torch.cat(sounds)
        mean, deviation = everything.mean(dim=0), everything.std(dim=0).clamp(min=1e-3)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            judge = cls(shapes, _tower(_sound_width()), _tower(2 * LIP_FRAMES * len(shapes.size)), mean, deviation)
        pairs = [judge._stretches(utterance.speech, utterance.motion) for utterance in recorded]
        pairs = [pair for pair in pairs if len(pair[0]) > 2 * FURTHEST]
        if sum(len(sound) for sound, _ in pairs) < FEWEST_FRAMES:
            raise UnavailableError("the recordings of other sentences are too short to learn what is in step")
        judge._train(pairs, np.random.default_rng(seed))
        return judge

    def shift_ms(self, speech: Speech, motion: Motion) -> float:
        """How late the lips are for the sound (ms), whole frames of RATE; NaN where they stand still.

        UnavailableError for motions that are too short.
        """
        sound, lips = self._stretches(speech, motion)
        present = torch.isfinite(lips).all(dim=1)
        if len(sound) <= 2 * MOST_SHIFT or int(present.sum()) <= 2 * MOST_SHIFT:
            raise UnavailableError("the utterance is too short to be shifted")
        if np.nanstd(self.shapes.of(motion), axis=0).max() < STILL:
            return float("nan")
        with torch.no_grad():
            heard, seen = _unit(self.sound(sound)), _unit(self.lips(torch.nan_to_num(lips)))
        agreement = [_agreement(heard, seen, present, shift) for shift in range(-MOST_SHIFT, MOST_SHIFT + 1)]
        return (int(np.argmax(agreement)) - MOST_SHIFT) / RATE * 1000

    def _stretches(self, speech: Speech, motion: Motion) -> tuple[Tensor, Tensor]:
        """[T, …] of the sound and [T, …] of the lips around each frame of RATE."""
        shapes = self.shapes.of(motion)
        reach = LIP_FRAMES // 2
        held = np.pad(shapes, ((reach, reach), (0, 0)), mode="edge")
        around = windows(held, LIP_FRAMES)
        posture = around - around.mean(axis=1, keepdims=True)
        moving = np.concatenate([posture, np.gradient(around, axis=1)], axis=1).reshape(len(shapes), -1)
        times_s = np.arange(len(shapes))[:, None] / RATE + _offsets_s()
        bands = (sample_at(_bands(speech), 100.0, times_s) - self.mean) / self.deviation
        return bands.flatten(1).float(), torch.from_numpy(moving).float()

    def _train(self, pairs: list[tuple[Tensor, Tensor]], rng: np.random.Generator) -> None:
        """Pairs in step against pairs of the same utterance 1 to FURTHEST frames apart."""
        starts = np.concatenate([[0], np.cumsum([len(sound) for sound, _ in pairs])])
        sounds, lips = (torch.cat([pair[i] for pair in pairs]) for i in (0, 1))
        owner = np.repeat(np.arange(len(pairs)), np.diff(starts))
        whole = np.flatnonzero(torch.isfinite(lips).all(dim=1).numpy())
        lips = torch.nan_to_num(lips)
        optimiser = torch.optim.AdamW([*self.sound.parameters(), *self.lips.parameters()], LEARNING_RATE, weight_decay=0.05)
        for _ in range(STEPS):
            at = rng.choice(whole, BATCH)
            moved = rng.integers(1, FURTHEST + 1, BATCH) * rng.choice([-1, 1], BATCH)
            apart = np.clip(at + moved, starts[owner[at]], starts[owner[at] + 1] - 1)
            seen = _unit(self.lips(lips[at]))
            near, far = ((_unit(self.sound(sounds[i])) * seen).sum(dim=1) for i in (at, apart))
            loss = functional.softplus(-SHARPNESS * (near - far)).mean()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
            optimiser.step()


def _tower(inputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, WIDTH), nn.GELU(), nn.Linear(WIDTH, VECTOR))


def _unit(vectors: Tensor) -> Tensor:
    return functional.normalize(vectors, dim=-1)


def _agreement(heard: Tensor, seen: Tensor, present: Tensor, shift: int) -> float:
    """Mean product where lips that are `shift` frames late are put beside the sound that they belong to."""
    count = len(heard)
    sound, lips = slice(max(0, -shift), count - max(0, shift)), slice(max(0, shift), count - max(0, -shift))
    there = present[lips]
    return float((heard[sound] * seen[lips]).sum(dim=1)[there].mean()) if there.any() else -1.0


def _offsets_s() -> NDArray[np.float64]:
    """[n] times around a frame at which the sound is heard."""
    count = round(SOUND_FRAMES / RATE * SOUND_RATE)
    return (np.arange(count, dtype=np.float64) - (count - 1) / 2) / SOUND_RATE


def _sound_width() -> int:
    return BANDS * len(_offsets_s())


def _bands(speech: Speech) -> Tensor:
    """[F, BANDS] every 10 ms."""
    mel = LogMel(bands=BANDS)
    return mel(torch.from_numpy(np.ascontiguousarray(resample(speech.audio, speech.sample_rate, mel.sample_rate))))


def in_step(shifts_ms: Sequence[float | None]) -> Array:
    """[U] for shifts of utterances (ms): 1 where none fits best, else 0, also for still lips (NaN); NaN where None is known.

    All NaN where the lips of no utterance move: a face that rests is not judged by when it does so.
    """
    if not any(shift is not None and np.isfinite(shift) for shift in shifts_ms):
        return np.full(len(shifts_ms), np.nan)
    return np.array([np.nan if shift is None else float(shift == 0) for shift in shifts_ms])
