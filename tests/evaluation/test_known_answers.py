"""Every metric on motions of which the answer is known: itself, moved aside, late, twice as large, noisy."""

import numpy as np
import pytest
from talking_points import FPS, LAYOUT, moved, phones, talk

from facesynth.errors import FacesynthError
from facesynth.evaluation.lips import closure_threshold
from facesynth.evaluation.metrics import METRICS, Case, metric
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion

TRACK = phones(("pau", 0.2), *[(label, 0.4 + 0.2 * i) for i, label in enumerate(["m", "aa", "b", "ay", "p", "ah"] * 3)])
NOISE = 0.5
SHIFT_S = 0.05


def with_head(motion, turn=0.0):
    head = np.zeros((len(motion), 6))
    head[:, 0] = 0.1 * np.sin(np.arange(len(motion)) / 9) + turn
    head[:, 1] = 0.05 * np.cos(np.arange(len(motion)) / 7)
    return Motion(motion.frames, motion.fps, motion.layout, head)


def truth():
    return with_head(talk())


def offset():
    points = truth().points + np.array([3.0, 4.0, 0.0])
    return moved(truth(), points.reshape(len(points), -1))


def late():
    return with_head(talk(delay_s=SHIFT_S))


def doubled():
    frames = truth().frames.astype(float)
    return moved(truth(), frames.mean(axis=0) + 2 * (frames - frames.mean(axis=0)))


def noisy():
    frames = truth().frames
    return moved(truth(), frames + NOISE * np.random.default_rng(0).normal(size=frames.shape))


def value(name, motion):
    threshold = closure_threshold([(truth(), TRACK)])
    return metric(name).measure(Case(motion, truth(), TRACK, threshold))


SIDE = np.ptp(truth().points.reshape(-1, 3), axis=0).max()
ITSELF = {one.name: {"low": 0.0, "0": 0.0, "1": 1.0, "high": 1.0}[one.best] for one in METRICS}
DEVIATION = np.linalg.norm(truth().points[:, :4] - np.array(LAYOUT.neutral).reshape(-1, 3)[:4], axis=2).std(axis=0).mean()
"""Mean over the upper face of the standard deviation of the distance from rest: what fdd compares."""
ANSWERS = [
    *[(truth, name, answer, 1e-6) for name, answer in ITSELF.items() if name not in ("closure_rate", "false_closure_rate")],
    *[(offset, name, 5.0, 1e-5) for name in ("marker_error", "lve")],
    *[(offset, name, 25.0, 1e-4) for name in ("deng_error", "lve_sq")],
    *[(offset, name, 0.0, 1e-4) for name in ("marker_error_centred", "lve_centred", "lip_lag", "lip_extrema_lag")],
    *[(offset, name, 1.0, 1e-3) for name in ("lip_gap_corr", "lip_gap_ccc", "energy_ratio", "jerk_ratio")],
    (offset, "velocity_error", 0.0, 1e-2),
    (offset, "unit_cube_rms", 5 / np.sqrt(3) / (SIDE + 4), 1e-5),
    (late, "lip_lag", 1000 * SHIFT_S, 2.0),
    (late, "lip_extrema_lag", 1000 * SHIFT_S, 8.0),
    (late, "energy_ratio", 1.0, 0.02),
    (doubled, "energy_ratio", 2.0, 1e-3),
    (doubled, "jerk_ratio", 4.0, 1e-2),
    (doubled, "lip_gap_corr", 1.0, 1e-4),
    (doubled, "lip_gap_ccc", 0.8, 1e-3),
    (doubled, "lip_lag", 0.0, 1e-3),
    (doubled, "fdd", -DEVIATION, 0.02),
    (doubled, "fdd_abs", DEVIATION, 0.02),
    (noisy, "deng_error", 3 * NOISE**2, 0.02),
    (noisy, "marker_error", NOISE * np.sqrt(8 / np.pi), 0.01),
    (noisy, "marker_error_centred", NOISE * np.sqrt(8 / np.pi), 0.01),
    (noisy, "velocity_error", np.sqrt(2) * NOISE * np.sqrt(8 / np.pi) * FPS, 1.0),
]


@pytest.mark.parametrize(("motion", "name", "answer", "within"), ANSWERS)
def test_the_answer_is_known(motion, name, answer, within):
    assert value(name, motion()) == pytest.approx(answer, abs=within)


def test_closure_of_the_truth_itself_is_nine_tenths():
    assert value("closure_rate", truth()) >= 0.9


def test_a_turned_head_is_so_many_degrees_off():
    assert value("head_distance", with_head(talk(), turn=np.radians(5))) == pytest.approx(5, abs=0.1)
    assert value("head_cca", with_head(talk(), turn=np.radians(5))) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("one", METRICS, ids=lambda one: one.name)
def test_every_metric_refuses_another_rate_length_and_layout(one):
    """The two closure rates look at the synthesised motion and its phones alone; too short a motion is refused there."""
    other = Layout(LAYOUT.kind, tuple(reversed(LAYOUT.names)), LAYOUT.groups, LAYOUT.lip_pairs, LAYOUT.neutral)
    faults = [Motion(truth().frames[:-60], FPS, LAYOUT, truth().head[:-60])]
    if not one.name.endswith("closure_rate"):
        faults += [
            Motion(truth().frames[:-1], FPS, LAYOUT, truth().head[:-1]),
            Motion(truth().frames, FPS / 2, LAYOUT, truth().head),
            Motion(truth().frames, FPS, other, truth().head),
        ]
    for fault in faults:
        with pytest.raises(FacesynthError):
            one.measure(Case(fault, truth(), TRACK, 1.0))


def test_every_metric_says_what_it_is():
    assert all(one.definition and one.unit and one.best for one in METRICS)
    assert {"lve", "lve_sq", "fdd", "fdd_abs", "closure_rate", "false_closure_rate", "lve_centred"} <= {m.name for m in METRICS}
