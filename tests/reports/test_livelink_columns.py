"""Takes with columns of any order, case, number and encoding: one reader finds them by name."""

import re

import bringing
import numpy as np
import pytest
from takes import NAMES, timecodes_of, values_of, write

from facesynth.corpus.importers.formats import read
from facesynth.face.files.livelink import read_livelink
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.livelink import WEIGHTS, is_live_link

CODES, VALUES = timecodes_of(120), values_of(120)


def plain(folder):
    return read(write(folder / "plain.csv", CODES, VALUES)).motion


ODD = {
    "utf-16": {"encoding": "utf-16"},
    "utf-16 without a mark": {"encoding": "utf-16-le"},
    "utf-8 with a mark": {"encoding": "utf-8-sig"},
    "semicolons": {"sign": ";", "decimal": ","},
    "tabs": {"sign": "\t"},
    "lower case": {"names": tuple(name.lower() for name in NAMES), "first": ("timecode", "blendshapecount")},
    "ARKit's case": {"names": tuple(name[0].lower() + name[1:] for name in NAMES), "first": ("Timecode", "BlendShapeCount")},
    "UTF-16 with semicolons": {"encoding": "utf-16", "sign": ";", "decimal": ","},
    "a letter for the side": {"names": tuple(re.sub("(Left|Right)$", lambda side: f"_{side[0][0]}", name) for name in NAMES)},
    "snake case": {"names": tuple(re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower() for name in NAMES)},
    "words": {"names": tuple(re.sub("(?<=[a-z])(?=[A-Z])", " ", name) for name in NAMES)},
    "names behind those of a node": {"names": tuple(f"blendShape1.{name[0].lower()}{name[1:]}" for name in NAMES)},
    "names behind ARKit": {"names": tuple(f"ARKit_{name}" for name in NAMES)},
    "another order": {"order": np.random.default_rng(1).permutation(63)},
}


@pytest.mark.parametrize("kind", sorted(ODD))
def test_the_same_take_in_every_dress(tmp_path, kind):
    path = write(tmp_path / "a.csv", CODES, VALUES, **ODD[kind])
    assert is_live_link(path)
    got, wanted = read(path).motion, plain(tmp_path)
    assert got.fps == wanted.fps
    assert set(got.layout.names) == set(wanted.layout.names)
    places = [got.layout.names.index(name) for name in wanted.layout.names]
    np.testing.assert_allclose(got.frames[:, places], wanted.frames, atol=1e-7)
    np.testing.assert_allclose(got.head, wanted.head, atol=1e-7)
    np.testing.assert_allclose(got.eyes, wanted.eyes, atol=1e-7)
    np.testing.assert_allclose(read_livelink(path).values, VALUES, atol=1e-9)


def lines_of(header, cell):
    """A take line by line, each number as `cell` writes it."""
    return [header, *(f"{code},61,{','.join(map(cell, row))}" for code, row in zip(CODES, VALUES, strict=True))]


HEADER = ",".join(["Timecode", "BlendshapeCount", *NAMES])
PLAIN = lines_of(HEADER, "{:.10f}".format)
WRITTEN = {
    "decimal commas in quotes": (lines_of(HEADER, lambda value: f'"{value:.10f}"'.replace(".", ",")), ""),
    "a sign at the end of each line": ([f"{line}," for line in PLAIN], ""),
    "Excel's line on the sign": (["sep=,", *PLAIN], ""),
    "a name in a column": (["Subject," + PLAIN[0], *(f"iPhone,{line}" for line in PLAIN[1:])], "left out: Subject"),
    "a count of frames": (["Frame," + PLAIN[0], *(f"{k},{line}" for k, line in enumerate(PLAIN[1:]))], "left out: Frame"),
}


@pytest.mark.parametrize("kind", sorted(WRITTEN))
def test_the_same_take_as_other_programs_write_it(tmp_path, kind):
    lines, said = WRITTEN[kind]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert is_live_link(path)
    reading, wanted = read(path), plain(tmp_path)
    np.testing.assert_allclose(reading.motion.frames, wanted.frames, atol=1e-7)
    np.testing.assert_allclose(reading.motion.head, wanted.head, atol=1e-7)
    assert said in "".join(reading.remarks)
    np.testing.assert_allclose(read_livelink(path).values, VALUES, atol=1e-9)


def test_angles_in_degrees_and_weights_under_0_are_told(tmp_path):
    degrees = np.concatenate([VALUES[:, :52], np.rad2deg(VALUES[:, 52:])], axis=1)
    reading = read(write(tmp_path / "a.csv", CODES, degrees))
    np.testing.assert_allclose(reading.motion.head, plain(tmp_path).head, atol=1e-6)
    assert "they were taken as degrees" in reading.remarks[0]
    under = read(write(tmp_path / "b.csv", CODES, np.where(np.arange(61) == 17, -VALUES, VALUES)))
    assert under.motion.frames[:, :52].min() == 0
    assert "those under 0 are taken as 0" in under.remarks[0]


def test_per_cent_signs_are_read(tmp_path):
    rows = [[f"{100 * value:.8f}%" for value in row[:52]] + [f"{value:.10f}" for value in row[52:]] for row in VALUES * 0.01]
    lines = [HEADER, *(f"{code},61,{','.join(row)}" for code, row in zip(CODES, rows, strict=True))]
    (tmp_path / "a.csv").write_text("\n".join(lines), encoding="utf-8")
    reading = read(tmp_path / "a.csv")
    np.testing.assert_allclose(reading.motion.frames[:, :52], 0.01 * plain(tmp_path).frames[:, :52], atol=1e-7)
    assert "per cent" in reading.remarks[0]


def test_per_cent_is_told_and_divided(tmp_path):
    hundredfold = np.concatenate([100 * VALUES[:, :52], VALUES[:, 52:]], axis=1)
    path = write(tmp_path / "a.csv", CODES, hundredfold)
    reading = read(path)
    np.testing.assert_allclose(reading.motion.frames, plain(tmp_path).frames, atol=1e-6)
    assert "taken as per cent and divided by 100" in reading.remarks[0]
    np.testing.assert_allclose(read_livelink(path).values, VALUES, atol=1e-9)
    with pytest.raises(FacesynthError, match="weights up to 25"):
        read(write(tmp_path / "b.csv", CODES, 255 * VALUES))
    loud = np.where(np.arange(61) == 17, 1.4 * VALUES, VALUES)
    assert "those over 1 are taken as 1" in read(write(tmp_path / "c.csv", CODES, loud)).remarks[0]


@pytest.mark.parametrize(("scale", "taken"), [(1.8, "taken as 1"), (2.6, "taken as per cent")])
def test_many_weights_a_little_over_1_are_told_as_doubtful(tmp_path, scale, taken):
    """Per cent of a quiet face, or shares that somebody exaggerated: both look like this."""
    scaled = np.concatenate([scale * VALUES[:, :52], VALUES[:, 52:]], axis=1)
    doubts = [line for line in read(write(tmp_path / "a.csv", CODES, scaled)).remarks if "doubtful" in line]
    assert len(doubts) == 1
    assert taken in doubts[0]
    assert "\n" not in doubts[0]
    few = np.where(np.arange(61) == 17, 1.4 * VALUES, VALUES)
    assert not any("doubtful" in line for line in read(write(tmp_path / "b.csv", CODES, few)).remarks)
    loud = np.concatenate([100 * VALUES[:, :52], VALUES[:, 52:]], axis=1)
    assert not any("doubtful" in line for line in read(write(tmp_path / "c.csv", CODES, loud)).remarks)


def test_the_52_weights_alone(tmp_path):
    reading = read(write(tmp_path / "a.csv", CODES, VALUES[:, :52], WEIGHTS))
    assert len(reading.motion.layout.names) == 52
    assert reading.motion.head is None
    assert reading.motion.eyes is None
    assert "no angles of head and eyes" in reading.remarks[0]
    np.testing.assert_allclose(reading.motion.frames, VALUES[:, :52], atol=1e-7)
    without_count = read(write(tmp_path / "b.csv", CODES, VALUES[:, :52], WEIGHTS, first=("Timecode",)))
    np.testing.assert_allclose(without_count.motion.frames, VALUES[:, :52], atol=1e-7)


def test_corpus_add_reads_and_tells(tmp_path):
    hundredfold = np.concatenate([100 * VALUES[:, :52], VALUES[:, 52:]], axis=1)
    path = write(tmp_path / "take.csv", CODES, hundredfold, **ODD["UTF-16 with semicolons"])
    bringing.save_wav(tmp_path / "take.wav", bringing.hum(2.0), bringing.RATE)
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n2.0 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", path, tmp_path / "take.wav", tmp_path / "take.lab")
    assert "taken as per cent" in " ".join(report["remarks"]["take"])
    assert "taken as per cent" in account
    assert not [problem for problem in bringing.checked(tmp_path / "c") if "per cent" in problem["what"]]


@pytest.mark.parametrize("suffix", ["csv", "npz"])
def test_weights_of_any_table_in_per_cent(tmp_path, suffix):
    """Curves of a table under ARKit's names; what has names of its own is as it was measured."""
    names = [*ARKIT_NAMES[:20], "breath"]
    shares = np.random.default_rng(4).random((60, 21))
    for scale in (1.0, 100.0):
        path = tmp_path / f"a{scale:g}.{suffix}"
        values = shares * np.array([scale] * 20 + [40.0])
        if suffix == "npz":
            np.savez(path, weights=values, names=np.array(names), fps=60.0)
        else:
            rows = np.column_stack([np.arange(60) / 60, values])
            np.savetxt(path, rows, delimiter=",", header=",".join(["time_s", *names]), comments="", fmt="%.8f")
        reading = read(path)
        np.testing.assert_allclose(reading.motion.frames, shares * np.array([1.0] * 20 + [40.0]), atol=1e-5)
        assert any("per cent" in remark for remark in reading.remarks) == (scale == 100)


def header(change):
    """A change of a take's first line."""
    return lambda text: change(text.partition("\n")[0]) + text[text.index("\n") :]


def each_line(change):
    return lambda text: "".join(f"{change(number, line)}\n" for number, line in enumerate(text.splitlines()))


DRESSED = {
    "another capital": header(lambda line: line.replace("BlendshapeCount", "BlendShapeCount")),
    "words": header(lambda line: re.sub("(?<=[a-z])(?=[A-Z])", " ", line).replace("Timecode", "Time Code")),
    "underscores": header(lambda line: re.sub("(?<=[a-z])(?=[A-Z])", "_", line).lower()),
    "the name of the face": header(lambda line: re.sub(r"(?<=,)(?=[EJMBCNTHLR])", "Face.", line)),
    "a separator at the end": each_line(lambda _, line: f"{line},"),
    "a separator behind the numbers": each_line(lambda number, line: f"{line}," if number else line),
    "a column of notes": each_line(lambda number, line: f"{line},{'abc' if number else 'Note'}"),
    "the header again": lambda text: text + text.partition("\n")[0] + "\n",
    "empty lines before it": lambda text: "\n \n" + text,
    "Excel's separator": lambda text: "sep=,\n" + text,
    "NUL at the end": lambda text: text + "\0\0",
    "quoted decimal commas": each_line(
        lambda number, line: line if not number else re.sub(r"(-?\d+)\.(\d{10})", r'"\1,\2"', line)
    ),
}


@pytest.mark.parametrize("kind", DRESSED)
def test_the_same_take_after_other_programs(tmp_path, kind):
    path = write(tmp_path / "a.csv", CODES, VALUES)
    path.write_text(DRESSED[kind](path.read_text(encoding="utf-8")), encoding="utf-8")
    assert is_live_link(path)
    got, wanted = read(path), plain(tmp_path)
    assert got.motion.layout.names == wanted.layout.names
    np.testing.assert_allclose(got.motion.frames, wanted.frames, atol=1e-6)
    np.testing.assert_allclose(got.motion.head, wanted.head, atol=1e-6)
    assert any("columns that are no weights were left out: Note" in line for line in got.remarks) == ("notes" in kind)
