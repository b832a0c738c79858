"""The linear dynamical system as a method of the zoo."""

from typing import Any, Literal, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Ints
from facesynth.inference.closures import closing_direction
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.lds import HeardLdsStream, Lds, LdsSettings, LdsStream
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.inference.speech_state import STATES
from facesynth.methods.lds.capabilities import CAPABILITIES
from facesynth.methods.lds.heard_input import HeardRegression
from facesynth.methods.lds.identification import REFITS, fitting_rows, identify
from facesynth.methods.lds.innovations import Innovations, innovations_of
from facesynth.methods.lds.learned_input import learned_input
from facesynth.methods.lds.noise_amounts import noise_amounts, noise_gains
from facesynth.methods.lds.recordings import Piece, Standardised, periodograms, pieces_of
from facesynth.methods.lds.rollout import Rollout
from facesynth.methods.lds.selection import Auto, choose_lead, choose_orders, plain
from facesynth.methods.lds.system import Array, Clip, LinearSystem
from facesynth.methods.learn.hearing import WIDTHS
from facesynth.methods.method import Method
from facesynth.methods.parts import part
from facesynth.methods.registry import register
from facesynth.speech.periodogram import RATE, Periodogram, Scale

FITTED_TO = ("runs", "steps")
PERIODOGRAM = "periodogram"
Hears = Literal["periodogram", "log_mel", "phone_net", "both"]
SETTLING_S = 4.0
"""How long the noise runs before the first frame, so that it starts as it goes on."""


@register(CAPABILITIES)
class LDS(Method):
    """Speech-driven linear dynamical system with non-Gaussian noise (Saisan 2004).

    Parameters
    ----------
    hears : "periodogram", "log_mel", "phone_net" or "both"
        What the input is learned from: the periodogram of the sound around a frame, or log-mel bands, a layer of the network
        that hears phones, or both; `scale`, `context_ms`, `features` and `lead_ms` are of the periodogram.
    scale : "log" or "linear"
        Of the periodogram; the paper's is linear.
    context_ms : float
        How much sound before and after a frame a regression learns the input from; 0: the input is the principal components
        of the frame's own periodogram, as in the paper.
    features : float
        Principal components of the periodogram: a count, or below 1 a share of variance. The paper has 4.
    lead_ms : float or "auto"
        How far the sound is looked ahead, ms; chosen by the error on clips left out.
    components : float
        Principal components of the shape: a count, or below 1 a share of variance.
    rows : int
        Block rows k: frames of past and of future that are compared. Lowered where the recording is short.
    deterministic_order, stochastic_order : int or "auto"
        States of the two parts; chosen by the error on clips left out.
    fitted_to : "runs" or "steps"
        What the deterministic part is fitted to: the recordings as the sound alone leads through them, which is what is
        synthesised, or each next frame (the paper), which is best if motion really is such a system.
    own_means : bool
        Whether each clip's own mean is taken out of sound and shape before the dynamics are learned: how the head was held
        that time, or which mood it was, is not in the sound, and would be taken for slow states. The paper has one clip.
    noise_by_state : bool
        Whether there is less noise where less was left unexplained, none in closures, and only as much that a sample is nearer
        than the mean face; without, all that was left, everywhere, as in the paper.
    close_lips : bool
        Whether lips are shut at each p, b and m as far as they were in the recordings, where phones are given.
    """

    features: Standardised
    shape: Standardised
    rollout: Rollout
    innovations: Innovations

    def __init__(
        self,
        *,
        hears: Hears = "both",
        scale: Scale = "log",
        context_ms: float = 200.0,
        features: float = 24,
        lead_ms: float | Auto = "auto",
        components: float = 8,
        rows: int = 8,
        deterministic_order: int | Auto = "auto",
        stochastic_order: int | Auto = "auto",
        fitted_to: Literal["runs", "steps"] = "runs",
        own_means: bool = True,
        noise_by_state: bool = True,
        close_lips: bool = True,
    ) -> None:
        super().__init__()
        _check(self.config)
        self.features, self.shape = Standardised.empty(), Standardised.empty()
        self.rollout, self.innovations = Rollout.empty(), Innovations.empty()
        self.heard = None if hears == "periodogram" else HeardRegression(hears)

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from a corpus of any layout; `facts` holds what was chosen, the errors and the poles."""
        device = self.device
        self.learned_from(corpus)
        pieces, left_out = pieces_of(corpus)
        self.shape = Standardised.fit([piece.frames for piece in pieces], self.config["components"], "the motion")
        weights = self.shape.scale.double().square().numpy()
        sentences = [piece.sentence for piece in pieces]

        # A context has the sound before and after a frame in it: it needs no lead.
        around = self.config["context_ms"] or self.heard is not None
        wanted_ms = 0.0 if around and self.config["lead_ms"] == "auto" else self.config["lead_ms"]
        lead = choose_lead(wanted_ms, lambda lead_ms: self._clips(pieces, lead_ms), sentences, self.config["rows"], weights)
        clips = self._clips(pieces, lead.chosen)
        rows = fitting_rows(clips, self.config["rows"])
        wanted = self.config["deterministic_order"], self.config["stochastic_order"]
        orders = choose_orders(wanted, clips, sentences, rows, weights)
        refits = 0 if self.config["fitted_to"] == "runs" else REFITS
        system = identify(clips, rows, (int(orders[0].chosen), int(orders[1].chosen)), refits)

        self._keep(system, clips, rows, seed)
        if self.config["noise_by_state"]:
            self._learn_amounts(system.stochastic_output(tuple(clips)), clips, [piece.states for piece in pieces], weights)
        gaps = [gap for piece in pieces for gap in piece.gaps]
        if self.config["close_lips"] and gaps:
            self.facts["closed_gap"] = float(np.median(gaps))
            direction = closing_direction(np.concatenate([_centred(piece.frames) for piece in pieces]), self.fitted_layout)
            self.facts["closing"] = None if direction is None else direction.tolist()
        self.facts |= {
            "context_ms": float(self.config["context_ms"]),
            "frames_left_out_for_gaps": left_out,
            "rows": rows,
            "lead_ms": plain(lead),
            "deterministic_order": plain(orders[0]),
            "stochastic_order": plain(orders[1]),
            "no_change_error": orders[2],
        }
        return self.to(device)

    def _learn_amounts(self, left: list[Array], clips: list[Clip], states: list[Ints], weights: Array) -> None:
        amounts = noise_amounts(left, states, weights)
        gains = noise_gains([clip.y for clip in clips], left, states, amounts)
        self.rollout.gains = torch.from_numpy(gains).float()
        self.facts |= {"noise_amounts": amounts, "noise_gains": gains.tolist()}

    def synthesize(self, speech: Speech, *, seed: int = 0, noise: float = 1.0, **options: Any) -> Motion:
        """Motion for new speech, driven by its sound alone; `noise` 1 as learned, 0 for the deterministic part alone.

        Where phones are given they say how much noise there is (`noise_by_state`) and where lips are shut (`close_lips`).
        """
        return self.speaker().synthesize(speech, seed=seed, noise=noise, **options)

    def stream(self, *, seed: int = 0, noise: float = 1.0, sample_rate: int | None = None) -> LdsStream | HeardLdsStream:
        """Sound in pieces of any size, frames as soon as they are final; `sample_rate` must be that of the periodogram."""
        return self.speaker().stream(seed=seed, noise=noise, sample_rate=sample_rate)

    def speaker(self) -> Lds:
        """The model that speaks: what an exported folder is, with these modules for its graphs."""
        layout, device, settings = self.fitted_layout, self.rollout.A.device, self.settings
        return Lds(
            layout,
            self.emotions,
            settings.windows(self.fps, RATE),
            settings,
            features=part(self.features_of, device),
            innovations=part(lambda uniform: (self.innovations(uniform),), device),
            rollout=part(self.frames_of, device),
            heard=None if self.listener is None else self.listener.input(self.fps),
        )

    @property
    def settings(self) -> LdsSettings:
        """Sizes and times of the trained system."""
        components, states = len(self.shape.scale), len(self.rollout.A)
        features = len(self.features.scale if self.listener is None else self.listener.bias)
        periodogram, amounts = self.periodogram, self.facts.get("noise_amounts", dict.fromkeys(STATES, 1.0))
        gap, along = self.facts.get("closed_gap"), self.facts.get("closing")
        closing = None if along is None else tuple(along)
        return LdsSettings(
            periodogram.length, periodogram.lead_ms, SETTLING_S, features, components, states, amounts, gap, closing
        )

    @property
    def listener(self) -> HeardRegression | None:
        """What it hears with in place of a periodogram; models from before there was a choice have learned none."""
        return self.heard if self.heard is not None and self.heard.bias.numel() else None

    @property
    def periodogram(self) -> Periodogram:
        """How the sound is heard, with the lead that was chosen."""
        # Models from before there was a context state none.
        context_ms = self.facts.get("context_ms", 0.0)
        periodogram = Periodogram(self.fps, self.config["scale"], self.facts["lead_ms"]["chosen"], context_ms)
        return periodogram.to(self.features.scale.device)

    def features_of(self, windows: Tensor) -> tuple[Tensor, Tensor]:
        """Windows of sound [..., T, L] to the periodogram [..., T, S 256] and the system's input [..., T, m]."""
        power = self.periodogram.spectrum(windows)
        return power, self.features.encode(power)

    def frames_of(self, features: Tensor, innovations: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Features [..., T, m], innovations [..., T, p] and a state [..., n] to frames [..., T, C] and the state after them."""
        shape, after = self.rollout(features, innovations, state)
        frames = self.shape.decode(shape)
        return (frames.clamp(0, 1) if self.fitted_layout.kind == "curves" else frames), after

    def encode(self, speech: Speech, count: int) -> Tensor:
        """The system's input [count, m] for an utterance."""
        if self.listener is not None:
            return torch.from_numpy(self.listener.input(self.fps).at(self.listener.hearing.bands(speech), 0, count))
        return self.features.encode(self.periodogram.of(speech, count))

    def _clips(self, pieces: list[Piece], lead_ms: float) -> list[Clip]:
        shapes = [_encoded(self.shape, piece.frames) for piece in pieces]
        inputs = self._inputs(pieces, shapes, lead_ms) if self.heard is None else self.heard.learn(pieces, shapes, self.fps)
        clips = [Clip(u, y) for u, y in zip(inputs, shapes, strict=True)]
        return [clip.centred() for clip in clips] if self.config["own_means"] else clips

    def _inputs(self, pieces: list[Piece], shapes: list[Array], lead_ms: float) -> list[Array]:
        """[T, m] of each piece, from its periodogram."""
        periodogram = Periodogram(self.fps, self.config["scale"], lead_ms, self.config["context_ms"])
        if periodogram.around:
            self.features, inputs = learned_input(pieces, shapes, periodogram, self.config["features"])
            return inputs
        sounds = periodograms(pieces, periodogram)
        self.features = Standardised.fit(sounds, self.config["features"], "the sound")
        return [_encoded(self.features, sound) for sound in sounds]

    def _keep(self, system: LinearSystem, clips: list[Clip], rows: int, seed: int) -> None:
        rest = system.stochastic_output(tuple(clips))
        self.innovations = Innovations.fit(innovations_of(rest, system.stochastic, rows), seed=seed)
        self.rollout = Rollout.of(system.deterministic, system.stochastic)
        self.facts = {
            "poles": system.poles(),
            "repaired": list(system.repaired),
            "singular_values": system.singular_values.tolist(),
            "canonical_correlations": system.correlations.tolist(),
            "innovations_independent": self.innovations.independent,
            "kurtosis": self.innovations.kurtosis.tolist(),
        }


def _encoded(part: Standardised, frames: np.ndarray) -> Array:
    return part.encode(torch.from_numpy(frames)).double().numpy()


def _centred(frames: np.ndarray) -> Array:
    return frames.astype(np.float64) - frames.mean(axis=0)


def _check(config: dict[str, Any]) -> None:
    Periodogram(25.0, config["scale"], 0.0, config["context_ms"])
    for name in ("rows", "deterministic_order", "stochastic_order"):
        value, automatic = config[name], name != "rows"
        if not (automatic and value == "auto") and not (isinstance(value, int) and value >= 1):
            raise FacesynthError(f"{name} must be a whole number from 1{' or auto' if automatic else ''}; got {value!r}")
    if config["hears"] not in (PERIODOGRAM, *WIDTHS):
        raise unknown("what is heard", config["hears"], (PERIODOGRAM, *WIDTHS))
    if config["fitted_to"] not in FITTED_TO:
        raise unknown("fitted_to", config["fitted_to"], FITTED_TO)
    if config["lead_ms"] != "auto" and not isinstance(config["lead_ms"], int | float):
        raise FacesynthError(f"lead_ms must be a number of milliseconds or auto; got {config['lead_ms']!r}")
