"""How much of each component of a pose is what the search found and how much what was expected.

A mean over recorded movements and a regression err in different places, here the one more and there the other; and both, being
means, lie too near the mean face, their mean still more so. With f what was found, e what was expected, m = (1 - s) f + s e for
the share s that is there without learning, the truth t of sentences that neither knows is fitted for each component by

    t - m  ≈  a m + b (f - e),      with a penalty of PENALTY_S / (seconds of t) · (a² |m|² + b² |f - e|²),

as if PENALTY_S more had been recorded for which m is right: few recordings change little. What is shown is then
((1 - s)(1 + a) + b) f + (s (1 + a) - b) e.
"""

from collections.abc import Iterable

import numpy as np
import torch

from facesynth.corpus import Utterance
from facesynth.inference.arrays import Floats
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn.descent import with_gaps
from facesynth.motion.resample import resample

PENALTY_S = 96.0
"""Seconds for which nothing would have to change; so long were the clips by which this was tried."""


def learned_shares(model: Efase, utterances: Iterable[Utterance]) -> tuple[tuple[float, ...], ...]:
    """[2, D] of what is found and of what is expected, by utterances that the model did not learn from."""
    share = model.config["expected_share"]
    found, expected, truth = (np.concatenate(each) for each in zip(*(_sample(model, u) for u in utterances), strict=True))
    mean, apart = (1 - share) * found + share * expected, found - expected
    a, b = _least_squares(mean, apart, truth - mean, PENALTY_S * model.speaker.database_fps / max(len(truth), 1))
    return tuple(((1 - share) * (1 + a) + b).tolist()), tuple((share * (1 + a) - b).tolist())


def _sample(model: Efase, utterance: Utterance) -> tuple[Floats, Floats, Floats]:
    """What is found, what is expected and what was recorded, [T, D] each, in the frames that were recorded."""
    speech, speaker = utterance.speech, model.speaker
    bounds, plan = speech.phones.frame_bounds(speaker.database_fps), speaker.plan(speech)
    found = speaker.found(plan, speech.phones.labels, speech.emotions.per_phone(speech.phones)[0], bounds)
    frames = torch.from_numpy(resample(utterance.motion, speaker.database_fps).frames)
    truth = with_gaps(model.pca.encode(frames.to(model.pca.mean.device)).cpu().double(), len(found)).numpy()
    there = np.isfinite(truth).all(axis=1)
    return found[there], np.asarray(plan.expected)[there], truth[there]


def _least_squares(mean: Floats, apart: Floats, missed: Floats, penalty: float) -> tuple[Floats, Floats]:
    """a, b [D] of missed [T, D] ≈ a mean + b apart."""
    given = np.stack([mean, apart], axis=-1)  # [T, D, 2]
    squares = np.einsum("tdi,tdj->dij", given, given)
    squares += (penalty * squares + 1e-12) * np.eye(2)
    a, b = np.linalg.solve(squares, np.einsum("tdi,td->di", given, missed)[..., None])[..., 0].T
    return a, b
