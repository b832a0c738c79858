"""Co-articulation as a method of the zoo."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.arrays import Floats
from facesynth.inference.coarticulation.blending import KeyShapes, WeightModels
from facesynth.inference.coarticulation.model import KEY_FIELDS, MODEL_FIELDS, Parts, as_doubles, weight_models
from facesynth.inference.coarticulation.model import Coarticulation as Runtime
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES, VISEME_CLASSES
from facesynth.inference.speech import NEUTRAL, Speech
from facesynth.methods.coarticulation.capabilities import CAPABILITIES
from facesynth.methods.coarticulation.keys import learn_keys
from facesynth.methods.coarticulation.recordings import Track, samples_of, track_of, transitions_of, usable
from facesynth.methods.coarticulation.transitions import learn_models
from facesynth.methods.learn.frames import mean_pose
from facesynth.methods.method import Method
from facesynth.methods.registry import register


@register(CAPABILITIES)
class Coarticulation(Method):
    """Key shapes of phones, blended by functions of time that were learned from recorded transitions (Deng 2006, §5.2).

    Parameters
    ----------
    components : float
        Principal components of the displacement from rest in which weights are found: a count, or a share of the variance.
    degree : int
        Of the polynomials.
    stiffness : float
        How strongly weights are drawn to straight lines, as a share of the samples' mean square.
    pull : float
        By how many frames the polynomials of a pair or triple of classes are drawn to those of all.
    triphones : int
        How often a triple of classes must have been recorded to have a model of its own; 0 uses diphones alone.
    shrink, context : float
        Of the key shapes, see `learn_keys`; a context of 0 is the dissertation's one shape for each phone.
    """

    rest: Tensor
    """[C] the pose from which key shapes are displacements."""
    basis: Tensor
    """[C, D] components of the displacement, orthonormal."""
    diphones: Tensor
    triphone_keys: Tensor
    triphones: Tensor
    """See `WeightModels`."""

    def __init__(
        self,
        components: float = 12,
        degree: int = 3,
        stiffness: float = 0.1,
        pull: float = 20.0,
        triphones: int = 20,
        shrink: float = 8.0,
        context: float = 10.0,
    ) -> None:
        super().__init__()
        if degree < 1 or min(stiffness, pull, triphones, shrink, context) < 0 or components <= 0:
            raise FacesynthError(
                "coarticulation wants a degree of 1 or more, positive components and no negative setting; got "
                + ", ".join(f"{name}={value:g}" for name, value in self.config.items())
            )
        for name in ("rest", "basis", *KEY_FIELDS, *MODEL_FIELDS):
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the neutral recordings, or from all where none is neutral; nothing is drawn from chance."""
        self.learned_from(corpus)
        chosen = usable(corpus, NEUTRAL) or list(corpus)
        rest, basis = displacement_basis(chosen, corpus, self.config["components"])
        tracks = [self._track(utterance, rest, basis) for utterance in chosen]
        samples = samples_of(tracks)
        if len(samples.phones) < 2:
            raise FacesynthError(f"no phone of {corpus.path} has complete motion; run `facesynth corpus check` on it")
        keys = learn_keys(samples, shrink=self.config["shrink"], context=self.config["context"])
        least = self.config["triphones"]
        models = learn_models(
            transitions_of(tracks, 2, self.config["stiffness"]),
            transitions_of(tracks if least else (), 3, self.config["stiffness"]),
            len(VISEME_CLASSES),
            degree=self.config["degree"],
            pull=self.config["pull"],
            least=least,
        )
        self.keep(rest, basis, keys, models)
        self.facts = {
            "closed_gap": closed_gap(chosen, corpus),
            "recordings": len(chosen),
            "phone_samples": len(samples.phones),
            "triphone_models": len(models.triphone_keys),
            "phones_without_sample": [PHONES[n] for n in range(len(PHONES)) if not (samples.phones == n).any()],
        }
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion from phones alone; the sound is not heard, emotions are not felt. Nothing is random."""
        self.refuse(options)
        return self.speaker().synthesize(speech)

    def speaker(self) -> Runtime:
        """The model that speaks: what an exported folder is, with this module's arrays for its graph."""
        layout, gap = self.fitted_layout, self.facts.get("closed_gap")
        return Runtime(
            Parts(
                layout=layout,
                fps=self.fps,
                emotions=self.emotions,
                keys=KeyShapes(**{name: as_doubles(_array(getattr(self, name))) for name in KEY_FIELDS}),
                models=weight_models({name: _array(getattr(self, name)) for name in MODEL_FIELDS}),
                closed_gap=np.inf if gap is None else float(gap),
                decode=self.decode_array,
            )
        )

    def decode_array(self, shapes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Displacements [..., T, D] to frames [..., T, C]."""
        frames = self.rest + torch.from_numpy(shapes).to(self.basis) @ self.basis.T
        return np.asarray(frames.cpu().numpy())

    def keep(self, rest: Floats, basis: Floats, keys: KeyShapes, models: WeightModels) -> None:
        """Take a rest pose [C], components [C, D], key shapes and polynomials for one's own."""
        arrays = {"rest": rest, "basis": basis}
        arrays |= {name: getattr(keys, name) for name in KEY_FIELDS} | {name: getattr(models, name) for name in MODEL_FIELDS}
        device = self.device
        for name, array in arrays.items():
            self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device))

    def _track(self, utterance: Utterance, rest: Floats, basis: Floats) -> Track:
        frames = (utterance.motion.frames.astype(np.float64) - rest) @ basis
        return track_of(frames, utterance.speech.phones, self.fps)


def displacement_basis(chosen: list[Utterance], corpus: Corpus, components: float) -> tuple[Floats, Floats]:
    """The layout's rest pose [C] (the mean pose where it states none) and the main directions [C, D] away from it.

    Second moments, not variances: a key shape is a multiple of directions from rest, not from a mean.
    """
    rest = np.array(corpus.layout.neutral) if corpus.layout.neutral is not None else mean_pose(corpus)
    moments, count = np.zeros((len(rest), len(rest))), 0
    for utterance in chosen:
        away = utterance.motion.frames[np.isfinite(utterance.motion.frames).all(axis=1)].astype(np.float64) - rest
        moments, count = moments + away.T @ away, count + len(away)
    if count < 2:
        raise FacesynthError(f"{corpus.path} has {count} frames without gaps; at least 2 are needed: fill or record more")
    sizes, directions = np.linalg.eigh(moments)
    sizes, directions = np.clip(sizes[::-1], 0, None), directions[:, ::-1]
    wanted = int(components) if components >= 1 else int(np.searchsorted(np.cumsum(sizes) / sizes.sum(), components) + 1)
    directions = directions[:, : min(wanted, len(rest))]
    return rest, directions * np.sign(directions[np.abs(directions).argmax(axis=0), np.arange(directions.shape[1])])


def closed_gap(chosen: list[Utterance], corpus: Corpus) -> float | None:
    """How near the lips come at p, b and m; None where the layout has no lips or none of these phones was recorded."""
    gaps = [
        gap
        for utterance in chosen
        for gap in narrowest_gaps(utterance.motion.frames, corpus.layout, bilabial_spans(utterance.speech.phones, corpus.fps))
    ]
    return float(np.median(gaps)) if gaps else None


def _array(buffer: Tensor) -> NDArray[Any]:
    return np.asarray(buffer.detach().cpu().numpy())
