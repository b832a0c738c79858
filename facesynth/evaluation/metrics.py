"""The metrics by name: what each is measured in, which way is better, and the function that defines it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from facesynth.evaluation import dynamics, geometry, head, lips, timing, variety
from facesynth.evaluation.part_statistics import PART_DEFINITIONS
from facesynth.inference.errors import unknown
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.capabilities import Part


@dataclass(frozen=True)
class Case:
    """One utterance to judge."""

    synthesised: Motion
    truth: Motion
    phones: PhoneTrack
    closure_threshold: float
    """Opening that counts as shut, unit of the layout; NaN where the recordings have no p, b or m."""


@dataclass(frozen=True)
class Metric:
    """One figure of an utterance."""

    name: str
    unit: str
    """`u` stands for the unit of the layout: mm, px or weight."""
    best: Literal["low", "high", "0", "1"]
    """Which way is better, or the value that is best."""
    measure: Callable[[Case], float]
    """Raises UnavailableError where it has no value; its module's function of the same name is the definition."""
    definition: str = ""
    """What that function's docstring says."""
    part: Part = "mouth"
    """Of the face: whoever moves another part has no such figure."""

    def unit_in(self, layout_unit: str) -> str:
        """The unit with the layout's own in the place of `u`."""
        return self.unit.replace("u", layout_unit) if self.unit.startswith("u") else self.unit


def _of_pair(name: str, unit: str, best: Literal["low", "high", "0", "1"], function: Callable[[Motion, Motion], float]) -> Metric:
    part: Part = "head" if function.__module__ == head.__name__ else "mouth"
    return Metric(name, unit, best, lambda case: function(case.synthesised, case.truth), function.__doc__ or "", part)


METRICS: tuple[Metric, ...] = (
    _of_pair("marker_error", "u", "low", geometry.marker_error),
    _of_pair("marker_error_centred", "u", "low", geometry.marker_error_centred),
    _of_pair("deng_error", "u²", "low", geometry.deng_error),
    _of_pair("unit_cube_rms", "1", "low", geometry.unit_cube_rms),
    _of_pair("lve", "u", "low", geometry.lve),
    _of_pair("lve_sq", "u²", "low", geometry.lve_sq),
    _of_pair("lve_centred", "u", "low", geometry.lve_centred),
    _of_pair("fdd", "u", "0", dynamics.fdd),
    _of_pair("fdd_abs", "u", "low", dynamics.fdd_abs),
    _of_pair("velocity_error", "u/s", "low", dynamics.velocity_error),
    _of_pair("lip_gap_corr", "1", "high", lips.lip_gap_corr),
    _of_pair("lip_gap_ccc", "1", "high", lips.lip_gap_ccc),
    Metric(
        "closure_rate",
        "1",
        "high",
        lambda case: lips.closure_rate(case.synthesised, case.phones, case.closure_threshold),
        lips.closure_rate.__doc__ or "",
    ),
    Metric(
        "false_closure_rate",
        "1",
        "low",
        lambda case: lips.false_closure_rate(case.synthesised, case.phones, case.closure_threshold),
        lips.false_closure_rate.__doc__ or "",
    ),
    _of_pair("lip_lag", "ms", "0", timing.lip_lag),
    _of_pair("lip_extrema_lag", "ms", "low", timing.lip_extrema_lag),
    _of_pair("jerk_ratio", "1", "1", dynamics.jerk_ratio),
    _of_pair("energy_ratio", "1", "1", dynamics.energy_ratio),
    _of_pair("head_cca", "1", "high", head.head_cca),
    _of_pair("head_distance", "deg", "low", head.head_distance),
)
"""What is measured for every utterance of every method, in the order of the tables."""

_OTHERS = (variety.diversity, variety.error_of_mean, variety.error_of_best, dynamics.join_jump)
DEFINITIONS: Mapping[str, str] = {
    name: " ".join(text.split())
    for name, text in (
        *((one.name, one.definition) for one in METRICS),
        *PART_DEFINITIONS.items(),
        *((function.__name__, function.__doc__ or "") for function in _OTHERS),
        (
            "emotion_accuracy",
            "Share of utterances whose emotion is recognised by a classifier that saw other sentences recorded.",
        ),
        (
            "sync_rate",
            "Share of utterances that go with their sound best unshifted, of shifts up to 0.2 s either way, for a network that "
            "learned from recordings of other sentences what is in step.",
        ),
        ("sync_offset", "How late (ms) the lips go best with their sound, for that network."),
        (
            "two_sample",
            "Balanced accuracy of a classifier that tells synthesised from recorded lips, by stretches of 0.3 s, and that "
            "learned from other utterances: 0.5 it guesses, 1 it tells them at a glance.",
        ),
        ("other_phones", "Share of phones that were taken from a recording of another phone."),
        ("other_visemes", "Share of phones that were taken from another viseme class."),
        ("other_emotions", "Share of phones that were taken from another emotion."),
        ("train_s", "Seconds of training by the clock, mean of the folds."),
        ("train_cpu_s", "Seconds of training of the processor, one thread, mean of the folds."),
        ("train_minutes", "Minutes of recordings that were learned from, mean of the folds."),
        ("rtf", "Seconds of synthesis by the clock for a second of speech; the model is loaded and warm."),
        ("rtf_cpu", "Seconds of synthesis of the processor, one thread, for a second of speech."),
        (
            "peak_mb",
            "Largest memory (1e6 bytes) of a process that loads the model and speaks the first fold's longest utterance.",
        ),
        ("model_mb", "Size of the model file (1e6 bytes), mean of the folds."),
    )
}
"""What every column of a comparison means."""


def metric(name: str) -> Metric:
    """The metric of this name; FacesynthError with the nearest names where there is none."""
    for one in METRICS:
        if one.name == name:
            return one
    raise unknown("metric", name, (one.name for one in METRICS))
