"""Every metric on motions of which the answer is known: itself, moved aside, late, twice as large, noisy."""

import numpy as np
import pytest
from talking_points import FPS, LAYOUT, moved, phones, talk

from facesynth.evaluation.compare import COSTS
from facesynth.evaluation.lips import closure_threshold
from facesynth.evaluation.metrics import DEFINITIONS, METRICS, Case, metric
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

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


TIMES = tuple(zip(TRACK.labels, TRACK.starts_s, TRACK.ends_s, strict=True))
LIPS, UPPER, INNER = slice(5, 10), slice(0, 4), ((5, 7), (6, 8))
CHANGES = (truth, offset, late, doubled, noisy)


def opening(points):
    return np.mean([points[:, up, 1] - points[:, low, 1] for up, low in INNER], axis=0)


def shut_share(points, wanted, summary):
    """Share of the wanted phones whose gap, summed up, is at most what nine tenths of the recorded p, b, m reach."""

    def gaps(of, said):
        spans = [(label, round(a * FPS), round(b * FPS)) for label, a, b in TIMES]
        return [
            (np.min if said is None else said)(opening(of)[a:b]) for label, a, b in spans if label in (wanted if said else "bmp")
        ]

    recorded = sorted(gaps(truth().points.astype(float), None))
    threshold = recorded[int(np.ceil(0.9 * len(recorded))) - 1]
    return np.mean(np.array(gaps(points, summary)) <= threshold)


def by_hand(motion):
    """Every figure from the definition, written out plainly; times and head are known without."""
    x, y = motion.points.astype(float), truth().points.astype(float)
    x0, y0 = x - x.mean(axis=0), y - y.mean(axis=0)
    apart, apart0 = (np.sqrt(((a - b) ** 2).sum(axis=2)) for a, b in ((x, y), (x0, y0)))
    rest = np.array(LAYOUT.neutral).reshape(-1, 3)
    spread = [np.sqrt(((p - rest) ** 2).sum(axis=2))[:, UPPER].std(axis=0) for p in (x, y)]
    speeds = [np.sqrt((np.diff(p, axis=0) ** 2).sum(axis=2)).sum() for p in (x, y)]
    jerks = [(np.diff(p, n=3, axis=0) ** 2).mean() for p in (x, y)]
    box = np.concatenate([x, y]).reshape(-1, 3)
    side = (box.max(axis=0) - box.min(axis=0)).max()
    gx, gy = opening(x), opening(y)
    covariance = ((gx - gx.mean()) * (gy - gy.mean())).mean()
    return {
        "marker_error": apart.mean(),
        "marker_error_centred": apart0.mean(),
        "deng_error": (apart**2).mean(),
        "unit_cube_rms": np.sqrt((((x - y) / side) ** 2).mean(axis=(1, 2))).mean(),
        "lve": apart[:, LIPS].max(axis=1).mean(),
        "lve_sq": (apart[:, LIPS].max(axis=1) ** 2).mean(),
        "lve_centred": apart0[:, LIPS].max(axis=1).mean(),
        "fdd": (spread[1] - spread[0]).mean(),
        "fdd_abs": abs((spread[1] - spread[0]).mean()),
        "velocity_error": np.sqrt((np.diff(x - y, axis=0) ** 2).sum(axis=2)).mean() * FPS,
        "lip_gap_corr": np.corrcoef(gx, gy)[0, 1],
        "lip_gap_ccc": 2 * covariance / (gx.var() + gy.var() + (gx.mean() - gy.mean()) ** 2),
        "closure_rate": shut_share(x, "bmp", np.min),
        "false_closure_rate": shut_share(x, ("aa", "ay", "ah"), np.median),
        "lip_lag": 1000 * SHIFT_S if np.array_equal(motion.frames, late().frames) else 0.0,
        "jerk_ratio": jerks[0] / jerks[1],
        "energy_ratio": speeds[0] / speeds[1],
        "head_cca": 1.0,
        "head_distance": 0.0,
    }


@pytest.mark.parametrize("change", CHANGES)
def test_every_figure_of_every_change_is_what_its_definition_says(change):
    answers, motion = by_hand(change()), change()
    assert set(answers) == {one.name for one in METRICS} - {"lip_extrema_lag"}
    within = {"lip_lag": 3.0}
    for name, answer in answers.items():
        assert value(name, motion) == pytest.approx(answer, rel=1e-3, abs=within.get(name, 2e-4)), name


@pytest.mark.parametrize(("change", "most_ms"), [(truth, 1e-6), (offset, 1e-3), (doubled, 1e-3), (noisy, 40.0)])
def test_extrema_that_are_not_late_are_found_where_they_are(change, most_ms):
    assert 0 <= value("lip_extrema_lag", change()) <= most_ms


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
    assert set(DEFINITIONS) > {one.name for one in METRICS} | {column.name for column in COSTS}
    assert all(DEFINITIONS.values())
    assert {"lve", "lve_sq", "fdd", "fdd_abs", "closure_rate", "false_closure_rate", "lve_centred"} <= {m.name for m in METRICS}
