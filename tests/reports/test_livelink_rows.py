"""Takes whose rows were lost, doubled, or stand at time codes that go back: rows stand at their time codes."""

import bringing
import numpy as np
import pytest
from takes import timecodes_of, values_of, write

from facesynth.corpus import Corpus
from facesynth.corpus.importers.formats import read
from facesynth.face.files.livelink import read_livelink
from facesynth.inference.errors import FacesynthError

COUNT = 180


def jaw(motion):
    return motion.frames[:, motion.layout.names.index("jawOpen")]


@pytest.mark.parametrize("fps", [12, 15, 20, 24, 25, 30000 / 1001, 30, 60000 / 1001, 60, 120])
def test_lost_rows_are_gaps_at_their_time(tmp_path, fps):
    codes, values = timecodes_of(COUNT, fps), values_of(COUNT)
    lost = [40, 41, 42, 77, *range(120, 131)]
    kept = np.setdiff1d(np.arange(COUNT), lost)
    reading = read(write(tmp_path / "a.csv", [codes[k] for k in kept], values[kept]))
    assert reading.motion.fps == pytest.approx(fps, abs=1e-9)
    assert len(reading.motion) == COUNT
    np.testing.assert_allclose(jaw(reading.motion)[kept], kept / COUNT, atol=1e-6)
    for part in (reading.motion.frames, reading.motion.head, reading.motion.eyes):
        assert np.array_equal(np.flatnonzero(np.isnan(part).all(axis=1)), lost)
    assert reading.remarks == ("15 of 180 frames have no row by the time codes: they are gaps",)


def test_lost_rows_of_a_clock_that_runs_ahead_and_falls_back(tmp_path):
    """Most steps are 1.037 frames long, some 0.837: a gap of 15 frames is still 15 frames."""
    codes, values = timecodes_of(COUNT), values_of(COUNT)
    codes = [f"{code.partition('.')[0]}.{400 + 37 * k % 200}" for k, code in enumerate(codes)]
    kept = np.setdiff1d(np.arange(COUNT), np.arange(40, 55))
    reading = read(write(tmp_path / "a.csv", [codes[k] for k in kept], values[kept]))
    assert reading.motion.fps == pytest.approx(60, rel=2e-4)
    np.testing.assert_allclose(jaw(reading.motion)[kept], kept / COUNT, atol=1e-6)
    assert reading.remarks == ("15 of 180 frames have no row by the time codes: they are gaps",)


LOST_FACES = {
    "count of 0 alone": lambda row: row.split(",")[0] + ",0",
    "empty cells": lambda row: row.split(",")[0] + ",0" + "," * 61,
    "zeros": lambda row: row.split(",")[0] + ",0" + ",0.0" * 61,
    "NaN": lambda row: row.split(",")[0] + ",61" + ",nan" * 61,
}


@pytest.mark.parametrize("kind", LOST_FACES)
def test_rows_of_a_face_that_was_lost_are_gaps(tmp_path, kind):
    path = write(tmp_path / "a.csv", timecodes_of(COUNT), values_of(COUNT))
    lost = [0, 1, *range(50, 70)]
    header, *rows = path.read_text(encoding="utf-8").splitlines()
    text = "\n".join([header, *(LOST_FACES[kind](row) if k in lost else row for k, row in enumerate(rows))])
    path.write_text(text, encoding="utf-8")
    reading = read(path)
    kept = np.setdiff1d(np.arange(COUNT), lost)
    np.testing.assert_allclose(jaw(reading.motion)[kept], kept / COUNT, atol=1e-6)
    for part in (reading.motion.frames, reading.motion.head, reading.motion.eyes):
        assert np.array_equal(np.flatnonzero(np.isnan(part).all(axis=1)), lost)
    assert reading.remarks == ("22 of 180 rows hold no values, as where the face was lost: they are gaps",)
    with pytest.raises(FacesynthError, match="rows without values"):
        read_livelink(path)


@pytest.mark.parametrize("doubled", [[10, 11, 90], list(range(COUNT))])
def test_rows_that_are_there_twice_are_read_once(tmp_path, doubled):
    codes, values = timecodes_of(COUNT), values_of(COUNT)
    order = np.sort(np.concatenate([np.arange(COUNT), doubled]))
    reading = read(write(tmp_path / "a.csv", [codes[k] for k in order], values[order]))
    assert reading.motion.fps == 60
    np.testing.assert_allclose(jaw(reading.motion), np.arange(COUNT) / COUNT, atol=1e-6)
    assert reading.remarks == (f"{len(doubled)} of {len(order)} rows are there twice; each frame was read once",)


def test_a_time_code_that_goes_back_is_refused_by_its_row(tmp_path):
    codes, values = timecodes_of(COUNT), values_of(COUNT)
    path = write(tmp_path / "a.csv", [*codes[:90], *codes[30:120]], values)
    for reads in (read, read_livelink):
        with pytest.raises(FacesynthError, match=r"row 92: the time code goes back from 10:00:01:29\.000 to 10:00:00:30\.000"):
            reads(path)


@pytest.mark.parametrize("rate", [30, 60])
def test_drop_frame_time_codes_stay_with_the_clock(tmp_path, rate):
    """From 00:00:59;29 on the next frame is called 00:01:00;02."""
    codes, skipped = [], rate // 15
    for second in (58, 59, 60, 61):
        first = skipped if second == 60 else 0
        codes += [f"00:{second // 60:02d}:{second % 60:02d};{k:02d}" for k in range(first, rate)]
    reading = read(write(tmp_path / "a.csv", codes, values_of(len(codes))))
    assert reading.motion.fps == pytest.approx(rate * 1000 / 1001, abs=1e-9)
    assert len(reading.motion) == len(codes)
    assert reading.remarks == ()


def drop_frame(count, rate=30, first=58 * 30):
    """Numbers of hours, minutes, seconds and frames of drop-frame time codes."""
    skipped = rate // 15
    for number in range(first, first + count):
        minutes = next(m for m in range(60) if number < (m + 1) * 60 * rate - skipped * (m + 1 - (m + 10) // 10))
        named = number + skipped * (minutes - minutes // 10)
        yield named // (3600 * rate), named // (60 * rate) % 60, named // rate % 60, named % rate


DROPPED = {
    "semicolons throughout": ("{:02d};{:02d};{:02d};{:02d}", {}),
    "a point before the frame, known by the numbers left out": ("{:02d}:{:02d}:{:02d}.{:02d}", {}),
    "colons, known by the numbers left out": ("{:02d}:{:02d}:{:02d}:{:02d}", {}),
    "in a table with semicolons": ("{:02d}:{:02d}:{:02d};{:02d}", {"sign": ";", "decimal": ","}),
}


@pytest.mark.parametrize("kind", DROPPED)
def test_drop_frame_time_codes_in_other_spellings(tmp_path, kind):
    form, table = DROPPED[kind]
    codes, kept = [form.format(*parts) for parts in drop_frame(240)], np.setdiff1d(np.arange(240), [30, 31, 90])
    reading = read(write(tmp_path / "a.csv", [codes[k] for k in kept], values_of(240)[kept], **table))
    assert reading.motion.fps == pytest.approx(30000 / 1001, abs=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(jaw(reading.motion))), [30, 31, 90])
    assert len(reading.motion) == 240


@pytest.mark.parametrize("fps", [25, 30000 / 1001, 30, 60])
@pytest.mark.parametrize("form", ["{:02d}:{:02d}:{:02d}.{:03d}", "{:02d}:{:02d}:{:02d}:{:03d}", "{:02d}:{:02d}:{:02d}.{:06d}"])
def test_time_codes_that_count_thousandths_of_a_second(tmp_path, fps, form):
    scale = 1_000_000 if "6d" in form else 1000
    parts = [divmod(round((36000 + k / fps) * scale), scale) for k in range(COUNT)]
    codes = [form.format(s // 3600, s // 60 % 60, s % 60, part) for s, part in parts]
    kept = np.setdiff1d(np.arange(COUNT), [40, 41, 90])
    reading = read(write(tmp_path / "a.csv", [codes[k] for k in kept], values_of(COUNT)[kept]))
    assert reading.motion.fps == pytest.approx(fps, abs=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(jaw(reading.motion))), [40, 41, 90])


def test_rows_twice_as_fast_as_the_time_code_counts(tmp_path):
    codes = [code for code in timecodes_of(COUNT // 2, 30) for _ in range(2)]
    reading = read(write(tmp_path / "a.csv", codes, values_of(COUNT)))
    assert reading.motion.fps == 60
    np.testing.assert_allclose(jaw(reading.motion), np.arange(COUNT) / COUNT, atol=1e-6)
    assert reading.remarks == ("each time code stands in 2 rows: they were taken for 60 frames a second",)


@pytest.mark.parametrize("fps", [25, 30000 / 1001, 60])
@pytest.mark.parametrize("column", ["time_s", "time_ms"])
def test_tables_with_times_lose_and_double_rows_too(tmp_path, fps, column):
    from facesynth.motion.arkit_names import ARKIT_NAMES

    values = values_of(COUNT)[:, :52]
    values[:, 0] = np.arange(COUNT) / COUNT
    times = 10 + np.arange(COUNT) / fps
    times = np.round(times * 1000) if column == "time_ms" else times
    lost = [40, 41, 42, 77, *range(120, 131)]
    for rows in (np.setdiff1d(np.arange(COUNT), lost), np.sort([*range(COUNT), 10, 11, 90])):
        table = np.column_stack([times, values])[rows]
        np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=",".join([column, *ARKIT_NAMES]), comments="", fmt="%.6f")
        reading = read(tmp_path / "a.csv")
        assert reading.motion.fps == pytest.approx(fps, rel=1e-6)
        assert len(reading.motion) == COUNT
        seen = np.isfinite(reading.motion.frames[:, 0])
        np.testing.assert_allclose(reading.motion.frames[seen, 0], (np.arange(COUNT) / COUNT)[seen], atol=1e-3)
        assert len(reading.remarks) == 1
        assert 0 <= reading.motion.frames[seen].min() <= reading.motion.frames[seen].max() <= 1


@pytest.mark.parametrize("column", ["Time (s)", "Timestamp [ms]", "Frame"])
def test_columns_of_times_and_numbers_in_other_spellings(tmp_path, column):
    from facesynth.motion.arkit_names import ARKIT_NAMES

    kept = np.setdiff1d(np.arange(COUNT), [*range(50, 70), 90])
    counted = {"Frame": 1 + np.arange(COUNT), "Time (s)": np.arange(COUNT) / 25, "Timestamp [ms]": 40 * np.arange(COUNT)}[column]
    table = np.column_stack([counted, values_of(COUNT)[:, :52]])[kept]
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=",".join([column, *ARKIT_NAMES]), comments="", fmt="%.6f")
    reading = read(tmp_path / "a.csv", fps=25 if column == "Frame" else None)
    assert (reading.motion.fps, len(reading.motion)) == (25, COUNT)
    assert np.isnan(reading.motion.frames[50:70]).all()
    np.testing.assert_allclose(reading.motion.frames[kept], values_of(COUNT)[kept, :52], atol=1e-5)
    assert len(reading.remarks) <= 2


def test_takes_over_midnight_and_trembling_clocks(tmp_path):
    codes = timecodes_of(COUNT, start_s=86399.0)
    codes = [code.replace("24:", "00:", 1) if code.startswith("24:") else code for code in codes]
    assert len(read(write(tmp_path / "a.csv", codes, values_of(COUNT))).motion) == COUNT
    rng = np.random.default_rng(0)
    from facesynth.motion.timecode import timecode

    trembling = [timecode(36000 + (k + rng.uniform(-0.2, 0.2)) / 60, 60) for k in range(1, 1001)]
    motion = read(write(tmp_path / "b.csv", trembling, values_of(1000))).motion
    assert motion.fps == pytest.approx(60, rel=1e-3)
    assert len(motion) == 1000


def test_a_take_of_half_a_second_needs_its_rate(tmp_path):
    path = write(tmp_path / "a.csv", timecodes_of(15), values_of(15))
    with pytest.raises(FacesynthError, match="too short to show its frame rate"):
        read(path)
    assert read(path, fps=60).motion.fps == 60


def test_corpus_add_tells_what_was_lost(tmp_path):
    codes, values = timecodes_of(COUNT), values_of(COUNT)
    kept = np.setdiff1d(np.arange(COUNT), np.arange(100, 115))
    path = write(tmp_path / "take.csv", [codes[k] for k in kept], values[kept])
    bringing.save_wav(tmp_path / "take.wav", bringing.hum(3.0), bringing.RATE)
    (tmp_path / "take.lab").write_text("0.5 pau\n1.3 aa\n3.0 pau\n", encoding="utf-8")
    report, account = bringing.added(tmp_path / "c", path, tmp_path / "take.wav", tmp_path / "take.lab")
    assert "15 of 180 frames have no row" in " ".join(report["remarks"]["take"])
    assert "15 of 180 frames have no row" in account
    stored = Corpus.open(tmp_path / "c")
    assert stored.fps == 60
    assert len(stored["take"].motion) == COUNT
    write(tmp_path / "back.csv", [*codes[:90], *codes[30:120]], values)
    bringing.save_wav(tmp_path / "back.wav", bringing.hum(3.0), bringing.RATE)
    said, _ = bringing.added(tmp_path / "c", tmp_path / "back.csv", tmp_path / "back.wav")
    assert "row 92: the time code goes back" in said
