"""Weights solved from markers, against known answers and another solver."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import lsq_linear

from facesynth.face.solve import blendshapes
from facesynth.face.solve.blendshapes import UNSEEN, MarkerBasis, follow_gap, solve_markers
from facesynth.face.solve.bounded import solve
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

SPOKEN = {
    **{"jawOpen": 0.25, "mouthPucker": 0.3, "mouthFunnel": 0.2, "mouthStretch": 0.15, "mouthSmile": 0.3, "mouthRollLower": 0.2},
    **{"mouthUpperUp": 0.2, "mouthLowerDown": 0.25, "browInnerUp": 0.3, "browDown": 0.2, "cheekSquint": 0.3, "noseSneer": 0.1},
}


def speech_like(rig, count=300, fps=120.0, seed=0):
    """[T, 52] smooth weights of the shapes that speech uses, with closures of the lips."""
    from facesynth.face.rig.markers import LipGap

    rng = np.random.default_rng(seed)
    weights = np.zeros((count, 52))
    for name, size in SPOKEN.items():
        curve = gaussian_filter1d(rng.normal(size=count), 0.05 * fps)
        columns = [i for i, full in enumerate(rig.names) if full in (name, name + "Left", name + "Right")]
        weights[:, columns] = np.clip(size * (0.3 + 0.6 * curve / curve.std()), 0, 1)[:, None]
    closures = np.clip(8 * gaussian_filter1d(rng.normal(size=count), 0.05 * fps), 0, 1)
    return np.clip(LipGap.of(rig).closed(weights, -0.3, closures), 0, 1)


def markers_of(rig, weights):
    from facesynth.face.rig.arkit_rig import pose_points
    from facesynth.face.rig.markers import marker_layout, marker_vertices

    layout = marker_layout(rig)
    return layout, pose_points(rig, marker_vertices(rig, layout), weights).reshape(len(weights), -1)


def stacked(shapes, targets, ridge, stiffness):
    """The same problem as one tall least squares over all frames."""
    count, n = len(targets), len(shapes)
    rows = [np.kron(np.eye(count), shapes.T), np.kron(np.eye(count), np.diag(np.sqrt(ridge)))]
    rows.append(np.kron(np.diff(np.eye(count), axis=0), np.diag(np.sqrt(stiffness))))
    wanted = [targets.ravel(), np.zeros(count * n), np.zeros((count - 1) * n)]
    return np.concatenate(rows), np.concatenate(wanted)


@pytest.mark.parametrize("seed", range(6))
def test_solve_equals_another_bounded_solver(seed):
    rng = np.random.default_rng(seed)
    shapes, targets = rng.normal(size=(5, 12)), rng.normal(scale=5, size=(7, 12))
    ridge, smoothing_s, fps = rng.uniform(0.01, 1, 5), 0.02, 30.0
    stiffness = (shapes**2).sum(axis=1) * (smoothing_s * fps) ** 2
    expected = lsq_linear(*stacked(shapes, targets, ridge, stiffness), bounds=(0, 1), tol=1e-12).x.reshape(7, 5)
    got = solve(shapes, targets, ridge, fps=fps, smoothing_s=smoothing_s, tolerance=1e-9)
    assert (expected > 0.99).any()
    assert (expected < 0.01).any()
    np.testing.assert_allclose(got, expected, atol=2e-5)


def test_nearly_equal_shapes_still_converge():
    rng = np.random.default_rng(0)
    one = rng.normal(size=30)
    shapes = np.stack([one, one + 0.05 * rng.normal(size=30), rng.normal(size=30)])
    targets = np.array([[0.5, 0.3, 0.2]]) @ shapes
    ridge = np.full(3, 1e-3)
    expected = lsq_linear(*stacked(shapes, targets, ridge, np.zeros(3)), bounds=(0, 1), tol=1e-12).x
    np.testing.assert_allclose(solve(shapes, targets, ridge, fps=30.0)[0] @ shapes, expected @ shapes, atol=2e-3)


def test_smoothing_means_the_same_at_any_rate():
    """A step of a lone shape is followed with the same time constant at 60 and at 240 fps."""
    at = {}
    for fps in (60, 240):
        targets = np.repeat([0.2, 0.8], fps)[:, None] * np.ones(4)
        weights = solve(np.ones((1, 4)), targets, np.zeros(1), fps=fps, smoothing_s=0.03, tolerance=1e-9)[:, 0]
        at[fps] = np.interp([0.95, 0.98, 1.02, 1.05], (np.arange(2 * fps) + 0.5) / fps, weights)
    np.testing.assert_allclose(at[60], at[240], atol=0.01)
    assert at[60][1] > 0.25


def test_round_trip_in_mm(rig):
    weights = speech_like(rig)
    layout, frames = markers_of(rig, weights)
    got, residual = solve_markers(MarkerBasis.of(rig, layout), frames, 120.0)
    error = np.linalg.norm((markers_of(rig, got)[1] - frames).reshape(len(frames), -1, 3), axis=2)
    assert error.mean() < 0.05
    assert error[:, layout.group("mouth")].mean() < 0.08
    assert residual.mean() < 0.08


def test_noise_is_not_followed(rig):
    weights = speech_like(rig)
    layout, frames = markers_of(rig, weights)
    noisy = frames + np.random.default_rng(0).normal(0, 0.3, frames.shape)
    got, _ = solve_markers(MarkerBasis.of(rig, layout), noisy, 120.0)
    error = np.linalg.norm((markers_of(rig, got)[1] - frames).reshape(len(frames), -1, 3), axis=2)
    assert error[:, layout.group("mouth")].mean() < 0.25  # the noise itself is 0.48


def test_lips_that_meet_on_the_markers_meet_on_the_face(rig):
    from facesynth.face.rig.markers import LipGap

    weights = speech_like(rig)
    layout, frames = markers_of(rig, weights)
    gap = LipGap.of(rig)
    asked = gap.opening_mm(weights)
    got, _ = solve_markers(MarkerBasis.of(rig, layout), frames, 120.0)
    assert (asked < 0.5).sum() > 20
    np.testing.assert_allclose(gap.opening_mm(got)[asked < 2], asked[asked < 2], atol=0.05)


def test_a_lost_closure_is_brought_back(rig):
    from facesynth.face.rig.markers import LipGap

    layout, frames = markers_of(rig, np.zeros((3, 52)))
    basis = MarkerBasis.of(rig, layout)
    loose = np.zeros((3, 52))
    loose[:, rig.index("jawOpen")] = [[0.0], [0.05], [0.3]]
    mended = follow_gap(basis, loose, np.asarray(frames, float) - basis.rest_mm)
    rest = LipGap.of(rig).opening_mm(np.zeros(52))
    np.testing.assert_allclose(LipGap.of(rig).opening_mm(mended), rest, atol=1e-3)
    lost = np.zeros((1, 52))
    wide = frames[:1].astype(float) + 1.5 * basis.gap_rows.sum(axis=0) / 2  # every gap 1.5 mm wider
    opened = follow_gap(basis, lost, wide - basis.rest_mm)
    assert LipGap.of(rig).opening_mm(opened)[0] - rest == pytest.approx(1.5, abs=1e-3)


def test_neutral_markers_give_zero_weights(rig):
    layout, frames = markers_of(rig, np.zeros((10, 52)))
    weights, residual = solve_markers(MarkerBasis.of(rig, layout), frames, 120.0)
    assert np.abs(weights).max() < 1e-4
    assert residual.max() < 1e-3


def test_a_mirrored_face_gets_mirrored_weights(rig):
    weights = speech_like(rig, 60)
    left = [i for i, name in enumerate(rig.names) if name.endswith("Left")]
    weights[:, left] *= 0.5
    swap = [rig.names.index(_other(name)) for name in rig.names]
    found = []
    for version in (weights, weights[:, swap]):
        layout, frames = markers_of(rig, version)
        found.append(solve_markers(MarkerBasis.of(rig, layout), frames, 120.0)[0])
    np.testing.assert_allclose(markers_of(rig, found[0][:, swap])[1], markers_of(rig, found[1])[1], atol=0.15)


def test_known_shapes_are_taken_off_first(rig):
    known = np.zeros((5, 52))
    known[:, rig.index("eyeLookDownLeft", "eyeLookDownRight")] = 0.7
    layout, frames = markers_of(rig, known)
    basis = MarkerBasis.of(rig, layout)
    with_gaze, _ = solve_markers(basis, frames, 120.0, known)
    without, _ = solve_markers(basis, frames, 120.0)
    assert np.abs(with_gaze - known).max() < 1e-4
    assert without[:, [rig.names.index(name) for name in UNSEEN]].max() == 0


def test_what_is_solved_in_stretches_is_what_is_solved_as_a_whole(rig, monkeypatch):
    layout, frames = markers_of(rig, speech_like(rig, 300))
    basis = MarkerBasis.of(rig, layout)
    weights, residual_mm = solve_markers(basis, frames, 120.0)
    monkeypatch.setattr(blendshapes, "SOLVED", 110)
    again, residual_again_mm = solve_markers(basis, frames, 120.0)
    np.testing.assert_allclose(again, weights, atol=2e-3)
    np.testing.assert_allclose(residual_again_mm, residual_mm, atol=2e-3)


def test_long_takes_take_a_few_ms_a_frame(rig):
    import time

    weights = speech_like(rig, 2000)
    layout, frames = markers_of(rig, weights)
    basis = MarkerBasis.of(rig, layout)
    solve_markers(basis, frames[:2], 120.0)  # compiles
    start = time.perf_counter()
    solve_markers(basis, frames, 120.0)
    assert (time.perf_counter() - start) / 2000 < 0.005


def test_bad_problems_are_refused(rig):
    with pytest.raises(FacesynthError, match="do not fit"):
        solve(np.ones((2, 3)), np.ones((4, 5)), np.ones(2), fps=30.0)
    with pytest.raises(FacesynthError, match="NaN"):
        solve(np.ones((2, 3)), np.full((4, 3), np.nan), np.ones(2), fps=30.0)
    with pytest.raises(FacesynthError, match="landmarks"):
        MarkerBasis.of(rig, Layout("landmarks", ("chin",)))
    with pytest.raises(FacesynthError, match="no known place"):
        MarkerBasis.of(rig, Layout("markers", ("left_antenna",)))


def _other(name):
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name
