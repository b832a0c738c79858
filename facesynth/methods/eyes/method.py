"""Eyes as a method of the zoo."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.corpus.eyes import recorded_eyes
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import Eyes as Runtime
from facesynth.inference.eyes import Parts
from facesynth.inference.motion import Motion
from facesynth.inference.patches import PatchSettings, PatchTexture
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Account
from facesynth.methods.eyes.capabilities import CAPABILITIES
from facesynth.methods.eyes.patch_size import patch_size
from facesynth.methods.eyes.recordings import at_rate, compensation_in, texture_of, whole_pieces
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.lids import opening_of, shut_level

AUTO = "auto"
"""In place of a number that is found in the recordings."""
LEAST_S = 10.0
"""Of recorded eyes that something can be grown from."""
LEAST_PIECE_S = 0.5
FROZEN = 1e-3
"""Deviation of lids, and of gaze (rad), under which nothing moves."""


@register(CAPABILITIES)
class Eyes(Method):
    """Opening of the lids and gaze, synthesised together by patches of recordings (Deng 2006, ch. 3), for any head motion.

    Parameters
    ----------
    patch_s : float or "auto"
        Length of a patch, seconds; auto: where the cumulative curve of intervals between blinks and large saccades bends,
        but no longer than half of the longest recording.
    boundary : float
        Share of the patch that is its boundary zone.
    tolerance : float
        epsilon of eq. 3.4: how unlike boundary zones of patches that follow each other may be.
    compensation : float or "auto"
        Share of the head's quick turns that the eyes undo; auto: what the recorded eyes undo.
    smoothed_s : float
        Over how long the recorded gaze was averaged, which is undone; 0: not at all.
    """

    frames: Tensor
    """[F, 3] opening, gaze to the left and up (rad), held against the head."""
    starts: Tensor
    """[R] first frame of each piece."""

    def __init__(
        self,
        patch_s: float | str = AUTO,
        boundary: float = 0.2,
        tolerance: float = 0.2,
        compensation: float | str = AUTO,
        smoothed_s: float = 0.0,
    ) -> None:
        super().__init__()
        numbers = {"patch_s": patch_s, "compensation": compensation}
        wrong = [name for name, value in numbers.items() if value != AUTO and not (_is_number(value) and float(value) >= 0)]
        if wrong or not 0 < boundary < 1 or min(tolerance, smoothed_s) < 0:
            raise FacesynthError(
                "eyes wants patch_s and compensation of 0 or above or auto, a boundary between 0 and 1, and no negative "
                "tolerance or smoothed_s; got " + ", ".join(f"{name}={value}" for name, value in self.config.items())
            )
        self.register_buffer("frames", torch.zeros(0, 3))
        self.register_buffer("starts", torch.zeros(0, dtype=torch.int64))
        self._runtime: Runtime | None = None

    def fit(self, corpus: Corpus, *, seed: int = 0, lids: Corpus | None = None) -> Self:
        """Learn from every recording with eyes, with or without sound.

        lids: another corpus that lends its lids, where the eyes of this one were recorded without.
        """
        self.learned_from(corpus, silent=True)
        lent = None if lids is None else [motion for motion, _ in recorded_eyes(lids)]
        self.learn([motion for motion, _ in recorded_eyes(corpus)], str(corpus.path), lids=lent, seed=seed)
        if lids is not None:
            self.provenance["lids"] = lids.provenance()
        return self.eval()

    def learn(self, motions: Sequence[Motion], where: str, *, lids: Sequence[Motion] | None = None, seed: int = 0) -> None:
        """Learn from motions of one rate with eyes; `where` they are from, for errors.

        FacesynthError where there are no eyes, less than 10 s of them, or nothing moves.
        """
        pieces = _pieces(motions, where)
        gain, found = self._gain(pieces), compensation_in(pieces)
        shut, smoothed_s = shut_level(pieces), float(self.config["smoothed_s"])
        textures = [texture_of(piece, shut, found, smoothed_s) for piece in pieces]
        self.fps = pieces[0].fps
        if lids is not None:
            textures = _with_lids(textures, [at_rate(piece, self.fps) for piece in _pieces(lids, "the lent lids")], seed)
        if np.concatenate(textures).std(axis=0).max() < FROZEN:
            raise FacesynthError(f"the eyes of {where} are frozen: no lid and no gaze moves; take another corpus")
        self._keep(textures, PatchSettings(*self._sizes(textures, where), float(self.config["tolerance"])))
        self.facts |= {"compensation": gain, "compensation_found": found, "shut_level": shut, "pieces": len(textures)}

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Eyes for a head that is still, and the head as far as their wide shifts turn it; nothing that is said is heard."""
        self.refuse(options)
        return self.runtime().synthesize(speech, seed=seed)

    def look(self, motion: Motion, *, seed: int = 0) -> Motion:
        """The motion with eyes that go with its head, which wide shifts turn."""
        return self.runtime().look(motion, seed=seed)

    def account(self, speech: Speech, *, seed: int = 0, **options: Any) -> Account:
        """How often nothing that was recorded fitted."""
        growth = self.runtime().grow(float(speech.phones.ends_s[-1]), seed)
        return Account({"patches": len(growth.places), "stuck": growth.stuck, "continued": growth.continued})

    def runtime(self) -> Runtime:
        """The model that moves eyes: what an exported folder is."""
        layout = self.fitted_layout
        if self._runtime is None:
            settings = PatchSettings(*(self.facts[name] for name in ("patch", "boundary", "tolerance")))
            frames, starts = (tensor.detach().cpu().numpy() for tensor in (self.frames, self.starts))
            gain = float(self.facts["compensation"])
            self._runtime = Runtime(Parts(layout, self.fps, self.emotions, frames, starts, settings, gain))
        return self._runtime

    def _gain(self, pieces: Sequence[Motion]) -> float:
        given = self.config["compensation"]
        return compensation_in(pieces) if given == AUTO else float(given)

    def _sizes(self, textures: list[Floats], where: str) -> tuple[int, int]:
        """Patch and boundary, frames."""
        longest = max(map(len, textures))
        found, given = patch_size(textures, self.fps), self.config["patch_s"]
        if found is None and given == AUTO:
            raise FacesynthError(f"{where} has no two blinks or large shifts of gaze in a row; record more, or give patch_s")
        patch = min(found.frames, longest // 2) if found is not None and given == AUTO else round(float(given) * self.fps)
        patch = max(patch, 3)
        self.facts["covered"] = None if found is None else round(found.covered(patch), 4)
        return patch, min(max(1, round(float(self.config["boundary"]) * patch)), patch - 1)

    def _keep(self, textures: list[Floats], settings: PatchSettings) -> None:
        starts = np.cumsum([0, *map(len, textures)])[:-1]
        frames = np.concatenate(textures)
        PatchTexture(frames, starts, settings)  # refuses a patch that no recording holds
        self.frames, self.starts = (torch.from_numpy(array).to(self.device) for array in (frames.astype(np.float32), starts))
        self._runtime = None
        self.facts |= {"patch": settings.patch, "boundary": settings.boundary, "tolerance": settings.tolerance}


def _pieces(motions: Sequence[Motion], where: str) -> list[Motion]:
    if not motions:
        raise FacesynthError(f"{where} has no recording with eyes (gaze and lids); capture them from video, or add them")
    pieces = [piece for motion in motions for piece in whole_pieces(motion, LEAST_PIECE_S)]
    seconds = sum(piece.duration_s for piece in pieces)
    if seconds < LEAST_S:
        raise FacesynthError(f"{where} has {seconds:.1f} s of eyes without gaps; at least {LEAST_S:g} s are needed: record more")
    return pieces


def _with_lids(textures: list[Floats], lent: list[Motion], seed: int) -> list[Floats]:
    """Textures with lids that are grown from somebody else's; whether blinks go with shifts of gaze is lost."""
    shut = shut_level(lent)
    own = [opening_of(piece, shut) for piece in lent]
    size = patch_size([np.pad(lids, ((0, 0), (0, 2))) for lids in own], lent[0].fps)
    patch = max(3, min(size.frames if size else round(lent[0].fps), max(map(len, own)) // 2))
    settings = PatchSettings(patch, max(1, patch // 5), 0.2)
    texture = PatchTexture(np.concatenate(own), np.cumsum([0, *map(len, own)])[:-1], settings)
    rng = np.random.default_rng([seed, 4])
    return [np.concatenate([texture.grow(len(one), rng).frames, one[:, 1:]], axis=1) for one in textures]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
