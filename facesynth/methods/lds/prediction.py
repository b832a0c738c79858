"""How well the model predicts the next frame of a recording, beside what predicts nothing at all."""

import numpy as np
import torch
from torch import Tensor

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import Speech
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.rollout import Rollout
from facesynth.methods.lds.system import Array, Clip


def one_step(model: LDS, speech: Speech, frames: Array) -> tuple[float, float]:
    """Mean squared errors [unit squared] of a channel one frame ahead: of the model, and of "no change".

    Both in the model's principal components of frames [T, C], which hold what it can say at all. The model knows the
    recording up to the frame before; while it does not know the clip yet, its first `rows` frames, nothing counts. Where the
    model was learned without the clips' own means, the clip's is taken out: "no change" does not feel it.
    """
    if not np.isfinite(frames).all():
        raise FacesynthError("one-step prediction needs frames without gaps; fill them or leave the utterance out")
    y = model.shape.encode(torch.from_numpy(frames).float())
    clip = Clip(model.encode(speech, len(y)).double().numpy(), y.double().numpy())
    clip = clip.centred() if model.config["own_means"] else clip
    burn_in, scale = int(model.facts["rows"]), model.shape.scale.double().numpy()
    errors = innovations(model.rollout, torch.from_numpy(clip.u), torch.from_numpy(clip.y)).numpy()[burn_in:]
    changes = np.diff(clip.y, axis=0)[burn_in - 1 :]
    ahead, still = (float(((signal * scale) ** 2).sum(axis=1).mean()) / frames.shape[1] for signal in (errors, changes))
    return ahead, still


def innovations(rollout: Rollout, u: Tensor, y: Tensor) -> Tensor:
    """e(t) = y(t) - C x(t) - D_d u(t) [T, p], the state driven by u and by what the prediction lacked (eq. 9)."""
    A, B, C, D = (matrix.to(u.dtype) for matrix in (rollout.A, rollout.B, rollout.C, rollout.D))
    state, found = A.new_zeros(len(A)), []
    for features, shape in zip(u, y, strict=True):
        lacking = shape - C @ state - D[:, : len(features)] @ features
        state = A @ state + B @ torch.cat([features, lacking])
        found.append(lacking)
    return torch.stack(found)
