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


@pytest.mark.parametrize("fps", [24, 25, 30000 / 1001, 30, 60000 / 1001, 60, 120])
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
