"""Eyes as a method of the zoo."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.corpus.eyes import recorded_eyes
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import ANYWHERE, SHIFTS, Parts
from facesynth.inference.eyes import Eyes as Runtime
from facesynth.inference.motion import Motion
from facesynth.inference.patches import PatchSettings, PatchTexture
from facesynth.inference.shift_patches import EITHER, ROLES, ShiftTexture
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.capabilities import Account
from facesynth.methods.eyes.capabilities import CAPABILITIES
from facesynth.methods.eyes.lent_lids import with_lids
from facesynth.methods.eyes.patch_size import SHUT, patch_size
from facesynth.methods.eyes.recordings import at_rate, compensation_in, texture_of, whole_pieces
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.lids import Lids

AUTO = "auto"
"""In place of a number that is found in the recordings."""
LEAST_S = 10.0
"""Of recorded eyes that something can be grown from."""
LEAST_PIECE_S = 0.5
BETWEEN_S = 1.0
"""Eyes follow one recording at least so long between two joins at shifts."""
FEWEST_UNITS, HELD, HELD_BLINKING = 20, 0.5, 0.8
"""So many shifts with the rest after them, and so much of the recordings in them, are enough to join patches at shifts; more of
recordings with blinks, which are rarer where nothing shifts: what is left out would change their rate."""
UNSEEN = 0.6
"""Share of the head's quick turns that eyes undo where none of the recordings shows a head."""
FROZEN = 1e-3
"""Deviation of lids, and of gaze (rad), under which nothing moves."""


@register(CAPABILITIES)
class Eyes(Method):
    """Opening of the lids and gaze, synthesised together by patches of recordings (Deng 2006, ch. 3), for any head motion.

    Parameters
    ----------
    joins : "shifts", "anywhere" or "auto"
        Where patches are joined: where the gaze shifts, so that rests stay as long as recorded, or wherever they fit, as in
        the dissertation; auto: at shifts, where the recordings have enough of them.
    patch_s : float or "auto"
        Length of a patch, seconds. Auto: 1 s at least between joins at shifts; else where the cumulative curve of intervals
        between blinks and large saccades bends, but no longer than half of the longest recording.
    boundary : float
        Share of the patch that is its boundary zone (anywhere).
    tolerance : float
        epsilon of eq. 3.4: how unlike boundary zones of patches that follow each other may be (anywhere).
    compensation : float or "auto"
        Share of the head's quick turns that the eyes undo; auto: what the recorded eyes undo, 0.6 where no head was recorded.
    smoothed_s : float
        Over how long the recorded gaze was averaged, which is undone; 0: not at all.
    most_blinks : float or "auto"
        Of lent lids that blink more often a minute, blinks are left out by chance; auto: none is.
    """

    frames: Tensor
    """[F, 3] opening, gaze to the left and up (rad), held against the head."""
    starts: Tensor
    """[R] first frame of each piece."""
    roles: Tensor
    """[R] what the person did in each piece; see `shift_patches`."""

    def __init__(
        self,
        joins: str = AUTO,
        patch_s: float | str = AUTO,
        boundary: float = 0.2,
        tolerance: float = 0.2,
        compensation: float | str = AUTO,
        smoothed_s: float = 0.0,
        most_blinks: float | str = AUTO,
    ) -> None:
        super().__init__()
        numbers = {"patch_s": patch_s, "compensation": compensation, "most_blinks": most_blinks}
        wrong = [name for name, value in numbers.items() if value != AUTO and not (_is_number(value) and float(value) >= 0)]
        if wrong or not 0 < boundary < 1 or min(tolerance, smoothed_s) < 0:
            raise FacesynthError(
                "eyes wants patch_s, compensation and most_blinks of 0 or above or auto, a boundary between 0 and 1, and "
                "no negative tolerance or smoothed_s; got " + ", ".join(f"{name}={value}" for name, value in self.config.items())
            )
        if joins not in (SHIFTS, ANYWHERE, AUTO):
            raise FacesynthError(f"eyes wants joins {SHIFTS}, {ANYWHERE} or {AUTO}; got {joins!r}")
        self.register_buffer("frames", torch.zeros(0, 3))
        for name in ("starts", "roles"):
            self.register_buffer(name, torch.zeros(0, dtype=torch.int64))
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

    def learn(
        self,
        motions: Sequence[Motion],
        where: str,
        *,
        roles: Sequence[int] | None = None,
        lids: Sequence[Motion] | None = None,
        seed: int = 0,
    ) -> None:
        """Learn from motions of one rate with eyes; `where` they are from, for errors.

        roles: what the person does in each, see `shift_patches`; None: it is not known.

        FacesynthError where there are no eyes, less than 10 s of them, or nothing moves.
        """
        parts = [_pieces_of(motion) for motion in motions]
        pieces = _enough([piece for part in parts for piece in part], len(motions), where)
        done = np.repeat(np.full(len(motions), EITHER) if roles is None else np.asarray(roles), [len(part) for part in parts])
        shown, found = Lids.of(pieces), [_found(pieces, done, role) for role in ROLES]
        gains, smoothed_s = [self._gain(one) for one in found], float(self.config["smoothed_s"])
        held = [found[role] or 0.0 for role in done]
        textures = [texture_of(piece, shown, share, smoothed_s) for piece, share in zip(pieces, held, strict=True)]
        self.fps = pieces[0].fps
        if lids is not None:
            lent = _enough([piece for motion in lids for piece in _pieces_of(motion)], len(lids), "the lent lids")
            textures = with_lids(textures, [at_rate(piece, self.fps) for piece in lent], seed, self._most_blinks())
        if np.concatenate(textures).std(axis=0).max() < FROZEN:
            raise FacesynthError(f"the eyes of {where} are frozen: no lid and no gaze moves; take another corpus")
        self._keep(textures, done.astype(np.int64), where)
        self.facts |= {"compensation": gains, "compensation_found": found, "pieces": len(textures)}
        self.facts |= {"lids_shut": shown.shut, "lids_open": shown.opened}

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Eyes for a head that is still, and the head as far as their wide shifts turn it."""
        self.refuse(options)
        return self.runtime().synthesize(speech, seed=seed)

    def look(self, motion: Motion, *, seed: int = 0, phones: PhoneTrack | None = None, turning: float = 1.0) -> Motion:
        """The motion with eyes that go with its head, which wide shifts turn; they listen where nobody speaks for long."""
        return self.runtime().look(motion, seed=seed, phones=phones, turning=turning)

    def account(self, speech: Speech, *, seed: int = 0, **options: Any) -> Account:
        """How often nothing that was recorded fitted."""
        growth = self.runtime().grow(float(speech.phones.ends_s[-1]), seed, speech.phones)
        return Account({"patches": len(growth.places), "stuck": growth.stuck, "continued": growth.continued})

    def runtime(self) -> Runtime:
        """The model that moves eyes: what an exported folder is."""
        layout = self.fitted_layout
        if self._runtime is None:
            settings = PatchSettings(*(self.facts[name] for name in ("patch", "boundary", "tolerance")))
            frames, starts, roles = (tensor.detach().cpu().numpy() for tensor in (self.frames, self.starts, self.roles))
            joins, gains = str(self.facts["joins"]), np.asarray(self.facts["compensation"], np.float64)
            self._runtime = Runtime(Parts(layout, self.fps, self.emotions, frames, starts, roles, joins, settings, gains))
        return self._runtime

    def _gain(self, found: float | None) -> float:
        """What is undone of a head, given what the recordings show of it."""
        given = self.config["compensation"]
        return (UNSEEN if found is None else found) if given == AUTO else float(given)

    def _most_blinks(self) -> float | None:
        most = self.config["most_blinks"]
        return None if most == AUTO else float(most)

    def _sizes(self, textures: list[Floats], joins: str, where: str) -> tuple[int, int]:
        """Patch and boundary, frames."""
        longest = max(map(len, textures))
        found, given = patch_size(textures, self.fps), self.config["patch_s"]
        if given != AUTO:
            patch = round(float(given) * self.fps)
        elif joins == SHIFTS:
            patch = round(BETWEEN_S * self.fps)
        elif found is None:
            raise FacesynthError(f"{where} has no two blinks or large shifts of gaze in a row; record more, or give patch_s")
        else:
            patch = min(found.frames, longest // 2)
        patch = max(patch, 3)
        self.facts["covered"] = None if found is None else round(found.covered(patch), 4)
        return patch, min(max(1, round(float(self.config["boundary"]) * patch)), patch - 1)

    def _keep(self, textures: list[Floats], roles: NDArray[np.int64], where: str) -> None:
        starts, frames = np.cumsum([0, *map(len, textures)])[:-1], np.concatenate(textures)
        joins = self._joins(ShiftTexture(frames, starts, roles, self.fps, 1), where)
        settings = PatchSettings(*self._sizes(textures, joins, where), float(self.config["tolerance"]))
        if joins == ANYWHERE:
            PatchTexture(frames, starts, settings)  # refuses a patch that no recording holds
        arrays = {"frames": frames.astype(np.float32), "starts": starts, "roles": roles}
        device = self.device
        for name, array in arrays.items():
            setattr(self, name, torch.from_numpy(array).to(device))
        self._runtime = None
        self.facts |= {"joins": joins, "patch": settings.patch, "boundary": settings.boundary, "tolerance": settings.tolerance}

    def _joins(self, texture: ShiftTexture, where: str) -> str:
        """Where patches are to be joined."""
        asked, count = str(self.config["joins"]), len(texture.units.first)
        if asked == SHIFTS and not count:
            raise FacesynthError(f"no gaze in {where} shifts twice in a recording; record more, or take joins={ANYWHERE}")
        blinks = bool((texture.frames[:, 0] < SHUT).any())
        enough = count >= FEWEST_UNITS and texture.held >= (HELD_BLINKING if blinks else HELD)
        return asked if asked != AUTO else SHIFTS if enough else ANYWHERE


def _found(pieces: Sequence[Motion], done: NDArray[np.int64], role: int) -> float | None:
    """Share of the head's turns that eyes undo in recordings of a role, of all where none is; None where none shows a head."""
    mine = [piece for piece, one in zip(pieces, done, strict=True) if one == role] or pieces
    return compensation_in(mine) if any(piece.head is not None for piece in mine) else None


def _pieces_of(motion: Motion) -> list[Motion]:
    return whole_pieces(motion, LEAST_PIECE_S)


def _enough(pieces: list[Motion], motions: int, where: str) -> list[Motion]:
    """The pieces, if there are enough."""
    if not motions:
        raise FacesynthError(f"{where} has no recording with eyes (gaze and lids); capture them from video, or add them")
    seconds = sum(piece.duration_s for piece in pieces)
    if seconds < LEAST_S:
        raise FacesynthError(f"{where} has {seconds:.1f} s of eyes without gaps; at least {LEAST_S:g} s are needed: record more")
    return pieces


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
