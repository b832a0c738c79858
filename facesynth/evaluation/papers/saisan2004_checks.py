"""The experiment of Saisan 2004 as it was made, on halves of one recording, and what its model takes for granted."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from facesynth.corpus import Corpus, Record, Utterance
from facesynth.evaluation.papers import Material
from facesynth.evaluation.papers.finding import Finding
from facesynth.evaluation.residual_tests import LAGS, ljung_box, pairwise_information
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.prediction import innovations
from facesynth.methods.lds.system import Clip

FEWEST_FRAMES = 400
"""Of a recording that is long enough to be halved."""


def halves(material: Material, settings: dict[str, object]) -> list[Finding]:
    """§6: the first half of one recording to learn from, the sound of the second to drive."""
    longest = max(material.corpus, key=lambda u: np.isfinite(u.motion.frames).all(axis=1).sum())
    if len(longest.motion) < FEWEST_FRAMES:
        raise FacesynthError(
            f"the longest recording has {len(longest.motion)} frames; a half of it must have {FEWEST_FRAMES // 2}"
        )
    middle = len(longest.motion) // 2
    first, second = part_of(longest, 0, middle), part_of(longest, middle, len(longest.motion))
    with TemporaryDirectory() as folder:
        model = LDS(**settings).fit(_alone(Path(folder) / "half", first, material.corpus), seed=material.seed)  # type: ignore[arg-type]
    truth = second.motion.frames.astype(np.float64)
    guesses = {"mean pose": np.broadcast_to(np.nanmean(first.motion.frames, axis=0), truth.shape)}
    for noise, name in ((0.0, "deterministic part"), (1.0, "one sample")):
        guesses[name] = model.synthesize(second.speech, seed=material.seed, noise=noise).frames[: len(truth)].astype(np.float64)
    unit, why = material.corpus.layout.unit, f"the paper prints a curve of one point, in pixels; {material.unlike}"
    what = f"{middle} frames to learn from, the sound of {len(truth)} to drive, RMS error per coordinate, {unit}"
    return [Finding("§6", f"{what}: {name}", "a curve", f"{_rms(g, truth):.3g}", False, why) for name, g in guesses.items()]


def part_of(utterance: Utterance, start: int, stop: int) -> Utterance:
    """Frames from start to stop, with their sound; nobody says which phones are spoken."""
    motion, speech = utterance.motion, utterance.speech
    begin_s, end_s = start / motion.fps, stop / motion.fps
    audio = speech.audio[round(begin_s * speech.sample_rate) : round(end_s * speech.sample_rate)]
    seconds = end_s - begin_s
    phones, felt = PhoneTrack(("pau",), np.array([seconds])), EmotionTrack.constant(utterance.emotion, seconds)
    said = Speech(audio, speech.sample_rate, phones, felt)
    return replace(utterance, speech=said, motion=Motion(motion.frames[start:stop], motion.fps, motion.layout))


def assumptions(model: LDS, material: Material) -> list[Finding]:
    """§3: residuals that are white, of which independent sources are made (eq. 4)."""
    clips = [e for u in material.train if len(e := residuals(model, u)) > 2 * LAGS]
    if not clips:
        raise FacesynthError(f"no recording is longer than {2 * LAGS} frames: whiteness of residuals cannot be told")
    together = np.concatenate(clips)
    sources = np.linalg.solve(model.innovations.mixing.double().numpy(), together.T).T
    white = [ljung_box([clip[:, k] for clip in clips]) for k in range(together.shape[1])]
    first = [_correlation(*_neighbours(clips, k)) for k in range(len(white))]
    passed = f"{sum(chance > 0.05 for _, chance in white)} of {len(white)}"
    why = "the paper assumes it and prints no test"
    found = [
        Finding("§3", f"residuals that pass for white (Ljung-Box, {LAGS} lags, 5 %)", "all", passed, True, why),
        Finding("§3", "largest correlation of a residual with the one before", "0", f"{max(first, key=abs):.3f}", True, why),
    ]
    for name, signals in (("residuals", together), ("sources made of them", sources)):
        information, independent = pairwise_information(signals)
        what = f"mutual information of two {name}, nats; pairs that may be independent (5 %)"
        found.append(Finding("§3", what, "0; all of sources", f"{information:.4f}; {independent:.0%}", True, why))
    return found


def residuals(model: LDS, utterance: Utterance) -> Floats:
    """[T, p] what the system did not foresee of a recording, its first frames left out; none where there are gaps."""
    frames = utterance.motion.frames
    if not np.isfinite(frames).all():
        return np.zeros((0, len(model.shape.scale)))
    y = model.shape.encode(torch.from_numpy(frames).float()).double().numpy()
    clip = Clip(model.encode(utterance.speech, len(y)).double().numpy(), y)
    clip = clip.centred() if model.config["own_means"] else clip
    found: Floats = innovations(model.rollout, torch.from_numpy(clip.u), torch.from_numpy(clip.y)).numpy()
    return found[int(model.facts["rows"]) :]


def _neighbours(clips: list[Floats], component: int) -> tuple[list[Floats], list[Floats]]:
    pairs = [(clip[:-1, component], clip[1:, component]) for clip in clips]
    return [one for one, _ in pairs], [other for _, other in pairs]


def _correlation(one: list[Floats], other: list[Floats]) -> float:
    return float(np.corrcoef(np.concatenate(one), np.concatenate(other))[0, 1])


def _alone(path: Path, utterance: Utterance, like: Corpus) -> Corpus:
    made = Corpus.create(path, performer=like.performer, layout=like.layout, fps=like.fps, emotions=like.emotions)
    made.add_utterance(Record("half", sentence="half", emotion=utterance.emotion), utterance.speech, utterance.motion)
    return made


def _rms(guess: Floats, truth: Floats) -> float:
    return float(np.sqrt(np.nanmean(np.square(guess - truth))))
