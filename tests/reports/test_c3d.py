"""C3D as programs write it: gaps as numbers, outputs of models among markers, units in words, more frames than 16 bits count."""

import struct

import bringing
import numpy as np
import pytest
from c3d_files import DEC, INTEL, MIPS, NAMES, Parameter, face, file, write
from mocap_files import write_c3d

from facesynth.corpus.importers.formats import read
from facesynth.inference.errors import FacesynthError

pytest.importorskip("c3d")


def with_extra(path, points, labels, lists, fps=120.0):
    """A C3D whose groups list some labels as outputs of a model."""
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [fps]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    for kind, members in lists.items():
        file.add_parameter("POINT", kind, list(members))
    file["data"]["points"] = np.ones((4, len(labels), len(points)))
    file["data"]["points"][:3] = points.transpose(2, 1, 0)
    file.write(str(path))
    return path


@pytest.mark.parametrize("filler", [-16512.0, 9999.999, 99999.0, -9999.0, 1e6, 0.0, 32767.0])
@pytest.mark.parametrize("whole", [True, False])
def test_numbers_that_stand_for_gaps_are_gaps(tmp_path, filler, whole):
    points = face()
    gaps = np.zeros((300, 6), bool)
    gaps[20:40, 2] = gaps[100:103, :] = gaps[250, 4] = True
    if whole or filler == 0:
        points[gaps] = filler
    else:
        points[gaps, 1] = filler
    reading = read(write_c3d(tmp_path / "a.c3d", points, labels=NAMES))
    assert np.array_equal(np.isnan(reading.motion.points).any(axis=2), gaps)
    assert any("are gaps" in remark for remark in reading.remarks)


@pytest.mark.parametrize("filler", [-16512.0, 9999.999, 0.0])
@pytest.mark.parametrize("suffix", ["npz", "csv"])
def test_tables_write_them_too(tmp_path, filler, suffix):
    points = face()
    points[20:40, 2] = filler
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, frames=points, names=np.array(NAMES), fps=120.0)
    else:
        header = ",".join(f"{name}.{axis}" for name in NAMES for axis in "xyz")
        np.savetxt(path, points.reshape(300, -1), delimiter=",", header=header, comments="", fmt="%.6f")
    reading = read(path, fps=120)
    assert np.array_equal(np.flatnonzero(np.isnan(reading.motion.points[:, 2, 0])), np.arange(20, 40))
    assert "they are gaps" in reading.remarks[-1]


def test_a_face_that_walks_through_the_room_has_no_gaps(tmp_path):
    points = face(600) + np.linspace(0, 4000, 600)[:, None, None] * np.array([1, 0, 0.5])
    assert np.isfinite(read(write_c3d(tmp_path / "a.c3d", points, labels=NAMES)).motion.frames).all()


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
def test_every_processor_writes_the_same_markers_and_gaps(tmp_path, processor, whole):
    points = face()
    points[20:40, 2] = points[100:103] = np.nan
    reading = read(write(tmp_path / "a.c3d", file(points, processor=processor, whole_numbers=whole)))
    np.testing.assert_allclose(reading.motion.points, points, atol=0.003)
    filled = file(np.nan_to_num(points), processor=processor, whole_numbers=whole, residuals=np.zeros((300, 6)))
    np.testing.assert_allclose(read(write(tmp_path / "a.c3d", filled)).motion.points, points, atol=0.003)


@pytest.mark.parametrize(
    ("without", "header", "said"),
    [
        ([(1, "RATE")], {}, ""),
        ([(1, "SCALE"), (1, "FRAMES"), (1, "USED"), (1, "DATA_START")], {}, ""),
        ([(2, "USED"), (2, "RATE"), (2, "GEN_SCALE")], {}, ""),
        ([], {"rate": 0.0}, ""),
        ([], {"rate": 100.0}, "its header states 100 frames a second, its parameters 120, which was taken"),
        ([], {"data": 0}, ""),
        ([], {"first": 500, "last": 799}, ""),
        ([], {"per_frame": 10}, ""),
        ([(1, "UNITS")], {}, "states no unit"),
    ],
)
def test_what_header_and_parameters_need_not_both_say(tmp_path, without, header, said):
    reading = read(write(tmp_path / "a.c3d", file(face(), without=without, header=header)))
    np.testing.assert_allclose(reading.motion.points, face(), atol=1e-4)
    assert reading.motion.fps == 120
    assert len(reading.remarks) == bool(said)
    assert said in "".join(reading.remarks)


@pytest.mark.parametrize("header", [{"points": 5}, {"scale": 0.1}])
def test_a_file_that_contradicts_itself_is_refused(tmp_path, header):
    with pytest.raises(FacesynthError, match="contradicts itself"):
        read(write(tmp_path / "a.c3d", file(face(), header=header)))


@pytest.mark.parametrize("filler", [0.0, -1.0, 9999.0])
@pytest.mark.parametrize("rounded", [False, True])
def test_landmarks_in_pictures_have_such_gaps_too(tmp_path, filler, rounded):
    points = face()[..., :2] + 300
    points = np.round(points) if rounded else points
    path = tmp_path / "a.npz"
    np.savez(path, frames=points, names=np.array(NAMES), fps=30.0)
    assert read(path).remarks == ()
    points[20:40, 2] = filler
    np.savez(path, frames=points, names=np.array(NAMES), fps=30.0)
    reading = read(path)
    assert np.array_equal(np.argwhere(np.isnan(reading.motion.points[..., 0])), [(t, 2) for t in range(20, 40)])
    assert "they are gaps" in reading.remarks[0]


@pytest.mark.parametrize("kind", ["ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS"])
@pytest.mark.parametrize("subject", ["", "Ada:"])
def test_outputs_of_a_model_are_no_markers(tmp_path, kind, subject):
    points = np.concatenate([face(), np.full((300, 2, 3), 90.0)], axis=1)
    labels = [subject + name for name in (*NAMES, "HeadAngles", "NeckForce")]
    reading = read(with_extra(tmp_path / "a.c3d", points, labels, {kind: labels[6:]}))
    assert reading.motion.layout.names == tuple(NAMES)
    assert (
        "2 outputs of a model (HeadAngles, NeckForce) are no markers" in reading.remarks[0] or "NeckForce" in reading.remarks[0]
    )


@pytest.mark.parametrize(
    ("markers", "outputs", "lists"),
    [
        ("", ["Ada:HeadAngles", "Ada:Power"], {"ANGLES": ["Ada:HeadAngles"], "POWERS": ["Ada:Power"]}),
        ("", ["Ada:HeadAngles", "Bo:Power"], {"ANGLES": ["Ada:HeadAngles"], "POWERS": ["Bo:Power"]}),
        ("Ada:", ["Ada:HeadAngles", "Ada:Power"], {"ANGLES": ["HeadAngles"], "POWERS": ["Power"]}),
        ("", ["HeadAngles", "Power"], {"ANGLES": ["Ada:HeadAngles"], "POWERS": ["Ada:Power"]}),
        ("Ada:", ["HeadAngles", "Bo:Power"], {"ANGLES": ["Ada:HeadAngles"], "POWERS": ["Bo:Power"]}),
        ("", ["HeadAngles", "Power"], {"ANGLES": ["HeadAngles"], "ANGLES2": ["Power"]}),
        ("Ada:", ["Ada:chest", "chin"], {"FORCES": ["chin"], "FORCES2": ["Ada:chest"]}),
    ],
)
def test_outputs_are_known_whichever_states_the_subject(tmp_path, markers, outputs, lists):
    points = np.concatenate([np.full((300, 2, 3), 90.0), face()], axis=1)
    labels = [*outputs, *(markers + name for name in NAMES)]
    reading = read(with_extra(tmp_path / "a.c3d", points, labels, lists))
    assert reading.motion.layout.names == tuple(NAMES)
    np.testing.assert_allclose(reading.motion.points, face(), atol=1e-3)
    assert "2 outputs of a model" in reading.remarks[0]


@pytest.mark.parametrize(
    "lists",
    [
        {"ANGLES": ["HeadAngles"], "REACTIONS": ["Ground"]},
        {"ANGLES": ["headangles", "GROUND"]},
        {"ANGLES": ["HeadAngles"], "PHASES": ["Ground"], "TYPE_GROUPS": ["ANGLES", "PHASES", "MODELED_MARKERS"]},
    ],
)
def test_outputs_in_lists_of_other_names_and_in_other_case(tmp_path, lists):
    points = np.concatenate([face(), np.full((300, 2, 3), 90.0)], axis=1)
    more = [Parameter.texts(1, name, labels) for name, labels in {**lists, "MODELED_MARKERS": ["nose"]}.items()]
    reading = read(write(tmp_path / "a.c3d", file(points, [*NAMES, "HeadAngles", "Ground"], more=more)))
    assert reading.motion.layout.names == tuple(NAMES)
    assert "2 outputs of a model" in reading.remarks[0]


@pytest.mark.parametrize("label", ["Bo:chest", "chest"])
def test_a_marker_called_like_the_output_of_another_subject_is_kept(tmp_path, label):
    points = np.concatenate([face(), np.full((300, 1, 3), 90.0), face()[:, :1]], axis=1)
    labels = [*(f"Ada:{name}" for name in NAMES), "Ada:chest", label]
    reading = read(with_extra(tmp_path / "a.c3d", points, labels, {"FORCES": ["Ada:chest"]}))
    assert reading.motion.layout.names[-1] == label
    assert len(reading.motion.layout.names) == 7


@pytest.mark.parametrize(
    ("unit", "mm"),
    [
        ("meters", 1000),
        ("Metres", 1000),
        ("METER", 1000),
        ("millimeters", 1),
        ("centimetre", 10),
        ("inch", 25.4),
        ("inches", 25.4),
        ("[mm]", 1),
        ("feet", 304.8),
        ("µm", 1e-3),
        ("M", 1000),
        ("Meters (m)", 1000),
        ("mtr", 1000),
        ("metros", 1000),
        ("millimeter(s)", 1),
        ("Millimètres", 1),
        ("mm mm mm", 1),
        ("Zentimeter", 10),
    ],
)
def test_units_in_their_usual_spellings(tmp_path, unit, mm):
    reading = read(write(tmp_path / "a.c3d", file(face() / mm, unit=unit)))
    np.testing.assert_allclose(reading.motion.points, face(), rtol=1e-4, atol=1e-3)
    assert reading.remarks == ()


@pytest.mark.parametrize("unit", ["meter/s", "pixels", "deg"])
def test_what_is_no_length_is_refused(tmp_path, unit):
    with pytest.raises(FacesynthError, match="known units are"):
        read(write(tmp_path / "a.c3d", file(face(), unit=unit)))


def test_a_unit_that_contradicts_the_size_of_a_face_is_told(tmp_path):
    for unit, scale, meant in (("mm", 0.001, "m"), ("m", 1.0, "mm"), ("mm", 0.1, "cm")):
        (remark,) = read(write_c3d(tmp_path / "a.c3d", face() * scale, unit=unit, labels=NAMES)).remarks
        assert f"it looks like {meant};" in remark


def long_take(path, count, without=()):
    write_c3d(path, np.tile(face(1), (count, 1, 1)).astype(np.float32) + np.arange(count)[:, None, None] * 1e-4, labels=NAMES)
    content = bytearray(path.read_bytes())
    for name in without:
        place = content.find(name)
        if place >= 0:
            content[place : place + len(name)] = b"X" * len(name)
    return content


@pytest.mark.parametrize(
    ("header", "without"),
    [
        (None, ()),
        (65535, (b"LONG_FRAMES", b"ACTUAL_END_FIELD", b"FRAMES")),
        ("wrapped", (b"LONG_FRAMES", b"ACTUAL_END_FIELD", b"FRAMES")),
    ],
)
def test_recordings_of_nine_minutes_keep_their_length(tmp_path, header, without):
    count = 66_000
    content = long_take(tmp_path / "a.c3d", count, without)
    if header is not None:
        struct.pack_into("<HH", content, 6, 1, 65535 if header == 65535 else count % 65536)
    (tmp_path / "a.c3d").write_bytes(content)
    motion = read(tmp_path / "a.c3d").motion
    slack = 0 if header == "wrapped" else 512 // (16 * 6) + 1
    assert 0 <= len(motion) - count <= slack
    np.testing.assert_allclose(motion.points[count - 1, 0], face(1)[0, 0] + (count - 1) * 1e-4, atol=1e-2)


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    content = write_c3d(tmp_path / "a.c3d", face(), labels=NAMES).read_bytes()
    (tmp_path / "a.c3d").write_bytes(content[: len(content) // 2 + 1000])
    with pytest.raises(FacesynthError, match="cut off: it states 300 frames"):
        read(tmp_path / "a.c3d")


def test_corpus_add_tells(tmp_path):
    points = face(240)
    points[20:40, 2] = -16512
    write_c3d(tmp_path / "take.c3d", points / 1000, unit="meters", labels=NAMES)
    bringing.save_wav(tmp_path / "take.wav", bringing.hum(2.0), bringing.RATE)
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n2.0 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", tmp_path / "take.c3d", tmp_path / "take.wav", tmp_path / "take.lab")
    assert report["added"] == ["take"], report
    assert "they are gaps" in " ".join(report["remarks"]["take"])
    assert "they are gaps" in account
