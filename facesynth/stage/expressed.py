"""Expressions on a mouth of any layout: a real talker's mouth may feel what another performer recorded."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facesynth.face.rig.arkit import arkit_columns
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import LipGap
from facesynth.face.solve.animate import nearly_shut, on_head
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import NEUTRAL, EmotionTrack, Speech
from facesynth.methods.capabilities import Expressing
from facesynth.methods.registry import require
from facesynth.methods.trained import TrainedModel
from facesynth.motion.planar import is_tracked
from facesynth.motion.resample import resample


def expressed(model: TrainedModel, motion: Motion, speech: Speech, *, seed: int = 0) -> Motion:
    """A mouth's motion with the emotions of speech, as strong as their intensities say.

    Of the layout that the model of expressions learned from, the motion keeps it. One of another layout becomes weights of
    the built-in head's shapes, for these both have in common; followed points of a real face do not, for they belong on video.
    Where nothing is felt the motion stays as it is.
    """
    expressing, own = require(model, Expressing), model.fitted_layout
    same = (motion.layout.kind, motion.layout.names) == (own.kind, own.names)
    if same or is_tracked(motion.layout):
        return expressing.express(motion, speech, seed=seed)
    if not any(
        one != NEUTRAL and much > 0 for one, much in zip(speech.emotions.labels, speech.emotions.intensities, strict=True)
    ):
        return motion
    if motion.layout.kind == "curves" and not arkit_columns(motion.layout):
        raise FacesynthError("expressions are added to points of a face or to ARKit's curves; this mouth moves other curves")
    return _on_common_shapes(model, motion, speech, seed)


# With w the weights that the bounded least squares find, m the mouth, f a still face that feels and r the same face at rest:
#
#   w = w(m) + w(f) - w(r),  within 0 and 1,
#
# and where the lips of m touch, mouthClose brings those of w as near.
def _on_common_shapes(model: TrainedModel, motion: Motion, speech: Speech, seed: int) -> Motion:
    rig = load_head()
    lips, mouth = LipGap.of(rig), on_head(motion, rig, speech.phones)
    calm = replace(speech, emotions=EmotionTrack.constant(NEUTRAL, speech.duration_s))
    feeling, rest = (_weights(model.synthesize(one, seed=seed), motion) for one in (speech, calm))
    felt = np.clip(mouth.frames + feeling - rest, 0, 1)
    opening_mm = lips.opening_mm(mouth.frames)
    frames = np.clip(lips.closed(felt, opening_mm, nearly_shut(opening_mm)), 0, 1)
    return replace(mouth, frames=frames.astype(np.float32))


def _weights(face: Motion, motion: Motion) -> NDArray[np.float64]:
    """[T, 52] weights of a face at the frames of a motion."""
    there = on_head(resample(face, motion.fps), load_head(), None).frames.astype(np.float64)
    return np.asarray(there[np.minimum(np.arange(len(motion)), len(there) - 1)])
