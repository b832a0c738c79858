import numpy as np
import pytest
from acting import BILABIAL_RICH, act, speech_of

from facesynth.face.rig.arkit_rig import pose_points
from facesynth.motion.gaps import fill_gaps
from facesynth.performer import capture as stage
from facesynth.performer.capture import SWAPS, Fault, capture, plan_faults
from facesynth.performer.truth import read_truth, write_truth


@pytest.fixture(scope="module")
def acted(lips):
    speech = speech_of(BILABIAL_RICH, "happy")
    return speech, act(speech, lips)


def recorded(acted, rig, seed=0, **options):
    speech, performance = acted
    return capture(performance, speech.phones, rig, rng=np.random.default_rng(seed), **options)


def test_a_clean_capture_is_the_face_without_the_head(acted, rig):
    clean = recorded(acted, rig, clean=True)
    layout = clean.motion.layout
    still = pose_points(rig, stage.marker_vertices(rig, layout), acted[1].weights)
    assert clean.faults == ()
    assert np.sqrt(((clean.motion.points - still) ** 2).sum(axis=-1).mean()) < 0.2
    assert np.abs(clean.motion.head[:, :3] - acted[1].head[:, :3]).max() < np.radians(0.6)


def test_sensors_are_noisy(acted, rig):
    away = recorded(acted, rig).motion.points - recorded(acted, rig, clean=True).motion.points
    assert 0.09 < np.sqrt(np.nanmedian((away**2).sum(axis=-1))) < 0.2


def test_same_seed_same_bytes(acted, rig):
    one, same, other = (recorded(acted, rig, seed).motion for seed in (1, 1, 2))
    assert one.frames.tobytes() == same.frames.tobytes()
    assert one.head.tobytes() == same.head.tobytes()
    assert one.frames.tobytes() != other.frames.tobytes()


def test_gaps_are_where_the_truth_says_and_nowhere_else(acted, rig, monkeypatch):
    monkeypatch.setattr(stage, "LONG_GAP_SHARE", 1.0)
    for seed in range(5):
        taken = recorded(acted, rig, seed)
        layout, missing = taken.motion.layout, np.zeros(taken.motion.points.shape[:2], bool)
        for fault in taken.faults:
            if fault.kind.endswith("gap"):
                missing[fault.start : fault.stop, layout.names.index(fault.markers[0])] = True
        assert {fault.kind for fault in taken.faults} >= {"short_gap", "long_gap"}
        assert np.array_equal(np.isnan(taken.motion.points).all(axis=-1), missing)


def test_short_gaps_can_be_filled_and_long_ones_cannot(acted, rig, monkeypatch):
    monkeypatch.setattr(stage, "LONG_GAP_SHARE", 1.0)
    taken, clean = recorded(acted, rig, 3), recorded(acted, rig, 3, clean=True)
    filled, _ = fill_gaps(taken.motion.frames, 120.0, 3)
    points = taken.motion.layout.points(filled)
    for fault in taken.faults:
        marker = taken.motion.layout.names.index(fault.markers[0])
        found = points[fault.start : fault.stop, marker]
        if fault.kind == "short_gap":
            assert fault.stop - fault.start < 0.1 * 120
            assert np.linalg.norm(found - clean.motion.points[fault.start : fault.stop, marker], axis=-1).max() < 3.0
        if fault.kind == "long_gap":
            assert fault.stop - fault.start > 0.1 * 120
            assert np.isnan(found).all()


def test_contaminated_phones_are_wrong_by_millimetres(acted, rig, monkeypatch):
    monkeypatch.setattr(stage, "CONTAMINATED_SHARE", 1.0)
    kinds = set()
    for seed in range(8):
        taken, clean = recorded(acted, rig, seed), recorded(acted, rig, seed, clean=True)
        (fault,) = (fault for fault in taken.faults if fault.phone is not None)
        kinds.add(fault.kind)
        bounds = acted[0].phones.frame_bounds(120.0)
        assert (fault.start, fault.stop) == tuple(bounds[fault.phone : fault.phone + 2])
        assert acted[0].phones.labels[fault.phone] != "pau"
        index = [taken.motion.layout.names.index(name) for name in fault.markers]
        away = np.linalg.norm(taken.motion.points[:, index] - clean.motion.points[:, index], axis=-1)
        assert np.nanmax(away[fault.start : fault.stop]) > 2.5
        assert np.nanmax(np.delete(away, slice(fault.start, fault.stop), axis=0)) < 1.0
    assert kinds == {"swap", "jolt"}


def test_faults_are_few(acted, rig):
    layout = recorded(acted, rig, clean=True).motion.layout
    plans = [plan_faults(acted[0].phones, layout, len(acted[1]), 120.0, np.random.default_rng(seed)) for seed in range(400)]
    contaminated = sum(any(fault.phone is not None for fault in plan) for plan in plans)
    long = sum(any(fault.kind == "long_gap" for fault in plan) for plan in plans)
    assert 4 <= contaminated <= 24
    assert 6 <= long <= 30


def test_swapped_markers_exist(acted, rig):
    names = recorded(acted, rig, clean=True).motion.layout.names
    assert {name for pair in SWAPS for name in pair} <= set(names)


def test_truth_survives_the_disk(tmp_path):
    truth = {"s001_sad_t1": (Fault("swap", ("a", "b"), 3, 9, 4), Fault("short_gap", ("c",), 1, 2)), "s002_sad_t1": ()}
    write_truth(tmp_path, truth)
    assert read_truth(tmp_path) == truth


def test_a_missing_or_damaged_truth_is_said_so(tmp_path):
    with pytest.raises(ValueError, match="is missing"):
        read_truth(tmp_path)
    (tmp_path / "performer_truth.json").write_text('{"a": [3]}')
    with pytest.raises(ValueError, match="is damaged"):
        read_truth(tmp_path)
