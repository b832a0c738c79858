"""Weights as BEAT keeps them, and what OpenFace writes: read by name, with what is missing told."""

import json

import bringing
import numpy as np
import pytest
from openface_files import COUNT, changed, openface, without

from facesynth.corpus.importers.formats import read
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES

FPS = 60


def beat(path, names=ARKIT_NAMES[:-1], scale=1.0, times_s=None):
    weights = np.random.default_rng(0).random((COUNT, len(names)))
    times_s = np.arange(COUNT) / FPS if times_s is None else times_s
    frames = [
        {"weights": (scale * row).tolist(), "time": time, "rotation": []} for row, time in zip(weights, times_s, strict=True)
    ]
    path.write_text(json.dumps({"names": list(names), "frames": frames}), encoding="utf-8")
    return weights


@pytest.mark.parametrize("seed", [0, 1])
def test_beat_is_read_by_name_and_what_is_missing_is_0(tmp_path, seed):
    names = list(np.random.default_rng(seed).permutation(ARKIT_NAMES[:-1]))
    weights = beat(tmp_path / "a.json", names)
    reading = read(tmp_path / "a.json")
    assert reading.motion.fps == FPS
    own = reading.motion.layout.names
    np.testing.assert_allclose(reading.motion.frames[:, [own.index(name) for name in names]], weights, atol=1e-6)
    assert not reading.motion.frames[:, own.index("tongueOut")].any()
    assert "1 of ARKit's 52 shapes are not in it and stay 0: tongueOut" in reading.remarks[0]


def test_beat_in_per_cent_with_lost_frames_and_damage(tmp_path):
    weights = beat(tmp_path / "a.json", scale=100)
    reading = read(tmp_path / "a.json")
    assert "per cent" in reading.remarks[0]
    np.testing.assert_allclose(reading.motion.frames[:, :51], weights, atol=1e-6)
    times_s = np.arange(COUNT) / FPS
    times_s[60:] += 0.5
    beat(tmp_path / "b.json", times_s=times_s)
    gapped = read(tmp_path / "b.json").motion
    assert np.array_equal(np.flatnonzero(np.isnan(gapped.frames[:, 0])), np.arange(60, 90))
    plain = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    plain["frames"] = [frame for frame in plain["frames"] for _ in range(2)]
    (tmp_path / "d.json").write_text(json.dumps(plain), encoding="utf-8")
    doubled = read(tmp_path / "d.json")
    np.testing.assert_allclose(doubled.motion.frames[:, :51], weights, atol=1e-6)
    assert "are there twice" in doubled.remarks[-1]
    for damage in (
        '{"frames": [{"weights": [1]}]}',
        '{"names": ["a"], "frames": []}',
        '{"names": 3, "frames": 4, "weights"',
        "[]",
    ):
        (tmp_path / "c.json").write_text(damage, encoding="utf-8")
        with pytest.raises(FacesynthError):
            read(tmp_path / "c.json")


def test_beat_in_a_corpus_with_a_longer_sound(tmp_path):
    beat(tmp_path / "take.json")
    (tmp_path / "meta.json").write_text('{"camera": 1}', encoding="utf-8")
    bringing.save_wav(tmp_path / "take.wav", bringing.hum(2.5), bringing.RATE)
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n2.5 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", tmp_path / "take.json", tmp_path / "take.wav", tmp_path / "take.lab")
    assert report["added"] == ["take"], report
    assert "the motion lasts 2.00 s, the sound 2.50 s" in account
    assert "tongueOut" in account


def test_openface_gives_landmarks_head_and_gaze(tmp_path):
    face = openface(tmp_path / "a.csv")
    reading = read(tmp_path / "a.csv")
    motion, seen = reading.motion, np.r_[0:30, 40:COUNT]
    assert motion.fps == 30
    np.testing.assert_allclose(motion.points[seen], face[seen], atol=0.01)
    for part in (motion.frames, motion.head, motion.eyes):
        assert np.array_equal(np.flatnonzero(np.isnan(part).all(axis=1)), np.arange(30, 40))
    np.testing.assert_allclose(motion.eyes[0], [0.8, 0.1, -0.2], atol=1e-6)
    np.testing.assert_allclose(motion.head[seen, 5], -600, atol=10)
    assert "no success in 10 of 120 pictures" in reading.remarks[0]
    assert read(tmp_path / "a.csv").motion.layout.lip_pairs


def test_openface_with_two_faces_and_in_2d(tmp_path):
    openface(tmp_path / "a.csv", faces=2)
    reading = read(tmp_path / "a.csv")
    assert len(reading.motion) == COUNT
    assert "2 faces are in it: face_id 0" in reading.remarks[0]
    openface(tmp_path / "b.csv", flat=True)
    assert read(tmp_path / "b.csv").motion.layout.kind == "landmarks"


def test_openface_in_a_corpus(tmp_path):
    openface(tmp_path / "take.csv")
    bringing.save_wav(tmp_path / "take.wav", bringing.hum(4.0), bringing.RATE)
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n4.0 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", tmp_path / "take.csv", tmp_path / "take.wav", tmp_path / "take.lab")
    assert report["added"] == ["take"], report
    assert "no success in 10 of 120 pictures" in account


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_times_of_beat_in_other_units_are_told(tmp_path, scale, unit):
    weights = beat(tmp_path / "a.json", times_s=np.round(np.arange(COUNT) / FPS * scale, 3))
    reading = read(tmp_path / "a.json")
    assert reading.motion.fps == FPS
    np.testing.assert_allclose(reading.motion.frames[:, :51], weights, atol=1e-6)
    assert f"its times are taken as {unit}" in reading.remarks


def variant(path, change):
    """A file of BEAT's after change(document)."""
    beat(path, ARKIT_NAMES)
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(change(document) or document), encoding="utf-8")
    return path


def numbered(document):
    for number, frame in enumerate(document["frames"]):
        frame["time"] = number


def untimed(document):
    document["metadata"] = {"fps": FPS}
    for frame in document["frames"]:
        del frame["time"]


def by_name(document):
    for frame in document["frames"]:
        frame["weights"] = dict(zip(document["names"], frame["weights"], strict=True))


def prefixed(document):
    document["names"] = [f"head.{name[:-4]}_L" if name.endswith("Left") else f"blendShape1.{name}" for name in document["names"]]


def with_angles(document):
    document["names"] += ["headYaw", "headPitch", "headRoll"]
    for frame in document["frames"]:
        frame["weights"] += [-0.4, 0.1, 0.2]


def audio2face(document):
    rows = [frame["weights"] for frame in document["frames"]]
    return {"exportFps": FPS, "numPoses": 52, "facsNames": document["names"], "weightMat": rows}


@pytest.mark.parametrize("change", [untimed, by_name, prefixed, with_angles, audio2face])
def test_weights_are_read_by_name_however_they_are_kept(tmp_path, change):
    beat(tmp_path / "plain.json", ARKIT_NAMES)
    plain, reading = read(tmp_path / "plain.json").motion, read(variant(tmp_path / "a.json", change))
    own = reading.motion.layout.names
    assert reading.motion.fps == FPS
    assert len(own) == 52
    for name in ("jawOpen", "mouthSmileLeft", "browInnerUp"):
        np.testing.assert_allclose(reading.motion.frames[:, own.index(name)], plain.frames[:, plain.layout.names.index(name)])
    assert any("angles of head and eyes are not read" in line for line in reading.remarks) == (change is with_angles)


def test_frames_by_number_want_a_rate_and_missing_weights_are_gaps(tmp_path):
    with pytest.raises(FacesynthError, match=r"numbers its frames .* give the rate \(--fps\)"):
        read(variant(tmp_path / "a.json", numbered))
    assert read(tmp_path / "a.json", fps=FPS).motion.fps == FPS

    def holes(document):
        document["frames"][7]["weights"] = [None] * 52

    reading = read(variant(tmp_path / "b.json", holes))
    assert np.flatnonzero(np.isnan(reading.motion.frames[:, 0])).tolist()[0] == 7
    assert any("52 weights are missing" in line for line in reading.remarks)

    def short(document):
        document["frames"][3]["weights"].pop()

    with pytest.raises(FacesynthError, match="frame 4 holds 51 weights, 52 shapes are named"):
        read(variant(tmp_path / "c.json", short))


@pytest.mark.parametrize(("sign", "encoding"), [(";", "utf-8"), ("\t", "utf-8-sig"), (",", "utf-16"), (",", "utf-16-le")])
def test_openface_in_every_dress(tmp_path, sign, encoding):
    face = openface(tmp_path / "a.csv")
    changed(tmp_path / "a.csv", lambda names, rows: (names[::-1], [row[::-1] for row in rows]), sign, encoding)
    np.testing.assert_allclose(read(tmp_path / "a.csv").motion.points[:30], face[:30], atol=0.01)


def test_openface_without_success_without_times_and_with_what_c_writes_for_nan(tmp_path):
    path = tmp_path / "a.csv"

    def unsure(names, rows):
        for row in rows[:15]:
            row[3], row[20] = "0.02", "-nan(ind)"
        return without("success")(names, rows)

    openface(path)
    changed(path, unsure)
    reading = read(path)
    assert np.array_equal(np.flatnonzero(np.isnan(reading.motion.frames).all(axis=1)), np.arange(15))
    assert any("rows of a confidence of 0.5 and more are taken" in line for line in reading.remarks)
    openface(path)
    changed(path, without("timestamp"))
    with pytest.raises(FacesynthError, match="no times, as OpenFace writes of pictures; give their rate"):
        read(path)
    assert read(path, fps=25).motion.fps == 25


def test_a_face_that_is_found_again_or_late_stands_where_the_video_has_it(tmp_path):
    path = tmp_path / "a.csv"
    face = openface(path)

    def again(names, rows):
        kept = [row for row in rows if float(row[0]) > 40]
        for row in kept:
            row[1] = "3" if float(row[0]) > 80 else "2"
        return names, kept

    changed(path, again)
    reading = read(path)
    assert len(reading.motion) == COUNT
    assert np.isnan(reading.motion.frames[:40]).all()
    np.testing.assert_allclose(reading.motion.points[50:], face[50:], atol=0.01)
    assert "never seen beside it, as the same face found again" in reading.remarks[0]
